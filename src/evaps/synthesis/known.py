"""Running on what is known of some scenes: where a body leads there, without simulating anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from evaps.dsl.nodes import Action, Body, Condition, IfElse, Not, Repeat, While
from evaps.dsl.sampler import PERCEPTIONS
from evaps.robots.memo import Node
from evaps.synthesis.graph import Graph

MOST_TURNS = 24  # of a loop
CONDITIONS: tuple[Condition, ...] = (*PERCEPTIONS, *map(Not, PERCEPTIONS))


@dataclass(eq=False)
class Block:
    """A body, and where it is known to lead; of equal bodies there is one block, so that they share it.

    Attributes:
        body: its statements.
        ends: for each scene, where it leads from the places that it was run from; see `Known.run`.
    """

    body: Body
    ends: list[dict[Node, Node | None]] = field(repr=False)


class Known:
    """Runs bodies on graphs.

    Args:
        graphs: one for each scene.
    """

    def __init__(self, graphs: Sequence[Graph]) -> None:
        self._graphs = graphs
        self._blocks: dict[Body, Block] = {}
        self._true: dict[Node, frozenset[str]] = {}
        self._truths: dict[Node, tuple[bool, ...]] = {}

    def block(self, body: Body) -> Block:
        """The block of a body."""
        found = self._blocks.get(body)
        if found is None:
            found = self._blocks[body] = Block(body, [{} for _ in self._graphs])
        return found

    def run(self, block: Block, node: Node, scene: int) -> Node | None:
        """Where a block leads from a place; None if that is not known, or no way to a goal.

        The same blocks are run from the same places many times, in loops and from one state after another.
        """
        ends = block.ends[scene]
        try:
            return ends[node]
        except KeyError:
            end = ends[node] = self.run_body(block.body, node, scene)
            return end

    def leave(self, condition: Condition, block: Block, node: Node, scene: int) -> Node | None:
        """Where a loop ends that has come to a place after its first turn."""
        for _ in range(MOST_TURNS):
            if not self.holds(condition, node):
                return node
            after = self.run(block, node, scene)
            if after is None or after is node:
                return None
            node = after
        return None

    def run_body(self, body: Body, node: Node, scene: int) -> Node | None:
        """The same as `run`, of a body that is run once."""
        ways = self._graphs[scene].ways
        for statement in body:
            if isinstance(statement, Action):
                after = ways[node].get(statement.name)
            elif isinstance(statement, Repeat):
                after = self._repeat(statement, node, scene)
            elif isinstance(statement, While):
                after = self.leave(statement.condition, self.block(statement.body), node, scene)
            elif self.holds(statement.condition, node):
                after = self.run_body(statement.body, node, scene)
            elif isinstance(statement, IfElse):
                after = self.run_body(statement.orelse, node, scene)
            else:
                after = node
            if after is None:
                return None
            node = after
        return node

    def _repeat(self, loop: Repeat, node: Node, scene: int) -> Node | None:
        for _ in range(loop.times):
            after = self.run_body(loop.body, node, scene)
            if after is None:
                return None
            node = after
        return node

    def holds(self, condition: Condition, node: Node) -> bool:
        """Whether a condition holds in a place."""
        if isinstance(condition, Not):
            return not self.holds(condition.condition, node)
        found = self._true.get(node)
        if found is None:
            found = self._true[node] = node.view.perceptions
        return condition.key in found

    def truths(self, node: Node) -> tuple[bool, ...]:
        """Which of CONDITIONS hold in a place."""
        found = self._truths.get(node)
        if found is None:
            found = self._truths[node] = tuple(self.holds(condition, node) for condition in CONDITIONS)
        return found
