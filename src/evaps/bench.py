"""How fast things are, measured in turns in one run, since machines are noisy: ratios say more than rates."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from evaps.dsl import Program, run
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS, sample_program
from evaps.models import METHODS, Model, load_model, new_method
from evaps.models.base import Execution, Repairer, Synthesizer, pad
from evaps.models.compute import autocast, device
from evaps.robots.base import Robot, Scene
from evaps.robots.doom import _BUTTONS, _NO_BUTTON, REST_AFTER_RESET, TICS, DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.synthesis.features import embed
from evaps.synthesis.repair import synthesize_with
from evaps.tasks.generate import Draft, generate_task
from evaps.tasks.task import EXAMPLES, Example, Task

SEED = 0
ROUNDS = 5  # of each pair of things that are compared; the best of each counts


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Attributes:
        name: what was measured.
        value: how much.
        unit: of what.
        target: what it should be, as text; empty if there is no target.
    """

    name: str
    value: float
    unit: str
    target: str = ""


def bench(model: str, seconds: float = 5.0) -> Iterator[Figure]:
    """Measure everything, one figure after the other.

    Args:
        model: a shipped set of checkpoints, or a folder of them.
        seconds: about how long a rate is measured.
    """
    robot = DoomRobot()
    try:
        yield from engine_figures(robot)
        yield from memo_figures(robot)
        yield from generation_figures(robot, seconds)
        loaded = load_model(model)
        yield from feature_figures(robot, loaded)
        yield from synthesis_figures(robot, loaded, seconds)
    finally:
        robot.close()
    yield from training_figures(seconds)


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _best(*works: Callable[[], object]) -> list[float]:
    """The shortest time of each work, taken in turns, so that a noisy moment meets all of them."""
    times = [[_seconds(work) for work in works] for _ in range(ROUNDS)]
    return [min(column) for column in zip(*times, strict=True)]


def _walks(rng: np.random.Generator, walks: int, length: int) -> list[tuple[Scene, list[str]]]:
    return [(random_scene(rng), [str(a) for a in rng.choice(ACTIONS, length)]) for _ in range(walks)]


def engine_figures(robot: DoomRobot) -> Iterator[Figure]:
    """The engine's own speed, and what our execution adds to it."""
    walks = _walks(np.random.default_rng(SEED), 10, 8)

    def ours() -> None:
        for scene, actions in walks:
            robot.reset(scene)
            for action in actions:
                robot.act(action)
                robot.perceive(PERCEPTION_KEYS[0])
                robot.observe()

    ours()  # starts the engine
    game = robot._game
    tics = sum(sum(TICS[action]) for _, actions in walks for action in actions)

    def bare() -> None:
        with robot._engine():  # on the engine's core, as ours
            for scene, actions in walks:
                game.set_seed(0)
                game.new_episode()
                robot._place(scene)
                _rest(game, REST_AFTER_RESET)
                for action in actions:
                    pressed, rest = TICS[action]
                    game.set_action(_BUTTONS[action])
                    game.advance_action(pressed, False)
                    game.set_action(_NO_BUTTON)
                    _rest(game, rest)

    def no_frames() -> None:
        with robot._engine():
            game.advance_action(tics, False)

    def resets() -> None:
        for scene, _ in walks:
            robot.reset(scene)

    own, raw, plain, placed = _best(ours, bare, no_frames, resets)
    yield Figure("engine, tics without frames", tics / plain, "1/s")
    yield Figure("scenes set up", len(walks) / placed, "1/s")
    yield Figure("actions, with view and perceptions", sum(len(a) for _, a in walks) / (own - placed), "1/s")
    yield Figure("execution, as a ratio to the bare engine", own / raw, "x", "<= 1.15")


def _rest(game: Any, tics: int) -> None:
    game.advance_action(tics - 1, True)
    game.advance_action(1, True)
    game.get_state()


def memo_figures(robot: DoomRobot) -> Iterator[Figure]:
    """Checking 20 candidates and five repairs of each on six scenes, memoised and not."""
    rng = np.random.default_rng(SEED)
    memo = MemoRobot(robot, PERCEPTION_KEYS)
    draft = next(d for d in (generate_task(SEED, i, memo) for i in range(100)) if d.steps >= 4)
    programs: list[Program] = []
    for _ in range(20):
        programs.append(mutate(draft.program, rng, 2))
        for _ in range(EXAMPLES):
            programs.append(mutate(programs[-1], rng))

    def check(on: Robot) -> int:
        actions = 0
        for program in programs:
            for scene in draft.scenes:
                on.reset(scene)
                actions += len(run(program, on).actions)
        return actions

    def memoised() -> None:
        memo.forget()
        check(memo)

    before = memo.simulated_actions
    memoised()
    simulated = memo.simulated_actions - before
    with_memo, without = _best(memoised, lambda: check(robot))
    yield Figure("memoised worlds: fewer engine actions", check(memo) / simulated, "x", ">= 5")
    yield Figure("memoised worlds: less time", without / with_memo, "x", ">= 4")


