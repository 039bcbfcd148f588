"""Paths that are like others, and how the inverse model counts."""

import os
import subprocess
import sys

import numpy as np
import pytest
import torch

from evaps.dsl.sampler import ACTIONS
from evaps.models.inverse import AXES, InverseConfig, InverseModel, effect
from evaps.synthesis.traces import one_edit_away, with_detour, with_loop

PATH = ("MOVE_LEFT", "ATTACK")


def test_one_edit_away() -> None:
    edited = set(one_edit_away(PATH)) - {PATH}
    assert ("MOVE_LEFT",) in edited
    assert ("ATTACK", "ATTACK") in edited
    assert ("MOVE_LEFT", "TURN_LEFT", "ATTACK") in edited
    assert {len(path) for path in edited} == {1, 2, 3}
    assert len(edited) == 2 + 2 * 6 + 3 * 7 - 2  # two insertions next to an equal action come twice


def test_a_detour_is_undone_later() -> None:
    detours = set(with_detour(PATH))
    assert ("MOVE_FORWARD", "MOVE_LEFT", "MOVE_BACKWARD", "ATTACK") in detours
    assert ("TURN_RIGHT", "TURN_LEFT", *PATH) in detours
    assert all(len(path) == 4 for path in detours)


def test_a_part_is_repeated() -> None:
    looped = set(with_loop(PATH))
    assert ("MOVE_LEFT", "MOVE_LEFT", "ATTACK") in looped
    assert PATH * 3 in looped
    assert ("MOVE_LEFT", *["ATTACK"] * 8) in looped


def test_every_action_counts_on_an_axis() -> None:
    assert sorted(effect(a) for a in ACTIONS) == [(0, -1), (0, 1), (1, -1), (1, 1), (2, -1), (2, 1), (3, 1)]
    with pytest.raises(KeyError):
        effect("JUMP")


def test_what_is_left_is_an_expectation() -> None:
    torch.manual_seed(0)
    model = InverseModel(InverseConfig(feature=8, pair=16, most=2)).eval()
    before, after = torch.randn(3, 8), torch.randn(3, 8)
    shares = model(before, after).softmax(-1).detach().numpy()
    counts = np.arange(-2, 3)
    left, after_each = model.left(before, after, ACTIONS)
    np.testing.assert_allclose(left.numpy(), (shares * abs(counts)).sum((1, 2)), rtol=1e-5)
    for column, action in enumerate(ACTIONS):
        axis, step = effect(action)
        moved = shares * abs(counts - step * np.eye(len(AXES))[axis][:, None])
        np.testing.assert_allclose(after_each[:, column].numpy(), moved.sum((1, 2)), rtol=1e-5)


def test_it_learns_counts() -> None:
    torch.manual_seed(0)
    model = InverseModel(InverseConfig(feature=8, pair=64, most=3))
    optimizer = torch.optim.Adam(model.parameters(), lr=3e-3)
    wanted = torch.randint(-3, 4, (256, len(AXES)))
    before = torch.randn(256, 8)
    after = before.clone()
    after[:, : len(AXES)] += wanted
    for _ in range(200):
        optimizer.zero_grad()
        loss = model.loss(before, after, wanted)
        loss.backward()
        optimizer.step()
    right = (model(before, after).argmax(-1) - 3 == wanted).float().mean()
    assert right > 0.95


SAME_ORDER = """
import torch, numpy as np
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.models import load_model
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.traces import TraceSearch, one_edit_away
from evaps.tasks.task import Example, Task

torch.set_num_threads(1)
rng, robot, model = np.random.default_rng(1), MemoRobot(DoomRobot(), PERCEPTION_KEYS), load_model()
examples = []
for number in range(5):
    scene = random_scene(rng)
    robot.reset(scene)
    for action in ("MOVE_LEFT", "ATTACK", "MOVE_FORWARD")[: 1 + number % 3]:
        robot.act(action)
    examples.append(Example(scene, robot.observe().frame))
robot.forget()
search = TraceSearch(Task("t", tuple(examples)), robot, FeatureTable(model.encoder), model.inverse)
for step in range(12):
    search.step(slack=0)
    search.suggest_ways(one_edit_away)
    search.suggest(one_edit_away)
print([sorted(len(n.actions) for n in scene.known) for scene in search.scenes])
print([[path for _, _, path in scene.trials] for scene in search.scenes], robot.simulated_actions)
robot.close()
"""


@pytest.mark.slow
def test_the_search_is_the_same_in_every_process() -> None:
    """Whatever the seed of hashes, by which sets are ordered."""
    outputs = []
    for seed in ("1", "2"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-c", SAME_ORDER]
        done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=120)
        assert done.returncode == 0, done.stderr
        outputs.append(done.stdout)
    assert outputs[0] == outputs[1]
