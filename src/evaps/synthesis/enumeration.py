"""The other symbolic baseline: programs by their cost, one for each thing that they do.

It learns nothing. A program is extended by a statement at its end; of programs that end in the same places of
all scenes, by whatever way, only the cheapest is extended.
"""

from __future__ import annotations

import heapq
from itertools import count

from evaps.dsl import Program
from evaps.dsl.nodes import Action, Body, If, IfElse, Repeat, Statement, While
from evaps.dsl.sampler import ACTIONS, COUNTS, MAX_TOKENS, PERCEPTIONS
from evaps.robots.memo import MemoRobot
from evaps.robots.noise import goal_match
from evaps.robots.together import run_together
from evaps.synthesis.budget import USUAL_BUDGET, Budget, Meter
from evaps.synthesis.explain import cost_of
from evaps.synthesis.known import CONDITIONS
from evaps.synthesis.solution import Candidate, Solution, attempt_all
from evaps.synthesis.watch import NOBODY, Watch
from evaps.tasks.task import Task

SINGLE = tuple((Action(name),) for name in ACTIONS)
STATEMENTS: tuple[Statement, ...] = (
    *(Action(name) for name in ACTIONS),
    *(If(condition, body) for condition in CONDITIONS for body in SINGLE),
    *(IfElse(condition, a, b) for condition in PERCEPTIONS for a in SINGLE for b in SINGLE if a != b),
    *(While(condition, body) for condition in CONDITIONS for body in SINGLE),
    *(Repeat(times, body) for times in COUNTS for body in SINGLE),
)
"""What a program is extended by: every statement whose blocks are single actions."""


def synthesize_by_enumeration(
    task: Task, robot: MemoRobot, budget: Budget = USUAL_BUDGET, watch: Watch = NOBODY
) -> Solution:
    """Enumerate until a program passes all pairs or the budget is spent; else the one that passes most.

    Args:
        task: the specification.
        robot: where programs run.
        budget: what it may cost.
        watch: may end it.
    """
    meter = Meter(robot)
    goals = [example.goal for example in task.examples]
    order = count()
    queue: list[tuple[int, int, Body]] = [(0, next(order), ())]
    seen: set[tuple[object, ...]] = set()
    best: tuple[int, Program] | None = None
    over = False
    while queue and not over and (best is None or best[0] < len(goals)):
        _, _, body = heapq.heappop(queue)
        programs = [Program((*body, statement)) for statement in STATEMENTS]
        programs = [p for p in programs if len(p.tokens) <= MAX_TOKENS]
        by_scene = [run_together(programs, example.scene, robot) for example in task.examples]
        for program, *traces in zip(programs, *by_scene, strict=True):
            if not all(trace.halted for trace in traces):
                continue
            ends = tuple(trace.observations[-1] for trace in traces)  # the same objects in the same places
            if ends not in seen:
                seen.add(ends)
                heapq.heappush(queue, (cost_of(program), next(order), program.body))
                passed = sum(map(goal_match, ends, goals))
                if best is None or passed > best[0]:
                    best = passed, program
        over = meter.exceeds(budget) or watch.stopped()
    found = attempt_all([best[1]], task, robot) if best else []
    candidates = tuple(Candidate((attempt,), 0, "enumeration") for attempt in found)
    return Solution(task.name, candidates, meter.actions, meter.seconds, candidates)
