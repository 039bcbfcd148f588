"""Traces from goals: action sequences that lead from a scene to what the robot should see at the end.

A best-first search in the memoised tree of each scene, guided by the inverse model's estimate of how many
actions are left. The scenes are searched side by side, so that their observations are embedded together, and
what has led to the goal in one of them is tried in the others: a program does often the same.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count

from evaps.dsl.sampler import ACTIONS
from evaps.models.inverse import AXES, InverseModel, effect
from evaps.robots.memo import MemoRobot, Node
from evaps.robots.noise import goal_match
from evaps.synthesis.features import FeatureTable
from evaps.synthesis.graph import Graph
from evaps.tasks.task import Example, Task

WEIGHT = 1.5  # of the estimate against what was done already: in a hurry to arrive
LOOK_AT = 8  # of the most promising actions
WAY = 0.2  # what an action that leads to a place costs, against one that has not been tried
NEAR = 0.2  # of two places as near to the goal, the one on a shorter path counts as nearer
RESET = 4  # actions that take as long as setting up a scene
AT_ONCE = 2  # actions tried in a scene before the next look at the estimates

LENGTH = 0.3  # what an action of a path counts against the likelihood of its counts
LEAST = -5.0  # the logarithm of the least probability that is told apart: a way may have been blocked
SHORTEST_WAY_BACK = 2  # actions that lead back to where they began
LONGEST = 24  # actions in a path
WAYS = 40  # to the goals of a scene, at most, that others learn from
MOST_TIMES = 8  # that a part of a path is repeated
UNDONE = [
    pair
    for axis in AXES
    if axis.onwards is not None and axis.back is not None
    for pair in ((axis.onwards, axis.back), (axis.back, axis.onwards))
]

Path = tuple[str, ...]


@dataclass
class SceneSearch:
    """The search in one scene.

    Attributes:
        example: where it starts and what it looks for.
        root: the start.
        known: the places that were reached, with how many actions are left from each (estimated).
        goals: places that look like the goal.
        queue: actions that nobody has tried, the most promising first.
        counts: for each axis of the inverse model the logarithms of the probabilities of the counts that lead
            from the start to the goal.
        trials: whole paths to be tried, those whose counts are the likeliest first.
        tried: all that ever were among them.
    """

    example: Example
    root: Node
    known: dict[Node, float] = field(default_factory=dict)
    goals: list[Node] = field(default_factory=list)
    queue: list[tuple[float, int, Node, str]] = field(default_factory=list)
    counts: list[list[float]] = field(default_factory=list)
    trials: list[tuple[float, int, Path]] = field(default_factory=list)
    tried: set[Path] = field(default_factory=set)

    @property
    def steps(self) -> int:
        """The length of the shortest path to the goal that is known; many if there is none."""
        return min((len(node.actions) for node in self.goals), default=1_000)


class TraceSearch:
    """Searches all scenes of a task.

    Args:
        task: the specification.
        robot: remembers what was simulated; eager.
        table: embeddings of observations.
        inverse: estimates what is left.
        guide: whether its estimates count; else shorter paths are tried first.
        sharing: whether what has led to the goal in one scene is tried in the others.
    """

    def __init__(
        self,
        task: Task,
        robot: MemoRobot,
        table: FeatureTable,
        inverse: InverseModel,
        guide: bool = True,
        sharing: bool = True,
    ) -> None:
        self.robot, self.table, self.inverse = robot, table, inverse
        self.guide, self.sharing = guide, sharing
        self._order = count()
        self.scenes: list[SceneSearch] = []
        self.scenes += [self._begin(example) for example in task.examples]
        self._arrive([(scene, [scene.root]) for scene in self.scenes])
        roots = table.rows(scene.root.view for scene in self.scenes)
        goals = table.rows(scene.example.goal for scene in self.scenes)
        shares = inverse.log_shares(table.table[roots], table.table[goals])
        for scene, rows in zip(self.scenes, shares.tolist(), strict=True):
            scene.counts = rows
        for scene in self.scenes:  # what was reached at once
            for node in scene.goals:
                self._share(node.actions)

    @property
    def complete(self) -> bool:
        """Whether the goal was reached in every scene."""
        return all(scene.goals for scene in self.scenes)

    @property
    def reached(self) -> tuple[bool, ...]:
        """For each scene whether the goal was reached in it."""
        return tuple(bool(scene.goals) for scene in self.scenes)

    def _begin(self, example: Example) -> SceneSearch:
        self.robot.reset(example.scene)
        return SceneSearch(example, self.robot.node)

    def step(self, slack: float | None = None) -> bool:
        """Try some more actions in every scene where the goal was not reached.

        Args:
            slack: go on in the scenes where it was, too, with ways that may be longer than the shortest one
                by so many actions.

        Returns:
            whether there was anything to try.
        """
        new = [(scene, list(self._try(scene, slack))) for scene in self.scenes]
        self._arrive(new)
        return any(places for _, places in new)

    def _try(self, scene: SceneSearch, slack: float | None) -> Iterator[Node]:
        """The places that were reached, new ones and others."""
        self.robot.reset(scene.example.scene)
        for _ in range(AT_ONCE):
            if scene.trials:
                yield from self._follow(scene, heapq.heappop(scene.trials)[2])
        if scene.goals and slack is None:
            return
        for _ in range(AT_ONCE):
            edge = self._next(scene, slack)
            if edge is None:
                return
            node, action = edge
            self.robot.extend(node, action)
            yield node.children[action]

    def _next(self, scene: SceneSearch, slack: float | None) -> tuple[Node, str] | None:
        """What to try next: the most promising, or something nearly as good nearer to where the robot is."""
        most = 1_000.0 if slack is None else max(scene.steps + slack, SHORTEST_WAY_BACK)
        best: list[tuple[float, int, Node, str]] = []
        later: list[tuple[float, int, Node, str]] = []  # what may be of use with more slack
        while scene.queue and len(best) < LOOK_AT:
            entry = heapq.heappop(scene.queue)
            if entry[3] not in entry[2].children:
                (best if len(entry[2].actions) < most else later).append(entry)
        chosen = min(best, key=lambda entry: entry[0] + WAY * self._way_to(entry[2]), default=None)
        for entry in (*best, *later):
            if entry is not chosen:
                heapq.heappush(scene.queue, entry)
        return None if chosen is None else chosen[2:]

    def _way_to(self, node: Node) -> int:
        way = self.robot.distance(node)
        return RESET + len(node.actions) if way is None else way

    def _follow(self, scene: SceneSearch, path: Path) -> Iterator[Node]:
        node = scene.root
        for action in path:
            self.robot.extend(node, action)
            node = node.children[action]
            yield node

    def _arrive(self, reached: Sequence[tuple[SceneSearch, list[Node]]]) -> None:
        """Look at the places that are new: is it the goal, and what is left?"""
        new: list[tuple[SceneSearch, Node]] = []
        for scene, nodes in reached:
            for node in nodes:
                if node not in scene.known:
                    scene.known[node] = 0.0
                    new.append((scene, node))
                    if goal_match(node.view, scene.example.goal):
                        self._found(scene, node)
        if not new:
            return
        rows = self.table.rows(node.view for _, node in new)
        goals = self.table.rows(scene.example.goal for scene, _ in new)
        left, after = self.inverse.left(self.table.table[rows], self.table.table[goals], ACTIONS)
        for (scene, node), now, each in zip(new, left.tolist(), after.tolist(), strict=True):
            scene.known[node] = now
            done = len(node.actions) + 1
            for action, rest in zip(ACTIONS, each, strict=True):
                entry = (done + (WEIGHT * rest if self.guide else 0.0), next(self._order), node, action)
                heapq.heappush(scene.queue, entry)

    def _found(self, scene: SceneSearch, node: Node) -> None:
        """Try the same in the other scenes; where the goal was reached, it may be reached like that, too."""
        scene.goals.append(node)
        if scene.counts:
            self._share(node.actions)

    def _share(self, path: Path) -> None:
        if self.sharing:
            for scene in self.scenes:
                self._suggest(scene, path)

    def visit(self, scene: SceneSearch, paths: Iterable[Path]) -> None:
        """Take along the places on these paths, which were walked before."""
        self.robot.reset(scene.example.scene)
        self._arrive([(scene, [node for path in paths for node in self._follow(scene, path)])])

    def _suggest(self, scene: SceneSearch, path: Path) -> None:
        if path and len(path) <= LONGEST and path not in scene.tried:
            scene.tried.add(path)
            entry = (self._strangeness(scene, path), next(self._order), path)
            heapq.heappush(scene.trials, entry)

    def _strangeness(self, scene: SceneSearch, path: Path) -> float:
        """How unlikely it is that so many actions of each kind lead from the start to the goal."""
        if not self.guide:
            return float(len(path))
        counts = [0] * len(AXES)
        for action in path:
            axis, step = effect(action)
            counts[axis] += step
        middle = len(scene.counts[0]) // 2
        shares = (
            row[max(0, min(2 * middle, middle + n))] for row, n in zip(scene.counts, counts, strict=True)
        )
        return LENGTH * len(path) - sum(max(LEAST, share) for share in shares)

    def suggest_around(self, places: int, changes: Callable[[Path], Iterator[Path]]) -> None:
        """Where no goal was reached, try what is like that which has led close to it."""
        for scene in self.scenes:
            if not scene.goals:
                near = {n: left + NEAR * len(n.actions) for n, left in scene.known.items()}
                for node in heapq.nsmallest(places, near, key=near.__getitem__):
                    for changed in changes(node.actions):
                        self._suggest(scene, changed)

    def suggest_ways(self, changes: Callable[[Path], Iterator[Path]]) -> None:
        """The same as `suggest` for all known ways to the goals, not only the shortest ones."""
        ways = dict.fromkeys(way for scene in self.scenes if scene.goals for way in goal_paths(scene))
        for scene in self.scenes:
            if not scene.goals:
                for path in ways:
                    self._suggest(scene, path)
                    for changed in changes(path):
                        self._suggest(scene, changed)

    def suggest(self, changes: Callable[[Path], Iterator[Path]]) -> None:
        """Where no goal was reached, try what is like that which has led to the goals of other scenes."""
        shortest = dict.fromkeys(min((g.actions for g in s.goals), key=len) for s in self.scenes if s.goals)
        for scene in self.scenes:
            if not scene.goals:
                for path in sorted(shortest, key=len):
                    for changed in changes(path):
                        self._suggest(scene, changed)


def one_edit_away(path: Path) -> Iterator[Path]:
    """Paths with one action more, less, or exchanged."""
    for i in range(len(path) + 1):
        for action in ACTIONS:
            yield (*path[:i], action, *path[i:])
        if i < len(path):
            yield (*path[:i], *path[i + 1 :])
            for action in ACTIONS:
                yield (*path[:i], action, *path[i + 1 :])


def with_detour(path: Path) -> Iterator[Path]:
    """Paths with one action more, and later the one that undoes it: the way out may be blocked."""
    for onwards, back in UNDONE:
        for i in range(len(path) + 1):
            for j in range(i, len(path) + 1):
                yield (*path[:i], onwards, *path[i:j], back, *path[j:])


def with_loop(path: Path) -> Iterator[Path]:
    """Paths in which a part of at most three actions comes several times in turn."""
    for start in range(len(path)):
        for length in range(1, min(3, len(path) - start) + 1):
            part = path[start : start + length]
            for times in range(2, MOST_TIMES + 1):
                yield (*path[:start], *(part * times), *path[start + length :])


def goal_paths(scene: SceneSearch, longer: int = 1) -> list[Path]:
    """Known ways to a scene's goals that are at most so much longer than the shortest one; the first few."""
    most = scene.steps + longer
    found: list[Path] = []
    graph = Graph.of(scene.root, scene.goals, longer)
    stack: list[tuple[Node, Path]] = [(scene.root, ())]
    while stack and len(found) < WAYS:
        node, path = stack.pop()
        if node in graph.goals:
            found.append(path)
        for action, child in graph.ways.get(node, {}).items():
            if len(path) + 1 + graph.distance[child] <= most:
                stack.append((child, (*path, action)))
    return found
