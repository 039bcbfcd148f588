"""From a task to a program: propose, run, repair."""

from __future__ import annotations

from typing import Protocol

from evaps.models import Model
from evaps.robots.memo import MemoRobot
from evaps.synthesis.best_first import synthesize_best_first
from evaps.synthesis.blind import synthesize_blindly, synthesize_from_prior
from evaps.synthesis.budget import USUAL_BUDGET, Budget
from evaps.synthesis.enumeration import synthesize_by_enumeration
from evaps.synthesis.repair import ROUNDS, synthesize_with
from evaps.synthesis.solution import Attempt, Candidate, Solution
from evaps.synthesis.team import SPARES, memo_of, team_of_robots
from evaps.synthesis.verified import ALL_PARTS, Parts, synthesize_verified
from evaps.synthesis.watch import NOBODY, News, Watch
from evaps.tasks.task import Task

__all__ = [
    "SPARES",
    "Attempt",
    "Budget",
    "Candidate",
    "News",
    "Solution",
    "Watch",
    "memo_of",
    "solve",
    "synthesize",
    "synthesize_with",
    "team_of_robots",
]


class Search(Protocol):
    """A way to answer that is no network of its own."""

    def __call__(
        self, model: Model, task: Task, robot: MemoRobot, top_k: int, budget: Budget, seed: int, watch: Watch
    ) -> Solution:
        """See `synthesize`."""


def _verified(parts: Parts = ALL_PARTS) -> Search:
    return lambda model, task, robot, top_k, budget, seed, watch: synthesize_verified(
        model, task, robot, top_k, budget, parts, seed, watch
    )


SEARCHES: dict[str, Search] = {
    "verified": _verified(),
    "verified-no-guide": _verified(Parts(guide=False)),
    "verified-no-sharing": _verified(Parts(sharing=False)),
    "verified-no-beam": _verified(Parts(beam=False)),
    "verified-with-repairs": _verified(),
    "sed-search": lambda model, task, robot, top_k, budget, seed, watch: synthesize_best_first(
        model, task, robot, top_k, watch=watch
    ),
    "enumeration": lambda model, task, robot, top_k, budget, seed, watch: synthesize_by_enumeration(
        task, robot, budget, watch
    ),
    "blind": lambda model, task, robot, top_k, budget, seed, watch: synthesize_blindly(
        task, robot, budget, seed, watch
    ),
    "prior": lambda model, task, robot, top_k, budget, seed, watch: synthesize_from_prior(
        task, robot, top_k, seed
    ),
}
"""What each search does; `evaps.models.SEARCHES` says which checkpoints it needs."""


def synthesize(
    task: Task,
    model: Model,
    top_k: int = 20,
    rounds: int = ROUNDS,
    budget: Budget = USUAL_BUDGET,
    seed: int = 0,
) -> Solution:
    """Write a program for a task, on Doom robots of its own.

    Args:
        task: five scenes and what the robot should see at the end.
        model: from `evaps.load_model`; its method decides how it is done.
        top_k: how many candidates come back at most; in the paper's loop they are the synthesizer's first
            ones, each run and repaired.
        rounds: how often each is repaired at most.
        budget: what a verified search may cost.
        seed: of what is random in a search.
    """
    robot = memo_of(team_of_robots())
    try:
        return solve(model, task, robot, top_k, rounds, budget, seed)
    finally:
        robot.close()


def solve(
    model: Model,
    task: Task,
    robot: MemoRobot,
    top_k: int = 20,
    rounds: int = ROUNDS,
    budget: Budget = USUAL_BUDGET,
    seed: int = 0,
    watch: Watch = NOBODY,
) -> Solution:
    """The same on a robot that is there.

    ``watch`` follows it, and may end it early; ``prior``, which draws only ``top_k`` programs, does not ask.
    """
    if model.search is None:
        return synthesize_with(model, task, robot, top_k, rounds, watch=watch)
    return SEARCHES[model.search](model, task, robot, top_k, budget, seed, watch)
