"""Programs from traces: the shortest programs that lead to the goals along known ways, in all scenes at once.

What is known of each scene is a graph: places, the actions that lead from one to another, what is perceived
in them. Only places from which a goal can be reached count, and there are few. A program moves all scenes
together: its state is one place in each of them. A search (A*) over these states goes from the starts to the
goals by whole statements: actions; branches on a perception that some scenes show and others do not; loops.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, product
from typing import ClassVar

from evaps.dsl import Program
from evaps.dsl.nodes import Action, Body, Condition, If, IfElse, Not, Repeat, Statement, While
from evaps.dsl.sampler import COUNTS, MAX_TOKENS, PERCEPTIONS
from evaps.robots.memo import Node
from evaps.synthesis.graph import Graph

# Costs are about -log2 of what a construct has as a probability in a random program (`evaps.dsl.sampler`).
ACTION, BRANCH, LOOP = 4, 5, 5
PER_STATE = 4  # ways to the same state that are followed
MOST_TURNS = 24  # of a loop

State = tuple[Node, ...]
Bodies = dict[State, tuple[int, int, Body]]
"""For each state that a block may lead to its cheapest body: what it costs, its conditions, and itself."""


Scenes = tuple[int, ...]
"""The scenes that a block runs in, in the order of its state."""
Steps = Iterator[tuple[int, int, Statement, State]]
"""What may come next: its cost, its conditions, the statement, and where it leads."""
CONDITIONS: tuple[Condition, ...] = (*PERCEPTIONS, *map(Not, PERCEPTIONS))
DEEPEST = 3  # blocks in one another


@dataclass(frozen=True)
class Split:
    """A state, and the scenes in which a condition holds.

    Attributes:
        state: a place in each scene.
        scenes: which scenes.
        mask: for each of them whether the condition holds.
    """

    state: State
    scenes: Scenes
    mask: tuple[bool, ...]

    @property
    def part(self) -> tuple[State, Scenes]:
        """The part of the state in which the condition holds."""
        there = [(n, s) for n, s, is_in in zip(self.state, self.scenes, self.mask, strict=True) if is_in]
        return tuple(n for n, _ in there), tuple(s for _, s in there)

    @property
    def others(self) -> Split:
        """The same for the opposite condition."""
        return Split(self.state, self.scenes, tuple(not is_in for is_in in self.mask))

    def merged(self, after: State, otherwise: State | None = None) -> State:
        """The whole state when its part has become another, and, if that is given, the rest too."""
        one, other = iter(after), iter(otherwise or ())
        return tuple(
            next(one) if is_in else (next(other) if otherwise else node)
            for node, is_in in zip(self.state, self.mask, strict=True)
        )


@dataclass(frozen=True)
class Limits:
    """How far the search goes.

    Attributes:
        conditions: in a program at most.
        body: cost of a block at most.
        cost: of a program at most.
        work: statements that are tried, nested ones included.
        programs: that it looks for.
        extra: what a program may cost more than the cheapest one.
        loops: whether it is taken into account that a loop may stand for all actions that are left. Nothing
            cheaper is missed then; otherwise it is quicker, and long runs are not explained.
    """

    action: ClassVar[int] = ACTION
    conditions: int = 2
    body: int = 4 * ACTION
    cost: int = 16 * ACTION
    work: int = 400_000
    programs: int = 24
    extra: int = ACTION
    loops: bool = False


def cost_of(program: Program) -> int:
    """About -log2 of how likely a random program is this one."""
    return sum(map(_cost, program.body))


def _cost(statement: Statement) -> int:
    if isinstance(statement, Action):
        return ACTION
    blocks = [*statement.body, *getattr(statement, "orelse", ())]
    return (LOOP if isinstance(statement, Repeat) else BRANCH) + sum(map(_cost, blocks))


class Explainer:
    """Looks for programs in the graphs of several scenes.

    Args:
        graphs: one for each scene.
        limits: how far to go.
    """

    def __init__(self, graphs: Sequence[Graph], limits: Limits) -> None:
        self.graphs, self.limits = graphs, limits
        self._work = limits.work
        self._blocks: dict[tuple[State, tuple[int, ...], int, int, int], Bodies] = {}
        self._true: dict[Node, frozenset[str]] = {}

    def programs(self) -> list[Program]:
        """Programs that lead to the goals of all scenes, the shortest first."""
        everywhere = tuple(range(len(self.graphs)))
        start = tuple(graph.root for graph in self.graphs)
        if any(graph.root not in graph.distance for graph in self.graphs):
            return []
        suffixes = self._suffixes()
        order = count()
        left = self.limits.conditions
        queue: list[tuple[int, int, int, State, int, Body]] = [
            (self._ahead(start, suffixes), next(order), 0, start, left, ())
        ]
        visits: dict[tuple[State, int], int] = defaultdict(int)
        found: dict[Program, int] = {}
        most = self.limits.cost
        while queue and len(found) < self.limits.programs and self._work > 0:
            estimate, _, cost, state, left, body = heapq.heappop(queue)
            if estimate > most:
                break
            if self._is_goal(state) and body:
                program = Program(body)
                if len(program.tokens) <= MAX_TOKENS:
                    found.setdefault(program, cost)
                    most = min(most, min(found.values()) + self.limits.extra)
            if visits[state, left] >= PER_STATE:
                continue
            visits[state, left] += 1
            for more, used, statement, after in self._statements(state, everywhere, most - cost, left, 0):
                self._work -= 1
                ahead = cost + more + self._ahead(after, suffixes)
                if ahead <= most and (left > used or after in suffixes):
                    entry = (ahead, next(order), cost + more, after, left - used, (*body, statement))
                    heapq.heappush(queue, entry)
        return sorted(found, key=lambda p: found[p])

    def _is_goal(self, state: State) -> bool:
        return all(node in graph.goals for node, graph in zip(state, self.graphs, strict=True))

    def _ahead(self, state: State, suffixes: dict[State, int]) -> int:
        """What is needed: the actions that are left, or, if they are not common, a branch at least."""
        left = suffixes.get(state, BRANCH + ACTION)
        return min(left, LOOP + ACTION) if self.limits.loops else left

    def _suffixes(self) -> dict[State, int]:
        """States from which actions alone lead to the goals in all scenes, and what they cost."""
        into: list[dict[str, dict[Node, list[Node]]]] = []
        for graph in self.graphs:
            reverse: dict[str, dict[Node, list[Node]]] = defaultdict(lambda: defaultdict(list))
            for node, ways in graph.ways.items():
                for action, child in ways.items():
                    reverse[action][child].append(node)
            into.append(reverse)
        found: dict[State, int] = {}
        level = list(product(*(graph.goals for graph in self.graphs)))
        length = 0
        while level and len(found) < 20_000:
            new: list[State] = []
            for state in level:
                if state not in found:
                    found[state] = length
                    for action in into[0]:
                        before = [reverse[action].get(n, []) for reverse, n in zip(into, state, strict=True)]
                        if all(before):
                            new += product(*before)
            level, length = new, length + ACTION
        return found

    def _statements(self, state: State, scenes: Scenes, budget: int, left: int, depth: int) -> Steps:
        """What may come next."""
        yield from self._actions(state, scenes, budget)
        if left and budget >= BRANCH + ACTION:
            yield from self._conditionals(state, scenes, budget, left, depth)
        if depth < DEEPEST - 1 and budget >= LOOP + ACTION:
            yield from self._repeats(state, scenes, budget, left, depth)

    def _actions(self, state: State, scenes: Scenes, budget: int) -> Steps:
        if budget < ACTION:
            return
        ways = [self.graphs[scene].ways[node] for scene, node in zip(scenes, state, strict=True)]
        for action in ways[0]:
            if all(action in way for way in ways):
                yield ACTION, 0, Action(action), tuple(way[action] for way in ways)

    def _conditionals(self, state: State, scenes: Scenes, budget: int, left: int, depth: int) -> Steps:
        """Of conditions that tell the scenes apart in the same way the first one stands for all."""
        seen: set[tuple[bool, ...]] = set()
        for condition in CONDITIONS:
            holds = tuple(self._holds(condition, node) for node in state)
            if not any(holds):
                continue
            split = Split(state, scenes, holds)
            yield from self._while(condition, split, budget - BRANCH, left, depth)
            if all(holds) or holds in seen:
                continue
            seen.add(holds)
            yield from self._if(condition, split, budget - BRANCH, left, depth)
            if split.others.mask not in seen:
                yield from self._if_else(condition, split, budget - BRANCH, left, depth)

    def _if(self, condition: Condition, split: Split, budget: int, left: int, depth: int) -> Steps:
        for after, (cost, used, body) in self._block(*split.part, budget, left - 1, depth + 1).items():
            yield BRANCH + cost, used + 1, If(condition, body), split.merged(after)

    def _if_else(self, condition: Condition, split: Split, budget: int, left: int, depth: int) -> Steps:
        others = split.others
        alternatives = self._block(*others.part, budget - ACTION, left - 1, depth + 1)
        for after, (cost, used, body) in self._block(
            *split.part, budget - ACTION, left - 1, depth + 1
        ).items():
            for final, (more, also, orelse) in alternatives.items():
                if cost + more <= budget and used + also < left and body != orelse:
                    statement = IfElse(condition, body, orelse)
                    end = split.merged(after, final)
                    yield BRANCH + cost + more, used + also + 1, statement, end

    def _while(self, condition: Condition, split: Split, budget: int, left: int, depth: int) -> Steps:
        state, scenes = split.part
        for once, (cost, used, body) in self._block(state, scenes, budget, left - 1, depth + 1).items():
            ends = []
            for node, scene in zip(once, scenes, strict=True):
                end = self._leave(condition, body, node, scene)
                if end is None:
                    break
                ends.append(end)
            else:
                yield BRANCH + cost, used + 1, While(condition, body), split.merged(tuple(ends))

    def _leave(self, condition: Condition, body: Body, node: Node, scene: int) -> Node | None:
        """Where a loop ends that has come to a place after its first turn."""
        for _ in range(MOST_TURNS):
            if not self._holds(condition, node):
                return node
            after = self._run(body, node, scene)
            if after is None or after is node:
                return None
            node = after
        return None

    def _repeats(self, state: State, scenes: Scenes, budget: int, left: int, depth: int) -> Steps:
        blocks = self._block(state, scenes, budget - LOOP, left, depth + 1)
        for once, (cost, used, body) in blocks.items():
            current: list[Node | None] = list(once)
            for times in range(2, max(COUNTS) + 1):
                current = [n and self._run(body, n, s) for n, s in zip(current, scenes, strict=True)]
                ends = tuple(node for node in current if node is not None)
                if len(ends) < len(state):
                    break
                if times in COUNTS and cost * times > LOOP:
                    yield LOOP + cost, used, Repeat(times, body), ends

    def _block(self, state: State, scenes: Scenes, budget: int, left: int, depth: int) -> Bodies:
        """All that the blocks of so much cost may lead to."""
        budget = min(budget, self.limits.body) // ACTION * ACTION
        key = (state, scenes, budget, left, depth)
        if key not in self._blocks:
            possible = budget >= ACTION and depth <= DEEPEST
            self._blocks[key] = self._reach(state, scenes, budget, left, depth) if possible else {}
        return self._blocks[key]

    def _reach(self, state: State, scenes: Scenes, budget: int, left: int, depth: int) -> Bodies:
        found: Bodies = {}
        order = count()
        queue: list[tuple[int, int, State, int, Body]] = [(0, next(order), state, left, ())]
        done: set[State] = set()
        while queue and self._work > 0:
            cost, _, current, rest, body = heapq.heappop(queue)
            if current in done:
                continue
            done.add(current)
            if body:
                found.setdefault(current, (cost, left - rest, body))
            for more, used, statement, after in self._statements(current, scenes, budget - cost, rest, depth):
                self._work -= 1
                if cost + more <= budget and after not in done:
                    entry = (cost + more, next(order), after, rest - used, (*body, statement))
                    heapq.heappush(queue, entry)
        return found

    def variants(self, program: Program) -> list[Program]:
        """The programs that ask something else in one condition, and lead to the goals all the same."""
        found = [Program(body) for body in _with_other_conditions(program.body)]
        return [p for p in found if p != program and self.explains(p)]

    def explains(self, program: Program) -> bool:
        """Whether a program leads to the goals along ways that are known."""
        ends = [self._run(program.body, graph.root, i) for i, graph in enumerate(self.graphs)]
        return all(end in graph.goals for end, graph in zip(ends, self.graphs, strict=True))

    def _run(self, body: Body, node: Node, scene: int) -> Node | None:
        """Where a body leads from a place; None if that is not known, or no way to a goal."""
        ways = self.graphs[scene].ways
        for statement in body:
            if isinstance(statement, Action):
                after = ways[node].get(statement.name)
            elif isinstance(statement, Repeat):
                after = node
                for _ in range(statement.times):
                    after = after and self._run(statement.body, after, scene)
            elif isinstance(statement, While):
                after = self._leave(statement.condition, statement.body, node, scene)
            elif self._holds(statement.condition, node):
                after = self._run(statement.body, node, scene)
            elif isinstance(statement, IfElse):
                after = self._run(statement.orelse, node, scene)
            else:
                after = node
            if after is None:
                return None
            node = after
        return node

    def _holds(self, condition: Condition, node: Node) -> bool:
        if isinstance(condition, Not):
            return not self._holds(condition.condition, node)
        return condition.key in self._perceived(node)

    def _perceived(self, node: Node) -> frozenset[str]:
        found = self._true.get(node)
        if found is None:
            found = self._true[node] = node.view.perceptions
        return found


def _with_other_conditions(body: Body) -> Iterator[Body]:
    """Bodies in which one condition, at any depth, is another one."""
    for i, statement in enumerate(body):
        before, after = body[:i], body[i + 1 :]
        if isinstance(statement, If | IfElse | While):
            for condition in CONDITIONS:
                yield (*before, replace(statement, condition=condition), *after)
        for block in ("body", "orelse"):
            if inner := getattr(statement, block, None):
                for other in _with_other_conditions(inner):
                    yield (*before, replace(statement, **{block: other}), *after)  # type: ignore[arg-type]