def generation_figures(robot: DoomRobot, seconds: float) -> Iterator[Figure]:
    """Accepted tasks a second on one core, and how much of that their six examples alone would take."""
    memo = MemoRobot(robot, PERCEPTION_KEYS)
    drafts: list[Draft] = []
    start = time.perf_counter()
    while time.perf_counter() - start < seconds:
        drafts.append(generate_task(SEED + 1, len(drafts), memo))
    spent = time.perf_counter() - start

    def examples_alone() -> None:
        for draft in drafts:
            memo.forget()
            for scene in draft.scenes:
                memo.reset(scene)
                run(draft.program, memo)

    yield Figure("tasks generated, one core", len(drafts) / spent, "1/s", ">= 10")
    yield Figure("of which their six examples alone take", 100 * _seconds(examples_alone) / spent, "%")


def feature_figures(robot: DoomRobot, model: Model) -> Iterator[Figure]:
    """Observations embedded a second."""
    rng = np.random.default_rng(SEED)
    frames = []
    for _ in range(128):
        robot.reset(random_scene(rng))
        frames.append(robot.observe())
    (spent,) = _best(lambda: embed(model.encoder, frames))
    yield Figure("observations embedded", len(frames) / spent, "1/s")


def synthesis_figures(robot: DoomRobot, model: Model, seconds: float) -> Iterator[Figure]:
    """How long a user waits for an answer, over random tasks."""
    memo = MemoRobot(robot, PERCEPTION_KEYS)
    drafts = [generate_task(SEED + 2, index, memo) for index in range(max(3, int(4 * seconds)))]
    times = []
    for draft in drafts:
        memo.forget()
        pairs = zip(draft.scenes[:EXAMPLES], draft.last[:EXAMPLES], strict=True)
        task = Task("bench", tuple(Example(scene, goal) for scene, goal in pairs))
        times.append(_seconds(partial(synthesize_with, model, task, memo)))
    yield Figure("synthesis with repair, median", float(np.median(times)), "s")
    yield Figure("synthesis with repair, 95th percentile", float(np.percentile(times, 95)), "s")


def training_figures(seconds: float, batch: int = 64) -> Iterator[Figure]:
    """Programs that each method learns from in a second."""
    rng = np.random.default_rng(SEED)
    programs = [sample_program(rng) for _ in range(batch)]
    for name in METHODS:
        method = new_method(name).to(device()).train()
        loss = _loss(method, programs, rng)
        optimizer = torch.optim.Adam(method.parameters())

        def step(loss: Callable[[], torch.Tensor] = loss, opt: torch.optim.Adam = optimizer) -> None:
            opt.zero_grad()
            with autocast():
                value = loss()
            value.backward()
            opt.step()

        step()  # wakes everything
        steps, start = 0, time.perf_counter()
        while time.perf_counter() - start < seconds:
            step()
            steps += 1
        yield Figure(f"training {name}", batch * steps / (time.perf_counter() - start), "programs/s")


def _loss(
    method: Synthesizer | Repairer, programs: Sequence[Program], rng: np.random.Generator
) -> Callable[[], torch.Tensor]:
    from evaps.dsl import VOCAB
    from evaps.train.methods import grammar_masks

    table = torch.randn(2000, 256)
    if isinstance(method, Synthesizer):
        ids = [VOCAB.encode(program.tokens) for program in programs]
        tokens = pad(ids)
        masks = torch.zeros(*tokens.shape, len(VOCAB), dtype=torch.bool)
        for mask, row in zip(masks, ids, strict=True):
            mask[: len(row)] = torch.from_numpy(grammar_masks(row))
        features = table[: 2 * EXAMPLES * len(programs)].unflatten(0, (len(programs), EXAMPLES, 2))
        where = device()
        inputs = features.to(where), tokens.to(where), masks.to(where)
        return lambda: method.loss(*inputs)
    wrong = [_execution(mutate(program, rng), rng, len(table)) for program in programs]
    return lambda: method.loss(wrong, programs, table.to(device()))


def _execution(program: Program, rng: np.random.Generator, rows: int) -> Execution:
    seen = [rng.integers(0, rows, (EXAMPLES, len(program.segments))) for _ in range(2)]
    return Execution(program, *seen, *(rng.integers(0, rows, EXAMPLES) for _ in range(3)))


def machine() -> str:
    """What the figures were measured on: processor, cores, precision."""
    import os
    import platform

    from evaps.models.compute import precision

    name = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = [line for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        name = lines[0].split(":")[1].strip() if lines else name
    return f"{name}, {os.cpu_count()} cores, {precision()}"
