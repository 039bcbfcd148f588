"""How one sequence of tokens becomes another: a shortest list of edits (Levenshtein, 1966)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Edit:
    """One step of an alignment: keep, replace, delete or insert.

    Attributes:
        old: the token before, None for an insertion.
        new: the token after, None for a deletion.
    """

    old: str | None
    new: str | None

    @property
    def kind(self) -> str:
        """``keep``, ``replace``, ``delete`` or ``insert``."""
        if self.old is None:
            return "insert"
        if self.new is None:
            return "delete"
        return "keep" if self.old == self.new else "replace"


def align(before: Sequence[str], after: Sequence[str]) -> list[Edit]:
    """The fewest edits that turn ``before`` into ``after``, in order; insertions come as late as can be."""
    cost = _costs(before, after)
    edits: list[Edit] = []
    i, j = 0, 0
    while i < len(before) or j < len(after):
        here = cost[i][j]
        same = i < len(before) and j < len(after) and before[i] == after[j]
        if (same and cost[i + 1][j + 1] == here) or (
            i < len(before) and j < len(after) and not same and cost[i + 1][j + 1] + 1 == here
        ):
            edits.append(Edit(before[i], after[j]))
            i, j = i + 1, j + 1
        elif i < len(before) and cost[i + 1][j] + 1 == here:
            edits.append(Edit(before[i], None))
            i += 1
        else:
            edits.append(Edit(None, after[j]))
            j += 1
    return edits


def _costs(before: Sequence[str], after: Sequence[str]) -> list[list[int]]:
    """``cost[i][j]``: how many edits turn ``before[i:]`` into ``after[j:]``."""
    n, m = len(before), len(after)
    cost = [[m - j for j in range(m + 1)] for _ in range(n + 1)]
    for i in range(n - 1, -1, -1):
        row, below = cost[i], cost[i + 1]
        row[m] = n - i
        for j in range(m - 1, -1, -1):
            same = before[i] == after[j]
            row[j] = below[j + 1] if same else 1 + min(below[j + 1], below[j], row[j + 1])
    return cost
