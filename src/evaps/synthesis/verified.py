"""Verified synthesis: one answer, found by running what it might be and kept because it works.

1. Traces: in the memoised tree of each scene, find action sequences that reach the goal, guided by the
   inverse model (`evaps.synthesis.traces`).
2. Programs: find the shortest programs that explain all traces (`evaps.synthesis.explain`). Where there is
   none, look at more of the trees, and try again.
3. The answer: of the programs that pass all pairs one that, on further random scenes, ends as most of the
   others do, the cheap ones counting most. How far they agree with it is the confidence in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, compress

import numpy as np

from evaps.dsl import Action, Program
from evaps.dsl.sampler import ACTIONS, PERCEPTION_KEYS
from evaps.models import Model
from evaps.models.compute import autocast
from evaps.robots.base import Scene
from evaps.robots.frames import digest
from evaps.robots.memo import MemoRobot
from evaps.robots.together import run_together
from evaps.robots.world import world
from evaps.synthesis.budget import USUAL_BUDGET, Budget, Meter
from evaps.synthesis.crossover import crossovers
from evaps.synthesis.explain import Explainer, Limits, cost_of
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.graph import Graph
from evaps.synthesis.repair import propose
from evaps.synthesis.solution import Attempt, Candidate, Solution, attempt_all
from evaps.synthesis.traces import TraceSearch, one_edit_away, with_detour, with_loop
from evaps.synthesis.watch import NOBODY, News, Watch
from evaps.tasks.task import Task

ORIGIN = "verified"
FIRST_LOOK = 4  # rounds of looking around before programs are looked for
MORE_LOOKS = 4  # times that it is looked around twice as long, if there is no program yet
LARGER_BLOCKS = 6  # actions in a block, when programs with smaller ones explain nothing
PARTIAL = Limits(work=100_000, programs=100, extra=8)  # for programs that explain some of the scenes
SOME = Limits(work=100_000)
NOTHING_FOUND = Program((Action(ACTIONS[-1]),))
GRACE = 1.5  # times its seconds that a search may take to make something of what it has found
REPAIRED = 8  # candidates that are repaired, if there is a repairer
REPAIRS = 8  # of each
PROBES = 4  # further scenes on which programs are compared
PROBED = 20  # programs that are
DEARER = 1.5  # so many times less does a program count for each bit that it costs: 2 if the prior were exact


@dataclass(frozen=True)
class Parts:
    """Parts of the search, each of which can be left out to see what it is worth.

    Attributes:
        guide: the inverse model; without it shorter paths are tried first.
        sharing: what has led to a goal is tried in other scenes, and what is like it.
        beam: where nothing is found for long, the synthesizer's candidates are tried.
    """

    guide: bool = True
    sharing: bool = True
    beam: bool = True


Ends = tuple[object, ...]
"""What the robot sees at the end of a program on each further scene."""
Doubt = tuple[Scene, Program] | None
"""A scene, and a program that ends otherwise there than the answer."""

ALL_PARTS = Parts()


def synthesize_verified(
    model: Model,
    task: Task,
    robot: MemoRobot,
    top_k: int = 20,
    budget: Budget = USUAL_BUDGET,
    parts: Parts = ALL_PARTS,
    seed: int = 0,
    watch: Watch = NOBODY,
) -> Solution:
    """Search for programs that pass all pairs; if none is found, those that pass most.

    Args:
        model: with an inverse model; if it has a repairer, its repairs are tried, too.
        task: the specification.
        robot: remembers what was simulated; eager.
        top_k: how many candidates come back at most; no two of them do the same on all scenes that were run.
        budget: what it may cost.
        parts: what is left out.
        seed: of the further scenes.
        watch: follows the search, and may end it.
    """
    return _Search(model, task, robot, budget, parts, watch).solution(top_k, seed)


class _Search:
    def __init__(
        self, model: Model, task: Task, robot: MemoRobot, budget: Budget, parts: Parts, watch: Watch
    ) -> None:
        assert model.inverse is not None
        self.model, self.task, self.robot, self.budget, self.parts = model, task, robot, budget, parts
        self.watch = watch
        self.meter = Meter(robot)
        self.table = FeatureTable(model.encoder, task.noise)
        self.traces = TraceSearch(task, robot, self.table, model.inverse, parts.guide, parts.sharing)
        self.proposals: list[Program] = []

    @property
    def over(self) -> bool:
        """Whether the budget is spent, or nobody wants to wait any longer."""
        return self.meter.exceeds(self.budget) or self.watch.stopped()

    def late(self) -> bool:
        """Whether nobody wants to wait for explanations any longer either."""
        return self.meter.seconds > GRACE * self.budget.seconds or self.watch.stopped()

    def tell(self, text: str, best: Attempt | None = None) -> None:
        """Say what has happened, and which goals are reached."""
        passed = best.passed if best else self.traces.reached
        program = best.program if best else None
        self.watch.tell(News(text, passed, program, self.meter.actions, self.meter.seconds))

    def solution(self, top_k: int, seed: int) -> Solution:
        """Search, choose, and say what it has cost."""
        self.reach_goals()
        programs = self.explain() or self.explain_some()
        attempts = attempt_all(programs, self.task, self.robot)
        if not any(a.solved for a in attempts):
            scenes = [example.scene for example in self.task.examples]
            attempts += attempt_all(crossovers(attempts, scenes, self.robot), self.task, self.robot)
        attempts.sort(key=lambda a: (-a.pairs_passed, cost_of(a.program)))
        solved = sum(a.solved for a in attempts)
        self.tell(f"{solved} of {len(attempts)} programs pass all examples", attempts[0])
        kept, confidence, doubt = self.choose(attempts[:PROBED], top_k, seed)
        candidates = tuple(Candidate((a,), rank, ORIGIN) for rank, a in enumerate(kept))
        spent, seconds = self.meter.actions, self.meter.seconds
        return Solution(self.task.name, candidates, spent, seconds, candidates, confidence, doubt)

    def reach_goals(self) -> None:
        """Find a way to the goal in every scene."""
        plans = self._plans()
        plan = next(plans)
        told: tuple[bool, ...] = ()
        while not self.traces.complete and not self.over:
            if (reached := self.traces.reached) != told:
                told = reached
                self.tell(f"ways to {sum(reached)} of {len(reached)} goals")
            if self.meter.actions >= plan[0]:
                plan[1]()
                plan = next(plans)
            if not self.traces.step():
                return

    def _plans(self) -> Iterator[tuple[float, Callable[[], None]]]:
        """What else to try when so many actions are spent, the likeliest help first."""
        traces = self.traces
        if self.parts.sharing:
            yield 100, lambda: traces.suggest(one_edit_away)
            yield 200, lambda: traces.suggest(with_loop)
            yield 400, self.learn_from_all_ways
            yield 500, self.try_explanations
            yield 600, lambda: traces.suggest_around(3, with_detour)
        if self.parts.beam:
            yield 1_000, self.try_beam
        if self.model.repairer is not None:
            yield 1_100, self.try_repairs
        if self.parts.sharing:
            yield 1_200, lambda: traces.suggest(with_detour)
            yield 1_400, self.try_explanations
            yield 1_500, self.learn_from_all_ways
            yield 2_000, lambda: traces.suggest_around(8, with_detour)
            yield 2_500, self.try_explanations
            yield 2_600, lambda: traces.suggest_around(8, one_edit_away)
        yield float("inf"), lambda: None

    def learn_from_all_ways(self) -> None:
        """Where the goal is reached in several orders, one of them may be what also works elsewhere."""
        for _ in range(FIRST_LOOK):
            self.traces.step(slack=0)
        self.traces.suggest_ways(one_edit_away)

    def try_beam(self) -> None:
        """Where the synthesizer's candidates lead."""
        self._propose()
        self._try(self.proposals)

    def _propose(self) -> None:
        self.proposals = [p.program for p in propose(self.model, self.table, self.task, self.robot)]

    def try_repairs(self) -> None:
        """Where the repairer's programs lead: several for each of the candidates that pass most examples."""
        assert self.model.repairer is not None
        attempts = attempt_all(self.proposals, self.task, self.robot)
        attempts.sort(key=lambda a: -a.pairs_passed)
        executions = self.table.executions(attempts[:REPAIRED], self.task)
        with autocast():
            repaired = self.model.repairer.repairs(executions, self.table.table, REPAIRS)
        new = dict.fromkeys(program for programs in repaired for program in programs)
        self.proposals += [program for program in new if program not in self.proposals]
        self._try(self.proposals)

    def try_explanations(self) -> None:
        """Where programs lead that explain the scenes in which the goal was reached."""
        reached = [i for i, scene in enumerate(self.traces.scenes) if scene.goals]
        if len(reached) > 1:
            self._try(self._explainer(reached, PARTIAL).programs())

    def _try(self, programs: list[Program]) -> None:
        for scene in self.traces.scenes:
            if not scene.goals:
                traces = run_together(programs, scene.example.scene, self.robot)
                self.traces.visit(scene, (trace.actions for trace in traces))

    def explain(self) -> list[Program]:
        """The programs that pass all pairs; none, if a goal was not reached, or nothing explains it all."""
        limits = Limits()
        for look in range(MORE_LOOKS + 1):
            if not self.traces.complete:
                return []
            for _ in range(FIRST_LOOK << look):
                if self.watch.stopped():
                    break
                self.traces.step(slack=1)
            self.tell("looking for a program that explains all ways")
            explainer = self._explainer(range(len(self.traces.scenes)), limits)
            if programs := explainer.programs():
                return list(dict.fromkeys([*programs, *(v for p in programs for v in explainer.variants(p))]))
            if self.over:
                break
            limits = replace(limits, loops=True)
            if look:
                limits = replace(limits, body=LARGER_BLOCKS * limits.action)
        return []

    def explain_some(self) -> list[Program]:
        """Programs for parts of the scenes where the goal was reached, and LGRL's candidates."""
        programs = [p for part in self._parts() for p in self._explainer(part, SOME).programs()]
        if not self.proposals and self.parts.beam and not (programs and self.watch.stopped()):
            self._propose()
        return list(dict.fromkeys([*programs, *self.proposals])) or [NOTHING_FOUND]

    def _parts(self) -> list[tuple[int, ...]]:
        """Of the scenes where the goal was reached all or all but one, and those that begin alike."""
        reached = [i for i, scene in enumerate(self.traces.scenes) if scene.goals]
        parts = [*combinations(reached, min(len(reached), len(self.traces.scenes) - 1))]
        for perception in PERCEPTION_KEYS:
            seen = [perception in self.traces.scenes[i].root.view.perceptions for i in reached]
            parts += [tuple(compress(reached, seen)), tuple(compress(reached, [not each for each in seen]))]
        return [part for part in dict.fromkeys(parts) if part]

    def _explainer(self, scenes: Sequence[int], limits: Limits) -> Explainer:
        chosen = [self.traces.scenes[i] for i in scenes]
        return Explainer([Graph.of(scene.root, scene.goals) for scene in chosen], limits, self.late)

    def choose(self, attempts: list[Attempt], top_k: int, seed: int) -> tuple[list[Attempt], float, Doubt]:
        """The attempts that differ in what they do, the answer first; the confidence in it, and what is open.

        All are run on further random scenes, on which nobody knows what is right. Of the programs that pass
        all examples the answer is one that ends as many others do, each of which counts the more the likelier
        a random program is to be it.
        """
        solved = [a for a in attempts if a.solved]
        others: dict[object, Attempt] = {}
        for a in attempts:
            if not a.solved:
                others.setdefault(tuple(t.actions for t in a.traces), a)
        if not solved:
            return list(others.values())[:top_k], 0.0, None
        rng = np.random.default_rng(seed)
        scenes = [world().random_scene(rng) for _ in range(PROBES)] if len(solved) > 1 else []
        programs = [a.program for a in solved]
        ends = dict(zip(programs, self._ends(programs, scenes), strict=True))
        weights = {p: DEARER ** -cost_of(p) for p in programs}
        mass: dict[Ends, float] = {}
        for p in programs:
            mass[ends[p]] = mass.get(ends[p], 0.0) + weights[p]
        solved.sort(key=lambda a: -mass[ends[a.program]])
        answer = ends[solved[0].program]
        alike = [_share_equal(ends[p], answer) for p in programs]
        doubts = (
            (scene, p)
            for p in programs
            for scene, end, expected in zip(scenes, ends[p], answer, strict=True)
            if end != expected
        )
        confidence = float(np.average(alike, weights=[weights[p] for p in programs]))
        distinct: dict[object, Attempt] = {}
        for a in solved:
            distinct.setdefault((tuple(t.actions for t in a.traces), ends[a.program]), a)
        return [*distinct.values(), *others.values()][:top_k], confidence, next(doubts, None)

    def _ends(self, programs: list[Program], scenes: list[Scene]) -> list[Ends]:
        """What the robot sees at the end of each program on each scene."""
        by_scene = [run_together(programs, scene, self.robot) for scene in scenes]
        ends: list[list[object]] = [[] for _ in programs]
        for traces in by_scene:
            for end, trace in zip(ends, traces, strict=True):
                seen = digest(trace.observations[-1]) if trace.halted else object()
                end.append(seen)  # who does not halt is like nobody
        return [tuple(end) for end in ends]


def _share_equal(one: Ends, other: Ends) -> float:
    same = [a == b for a, b in zip(one, other, strict=True)]
    return sum(same) / len(same) if same else 1.0
