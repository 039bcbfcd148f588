"""What is known of a scene, as far as it leads to a goal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

from evaps.robots.memo import Node


@dataclass
class Graph:
    """What is known of a scene, cut down to what leads to a goal.

    Attributes:
        root: where a program starts.
        goals: where it has to end.
        ways: from each place the actions that lead on, and where to.
        distance: from each place the fewest actions to a goal.
    """

    root: Node
    goals: frozenset[Node]
    ways: dict[Node, dict[str, Node]] = field(default_factory=dict)
    distance: dict[Node, int] = field(default_factory=dict)

    @classmethod
    def of(cls, root: Node, goals: Sequence[Node], slack: int = 4) -> Graph:
        """The places on ways to a goal that are at most so much longer than the shortest one."""
        found = cls(root, frozenset(goals))
        back: dict[Node, set[Node]] = defaultdict(set)
        depth = {root: 0}
        queue = [root]
        for node in queue:
            for child in node.children.values():
                back[child].add(node)
                if child not in depth:
                    depth[child] = depth[node] + 1
                    queue.append(child)
        distance = {goal: 0 for goal in goals if goal in depth}
        queue = list(distance)
        for node in queue:
            for parent in back[node]:
                if parent not in distance:
                    distance[parent] = distance[node] + 1
                    queue.append(parent)
        most = distance.get(root, -1) + slack
        found.distance = {n: d for n, d in distance.items() if depth[n] + d <= most}
        for node in found.distance:
            found.ways[node] = {a: c for a, c in node.children.items() if c in found.distance}
        return found
