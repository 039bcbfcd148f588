"""Random tasks: from (data set seed, index) alone, in any order, on any machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np

from evaps.dsl import ConditionEvent, Limits, Program, Trace, covered, run
from evaps.dsl.counting import longest_run, programs_of_shape
from evaps.dsl.sampler import PERCEPTION_KEYS, SamplerConfig, sample_program
from evaps.robots.base import Robot, Scene, WorldState
from evaps.robots.frames import Observation
from evaps.robots.memo import MemoRobot, RememberedView
from evaps.robots.world import world
from evaps.tasks.dataset import split_of
from evaps.tasks.questions import Asker, Endless, OpenProgram, Seen, Unanswered
from evaps.tasks.task import EXAMPLES, Example, Task

SCENES = 8  # drawn for a task; six of them become its examples
PROGRAMS = 24  # tried on these scenes before new ones are drawn
LEAST_STEPS = 2
USUAL_PROGRAMS = SamplerConfig()
USUAL_STEPS = 4  # longer tasks are thinned out in proportion, so that the mean is 4.6
FEW = 7**4  # shapes of fewer programs are thinned out in proportion: most of these would come again and again


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
class Run:
    """A run that halted, and where it ended."""

    scene: Scene
    trace: Trace[RememberedView]
    state: WorldState


def generate_task(seed: int, index: int, robot: MemoRobot, config: SamplerConfig = USUAL_PROGRAMS) -> Draft:
    """The task of this data set seed and index: five specification scenes and, last, a test scene.

    Programs are tried on a common handful of scenes, so that some of what they do has been simulated before;
    what their conditions ask is chosen by what these scenes show. A program that takes many steps is kept
    with the probability ``USUAL_STEPS / steps``: the most steps that it may take are drawn before it runs.
    """
    rng = np.random.default_rng([seed, index])
    conditionals = int(rng.choice(len(config.conditionals), p=config.conditionals))
    while True:
        robot.forget()
        scenes = [world().random_scene(rng) for _ in range(SCENES)]
        for _ in range(PROGRAMS):
            program = sample_program(rng, config, conditionals=conditionals)
            most = min(Limits().actions, int(USUAL_STEPS / (1 - rng.random())))
            if longest_run(program) < LEAST_STEPS or rng.random() > programs_of_shape(program) / FEW:
                continue
            draft = draft_task(OpenProgram(program), scenes, robot, rng, most)
            if draft is not None:
                return draft


def unseen_task(seed: int, robot: Robot) -> Task:
    """The first task of this seed whose program belongs to the test split: no method has learned from it."""
    memo = MemoRobot(robot, PERCEPTION_KEYS, eager=False)
    drafts = (generate_task(seed, index, memo) for index in count())
    draft = next(d for d in drafts if split_of(d.program) == "test")
    examples = map(Example, draft.scenes[:EXAMPLES], draft.last[:EXAMPLES])
    return Task(f"random-{seed}", tuple(examples))


def draft_task(
    program: OpenProgram,
    scenes: Sequence[Scene],
    robot: MemoRobot,
    rng: np.random.Generator,
    most: int = Limits().actions,
) -> Draft | None:
    """A task of the program on six of the scenes; None if it comes to nothing on them.

    All scenes are followed up to the first open condition; when it is closed they go on from there.

    Args:
        program: its open conditions are closed.
        scenes: to choose from.
        robot: where it runs.
        rng: for what the conditions ask.
        most: actions that a run may take; scenes on which it takes more are not used.
    """
    while True:
        runs, asked = _runs(program, scenes, robot, Limits(actions=most))
        if not asked:
            return _draft(program.program, runs)
        key = max(asked, key=lambda k: len(asked[k]))
        if not program.answer(key, asked[key], rng):
            return None


def _runs(
    program: OpenProgram, scenes: Sequence[Scene], robot: MemoRobot, limits: Limits
) -> tuple[list[Run], dict[str, list[Seen]]]:
    """Runs on as many scenes as are needed, and what was seen where others came to an open condition.

    Where there is no hope, there are no runs.
    """
    runs: list[Run] = []
    asked: dict[str, list[Seen]] = {}
    useful, closed = 0, program.program
    for tried, scene in enumerate(scenes, start=1):
        robot.reset(scene)
        start = robot.state()
        asker = Asker(robot, program, {thing.kind for thing in scene.things})
        try:
            trace = run(program.asking, asker, limits)
            if trace.halted:
                runs.append(Run(scene, trace, robot.state()))
                useful += 1
                if len(runs) <= 2 and robot.state() == start:  # it should usually change something
                    return [], {}
        except Unanswered as end:
            asked.setdefault(end.key, []).append(end.seen)
            useful += 1
        except Endless:
            pass
        if tried - useful > 1 + useful // 2:  # runs that do not halt are the dearest
            return [], {}
        if useful > EXAMPLES and (asked or choose_runs(closed, runs)):
            break
    return runs, asked


def choose_runs(program: Program | None, runs: Sequence[Run]) -> list[Run] | None:
    """Six runs of the program, the first five of which take every branch; None if there are none such."""
    if program is None or len(runs) <= EXAMPLES or not covered(program, [r.trace for r in runs]):
        return None
    spec: list[Run] = []
    for r in runs:  # first what takes a branch that none before it took
        traces = [s.trace for s in spec]
        if len(spec) < EXAMPLES and _branches([*traces, r.trace]) > _branches(traces):
            spec.append(r)
    rest = [r for r in runs if all(r is not s for s in spec)]
    chosen = [*spec, *rest][: EXAMPLES + 1]
    if not covered(program, [r.trace for r in chosen[:EXAMPLES]]):
        return None
    return chosen if max(len(r.trace.actions) for r in chosen) >= LEAST_STEPS else None


def _branches(traces: Sequence[Trace[RememberedView]]) -> int:
    return len({(e.segment, e.value) for t in traces for e in t.events if isinstance(e, ConditionEvent)})


def _draft(program: Program | None, runs: Sequence[Run]) -> Draft | None:
    chosen = choose_runs(program, runs)
    if program is None or chosen is None:
        return None
    return Draft(
        program,
        tuple(r.scene for r in chosen),
        tuple(r.trace.observations[0].frame for r in chosen),
        tuple(r.trace.observations[-1].frame for r in chosen),
        tuple(r.state for r in chosen),
        tuple(r.trace.actions for r in chosen),
    )
