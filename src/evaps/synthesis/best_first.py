"""SED's own search: repairs best-first, over all candidates at once.

Gupta et al., "Synthesize, Execute and Debug", NeurIPS 2020, section 4.3: a queue of programs by how many
examples they pass; the best one is repaired, what comes of it is run and queued, until one passes all or the
repairer was called so many times. The paper's protocol, which `evaps.synthesis.repair` follows, repairs each
candidate on its own instead.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from itertools import count

from evaps.dsl import Program
from evaps.models import Model
from evaps.models.compute import autocast
from evaps.robots.memo import MemoRobot
from evaps.synthesis.budget import Meter
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.repair import BEAM, propose
from evaps.synthesis.solution import Attempt, Candidate, Solution, attempt_all
from evaps.synthesis.watch import NOBODY, Watch
from evaps.tasks.task import Task

CALLS = 25  # of the repairer


def synthesize_best_first(
    model: Model,
    task: Task,
    robot: MemoRobot,
    top_k: int = 20,
    calls: int = CALLS,
    beam: int = BEAM,
    watch: Watch = NOBODY,
) -> Solution:
    """Propose, run, and repair whatever passes most.

    Args:
        model: with a repairer.
        task: the specification.
        robot: where programs run.
        top_k: how many candidates come back, those that pass most first.
        calls: how often the repairer is asked.
        beam: programs of the synthesizer, and of each repair.
        watch: may end it.
    """
    repairer = model.repairer
    assert repairer is not None
    meter = Meter(robot)
    table = FeatureTable(model.encoder, task.noise)
    order = count()
    seen: dict[Program, Candidate] = {}
    queue: list[tuple[int, int, Candidate]] = []

    def push(programs: Iterable[Program], before: tuple[Attempt, ...]) -> None:
        new = [p for p in dict.fromkeys(programs) if p not in seen]
        for attempt in attempt_all(new, task, robot):
            origin = f"{model.synthesizer.name} + {repairer.name}" if before else model.synthesizer.name
            candidate = Candidate((*before, attempt), len(seen), origin)
            seen[attempt.program] = candidate
            heapq.heappush(queue, (-attempt.pairs_passed, next(order), candidate))

    push([p.program for p in propose(model, table, task, robot, beam)], ())
    for _ in range(calls):
        if not queue or watch.stopped() or any(candidate.final.solved for candidate in seen.values()):
            break
        best = heapq.heappop(queue)[2]
        with autocast():
            executions = table.executions([best.final], task)
            push(repairer.repairs(executions, table.table, beam)[0], best.attempts)
    ranked = sorted(seen.values(), key=lambda c: (-c.final.pairs_passed, c.rank))[:top_k]
    answers = tuple(Candidate(c.attempts, rank, c.origin) for rank, c in enumerate(ranked))
    return Solution(task.name, answers, meter.actions, meter.seconds, answers)
