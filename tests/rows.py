"""Made-up evaluation rows, for tests of what is made of rows."""

from collections.abc import Sequence
from typing import Any

import pyarrow as pa

from evaps.evaluate import SCHEMA
from evaps.metrics import Results

WRONG = "DEF run m( MOVE_LEFT m)"
RIGHT = "DEF run m( MOVE_RIGHT ATTACK m)"


def rows(method: str, ranks_that_match: Sequence[int | None], seed: int = 0) -> list[dict[str, Any]]:
    """Twenty candidates for each task, of which the one of the given rank matches in every way."""
    blank = dict(scale="test", commit="", weights="", evaluated_by="", machine="", dataset_seed=0, noise=0.0)
    blank |= dict(trained_on=100, budget=3_500)
    blank |= dict(steps=2, program=WRONG, pairs_passed=0, rounds=0, attempts=[])
    cost = dict(simulated_actions=10, seconds=1.0, semantic_frame=False, generalization_frame=False)
    return [
        {
            **blank,
            **cost,
            "method": method,
            "seed": seed,
            "task": task,
            "rank": rank,
            **dict.fromkeys(("exact", "semantic_state", "generalization_state"), rank == right),
        }
        for task, right in enumerate(ranks_that_match)
        for rank in range(20)
    ]


def repaired(method: str, chains: Sequence[Sequence[bool]]) -> list[dict[str, Any]]:
    """One candidate for each task; of its proposal and each repair, whether it generalizes."""
    made = rows(method, [0 if chain[-1] else None for chain in chains])
    first = [row for row in made if row["rank"] == 0]
    for row, chain in zip(first, chains, strict=True):
        row["rounds"] = len(chain) - 1
        row["attempts"] = [_attempt(right) for right in chain]
    return first


def _attempt(right: bool) -> dict[str, Any]:
    program = RIGHT if right else WRONG
    return dict(program=program, pairs_passed=5 * right, semantic_state=right, generalization_state=right)


def results_of(*groups: list[dict[str, Any]]) -> Results:
    """As they are read from files."""
    return Results([table_of(*groups)])


def table_of(*groups: list[dict[str, Any]]) -> pa.Table:
    """As they are written to files."""
    return pa.Table.from_pylist([row for group in groups for row in group], SCHEMA)
