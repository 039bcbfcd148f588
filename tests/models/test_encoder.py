"""The encoder and what stage 0 asks of it."""

from pathlib import Path

import numpy as np
import pytest
import torch

from evaps.dsl.sampler import ACTIONS
from evaps.models.encoder import Encoder, EncoderConfig, TransitionModel
from evaps.robots.base import Pose, Scene
from evaps.robots.doom import DoomRobot
from evaps.robots.frames import RgbFrame
from evaps.robots.workers import Workers
from evaps.synthesis.features import embed, stack_frames
from evaps.tasks.frames import pack_frames, rgbd, unpack_frames
from evaps.tasks.walks import LENGTH, Walks, generate_walks
from evaps.train.encoder import WalkBatches, batch_loss, drop_pixels, transitions


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory) -> Walks:
    folder = tmp_path_factory.mktemp("walks")
    start = (Scene(Pose(-400, 288, 0)), ("MOVE_FORWARD", "TURN_LEFT", "MOVE_FORWARD", "ATTACK", "MOVE_LEFT"))
    return Walks.read(generate_walks(folder, 0, 0, Workers(0), [start] * 2))


def test_walks_start_as_told_and_go_on(walks: Walks) -> None:
    assert walks.actions.shape == (2, LENGTH)
    names = [ACTIONS[a] for a in walks.actions[0]]
    assert names[:5] == ["MOVE_FORWARD", "TURN_LEFT", "MOVE_FORWARD", "ATTACK", "MOVE_LEFT"]


def test_transitions_say_what_happened(walks: Walks) -> None:
    happened = transitions(walks, np.array([0]), len(ACTIONS))
    rows = {(int(b), int(a)): i for i, (b, a) in enumerate(zip(happened.before, happened.after, strict=True))}
    assert len(rows) == LENGTH * (LENGTH + 1) // 2
    one_step = rows[0, 1]
    assert happened.counts[one_step].tolist() == [int(a == "MOVE_FORWARD") for a in ACTIONS]
    forward, left, sine, cosine, spent = happened.change[one_step].tolist()
    assert forward > 0.2
    assert abs(left) < 1e-3
    assert (sine, cosine, spent) == pytest.approx((0, 1, 0), abs=1e-3)
    turned = happened.change[rows[1, 2]].tolist()
    assert np.degrees(np.arctan2(turned[2], turned[3])) == pytest.approx(8.79, abs=0.02)
    after_turn = happened.change[rows[2, 3]].tolist()
    assert after_turn[:2] == pytest.approx([forward, 0], abs=2e-2)  # in the robot's own frame
    assert happened.change[rows[3, 4]][4] == pytest.approx(0.25)  # one bullet
    five = rows[0, 5]
    assert happened.counts[five].sum() == 5
    assert ACTIONS[happened.first[five]] == "MOVE_FORWARD"
    assert ACTIONS[happened.last[five]] == "MOVE_LEFT"


def test_stage_0_learns_a_batch(walks: Walks) -> None:
    torch.manual_seed(0)
    model = TransitionModel(EncoderConfig())
    batches = WalkBatches(walks, 2, 0)
    rows = np.array([0, 1])
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-3)
    losses = []
    for _ in range(12):
        loss, _ = batch_loss(model, walks, rows, batches.frames(rows))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.7 * losses[0]


def test_dropped_pixels_are_zero_in_every_channel(walks: Walks) -> None:
    frames = WalkBatches(walks, 2, 0).frames(np.array([0]))
    noisy = drop_pixels(frames.clone(), np.random.default_rng(0))
    changed = (noisy != frames).any(-1)
    assert 0 < changed.float().mean() < 0.2
    assert (noisy[changed] == 0).all()
    assert changed.flatten(1).any(1).sum() <= len(frames) // 2


def test_frames_are_the_same_however_they_are_stacked(tmp_path: Path) -> None:
    robot = DoomRobot()
    robot.reset(Scene(Pose(-300, 280, 10)))
    seen = robot.observe()
    robot.close()
    plain = RgbFrame(seen.rgb, seen.depth)
    for stacked in (stack_frames([seen]), stack_frames([plain]), rgbd(unpack_frames(pack_frames([seen])))):
        assert np.array_equal(stacked[0], np.dstack([seen.rgb, seen.depth]))
    encoder = Encoder(EncoderConfig()).eval()
    assert embed(encoder, [seen, seen]).shape == (2, 256)
