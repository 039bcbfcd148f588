"""Random tasks: from (data set seed, index) alone, in any order, on any machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaps.dsl import ConditionEvent, Program, Trace, covered, run
from evaps.dsl.sampler import PERCEPTIONS, SamplerConfig, sample_program
from evaps.robots.base import Observation, Scene, WorldState
from evaps.robots.memo import MemoRobot
from evaps.robots.scenes import random_scene
from evaps.tasks.task import EXAMPLES

SCENES = 10  # drawn for a task; six of them become its examples
PROGRAMS = 24  # tried on these scenes before new ones are drawn
LEAST_STEPS = 2
USUAL_PROGRAMS = SamplerConfig()
USUAL_STEPS = 4  # longer tasks are thinned out in proportion, so that the mean is 4.6


@dataclass(frozen=True)
class Draft:
    """A program with scenes on which it halts, takes every branch, and changes something."""

    program: Program
    scenes: tuple[Scene, ...]
    first: tuple[Observation, ...]
    last: tuple[Observation, ...]
    states: tuple[WorldState, ...]
    actions: tuple[tuple[str, ...], ...]

    @property
    def steps(self) -> int:
        """The most actions that the program executes on one of the scenes."""
        return max(map(len, self.actions))


@dataclass(frozen=True)
class _Run:
    scene: Scene
    trace: Trace[Observation]
    state: WorldState
    changed: bool


def generate_task(seed: int, index: int, robot: MemoRobot, config: SamplerConfig = USUAL_PROGRAMS) -> Draft:
    """The task of this data set seed and index: five specification scenes and, last, a test scene.

    Programs are tried on a common handful of scenes, so that most of what they do has been simulated
    before; conditions prefer perceptions that differ between the scenes.
    """
    rng = np.random.default_rng([seed, index])
    conditionals = int(rng.choice(len(config.conditionals), p=config.conditionals))
    while True:
        robot.forget()
        scenes = [random_scene(rng) for _ in range(SCENES)]
        perceptions = _telling_perceptions(scenes, robot) if conditionals else PERCEPTIONS
        for _ in range(PROGRAMS):
            program = sample_program(rng, config, perceptions, conditionals)
            chosen = choose_scenes(program, scenes, robot)
            if chosen is not None and rng.random() < USUAL_STEPS / _steps(chosen):
                return _draft(program, chosen)


def _telling_perceptions(scenes: Sequence[Scene], robot: MemoRobot) -> tuple:  # type: ignore[type-arg]
    """All perceptions, and those twice more that are true in some of the scenes and false in others."""
    seen = []
    for scene in scenes:
        robot.reset(scene)
        seen.append(robot.node.perceptions)
    telling = [p for p in PERCEPTIONS if len({p.key in found for found in seen}) == 2]
    return (*PERCEPTIONS, *telling, *telling)


def choose_scenes(program: Program, scenes: Sequence[Scene], robot: MemoRobot) -> list[_Run] | None:
    """Six runs of the program, the first five of which take every branch; None if these scenes have none."""
    runs: list[_Run] = []
    for tried, scene in enumerate(scenes, start=1):
        robot.reset(scene)
        start = robot.state()
        trace = run(program, robot)
        if trace.halted:
            runs.append(_Run(scene, trace, robot.state(), robot.state() != start))
        elif tried - len(runs) > 1 + len(runs) // 2:  # runs that do not halt are the dearest
            return None
        if len(runs) > EXAMPLES and (chosen := _covering(program, runs)):
            return chosen
    return None


def _covering(program: Program, runs: list[_Run]) -> list[_Run] | None:
    if _steps(runs) < LEAST_STEPS or not all(r.changed for r in runs[:2]):
        return None
    if not covered(program, [r.trace for r in runs]):
        return None
    spec: list[_Run] = []
    for r in runs:  # first what takes a branch that none before it took
        traces = [s.trace for s in spec]
        if len(spec) < EXAMPLES and _branches(program, [*traces, r.trace]) > _branches(program, traces):
            spec.append(r)
    rest = [r for r in runs if r not in spec]
    spec += rest[: EXAMPLES - len(spec)]
    if not covered(program, [r.trace for r in spec]):
        return None
    test = next(r for r in runs if all(r is not s for s in spec))
    chosen = [*spec, test]
    return chosen if _steps(chosen) >= LEAST_STEPS else None


def _steps(runs: Sequence[_Run]) -> int:
    return max(len(r.trace.actions) for r in runs)


def _branches(program: Program, traces: Sequence[Trace[Observation]]) -> int:
    return len({(e.segment, e.value) for t in traces for e in t.events if isinstance(e, ConditionEvent)})


def _draft(program: Program, runs: Sequence[_Run]) -> Draft:
    return Draft(
        program,
        tuple(r.scene for r in runs),
        tuple(r.trace.observations[0] for r in runs),
        tuple(r.trace.observations[-1] for r in runs),
        tuple(r.state for r in runs),
        tuple(r.trace.actions for r in runs),
    )
