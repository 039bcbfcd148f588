"""Programs from traces: the shortest programs that lead to the goals along known ways, in all scenes at once.

What is known of each scene is a graph: places, the actions that lead from one to another, what is perceived
in them. Only places from which a goal can be reached count, and there are few. A program moves all scenes
together: its state is one place in each of them. A search (A*) over these states goes from the starts to the
goals by whole statements: actions; branches on a perception that some scenes show and others do not; loops.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count, islice, product
from typing import ClassVar

from evaps.dsl import Program
from evaps.dsl.nodes import Action, Body, Condition, If, IfElse, Repeat, Statement, While
from evaps.dsl.sampler import COUNTS, MAX_TOKENS
from evaps.robots.memo import Node
from evaps.synthesis.graph import Graph
from evaps.synthesis.known import CONDITIONS, Block, Known

# Costs are about -log2 of what a construct has as a probability in a random program (`evaps.dsl.sampler`).
ACTION, BRANCH, LOOP = 4, 5, 5
PER_STATE = 4  # ways to the same state that are followed
MOST_SUFFIXES = 20_000  # states of which it is known what is left; where more goals look alike, not all are

State = tuple[Node, ...]
Bodies = dict[State, tuple[int, int, Block]]
"""For each state that a block may lead to the cheapest one: what it costs, its conditions, and itself."""
Scenes = tuple[int, ...]
"""The scenes that a block runs in, in the order of its state."""
Steps = Iterator[tuple[int, int, Statement, State]]
"""What may come next: its cost, its conditions, the statement, and where it leads."""
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

    @cached_property
    def places(self) -> list[int]:
        """Where in the state the scenes are in which the condition holds."""
        return [place for place, is_in in enumerate(self.mask) if is_in]

    @property
    def part(self) -> tuple[State, Scenes]:
        """The part of the state in which the condition holds."""
        return tuple(self.state[i] for i in self.places), tuple(self.scenes[i] for i in self.places)

    @cached_property
    def others(self) -> Split:
        """The same for the opposite condition."""
        return Split(self.state, self.scenes, tuple(not is_in for is_in in self.mask))

    def merged(self, after: State, otherwise: State | None = None) -> State:
        """The whole state when its part has become another, and, if that is given, the rest too."""
        whole = list(self.state)
        for place, node in zip(self.places, after, strict=True):
            whole[place] = node
        for place, node in zip(self.others.places, otherwise, strict=True) if otherwise else ():
            whole[place] = node
        return tuple(whole)


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
        stopped: asked now and then; once it is true, the search comes back with what it has.
    """

    def __init__(
        self, graphs: Sequence[Graph], limits: Limits, stopped: Callable[[], bool] = lambda: False
    ) -> None:
        self.graphs, self.limits, self.stopped = graphs, limits, stopped
        self.known = Known(graphs)
        self._work = limits.work
        self._blocks: dict[tuple[State, tuple[int, ...], int, int, int], Bodies] = {}

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
        while queue and len(found) < self.limits.programs and self._goes_on():
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

    def _goes_on(self) -> bool:
        if self.stopped():
            self._work = 0
        return self._work > 0

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
        level = list(islice(product(*(graph.goals for graph in self.graphs)), MOST_SUFFIXES))
        length = 0
        while level and len(found) < MOST_SUFFIXES:
            new: list[State] = []
            for state in level:
                if state not in found:
                    found[state] = length
                    for action in into[0]:
                        before = [reverse[action].get(n, []) for reverse, n in zip(into, state, strict=True)]
                        if all(before):
                            new += islice(product(*before), MOST_SUFFIXES - len(new))
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
        truths = zip(*map(self.known.truths, state), strict=True)
        for condition, holds in zip(CONDITIONS, truths, strict=True):
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
        for after, (cost, used, block) in self._block(*split.part, budget, left - 1, depth + 1).items():
            yield BRANCH + cost, used + 1, If(condition, block.body), split.merged(after)

    def _if_else(self, condition: Condition, split: Split, budget: int, left: int, depth: int) -> Steps:
        others = split.others
        alternatives = self._block(*others.part, budget - ACTION, left - 1, depth + 1)
        blocks = self._block(*split.part, budget - ACTION, left - 1, depth + 1)
        for after, (cost, used, block) in blocks.items():
            for final, (more, also, other) in alternatives.items():
                if cost + more <= budget and used + also < left and block is not other:
                    statement = IfElse(condition, block.body, other.body)
                    end = split.merged(after, final)
                    yield BRANCH + cost + more, used + also + 1, statement, end

    def _while(self, condition: Condition, split: Split, budget: int, left: int, depth: int) -> Steps:
        state, scenes = split.part
        for once, (cost, used, block) in self._block(state, scenes, budget, left - 1, depth + 1).items():
            ends = []
            for node, scene in zip(once, scenes, strict=True):
                end = self.known.leave(condition, block, node, scene)
                if end is None:
                    break
                ends.append(end)
            else:
                yield BRANCH + cost, used + 1, While(condition, block.body), split.merged(tuple(ends))

    def _repeats(self, state: State, scenes: Scenes, budget: int, left: int, depth: int) -> Steps:
        blocks = self._block(state, scenes, budget - LOOP, left, depth + 1)
        for once, (cost, used, block) in blocks.items():
            current = once
            for times in range(2, max(COUNTS) + 1):
                ends = []
                for node, scene in zip(current, scenes, strict=True):
                    end = self.known.run(block, node, scene)
                    if end is None:
                        break
                    ends.append(end)
                if len(ends) < len(state):
                    break
                current = tuple(ends)
                if times in COUNTS and cost * times > LOOP:
                    yield LOOP + cost, used, Repeat(times, block.body), current

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
        while queue and self._goes_on():
            cost, _, current, rest, body = heapq.heappop(queue)
            if current in done:
                continue
            done.add(current)
            if body:
                found.setdefault(current, (cost, left - rest, self.known.block(body)))
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
        ends = [self.known.run_body(program.body, graph.root, i) for i, graph in enumerate(self.graphs)]
        return all(end in graph.goals for end, graph in zip(ends, self.graphs, strict=True))


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
