"""Memoised worlds: one sequence of actions from one scene always ends in the same place; simulate it once."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from evaps.robots.base import Robot, Scene, WorldState
from evaps.robots.frames import FrameStore, Image, Observation, digest

FRAME_BUDGET = 256 << 20  # bytes: 6,000 frames as they are or 25,000 packed ones


class Look(NamedTuple):
    """What is known of a place: which perceptions are true, the hidden state, and the digest of the view."""

    perceptions: frozenset[str]
    state: WorldState
    digest: bytes


class Node:
    """A place in what can happen from a scene: where some sequences of actions lead to.

    Attributes:
        actions: the shortest of these sequences that is known.
        children: the places that one more action leads to.
        look: what is known of it; None until somebody looks.
        view: the observation there, always the same object.
    """

    __slots__ = ("actions", "children", "look", "view")

    def __init__(self, actions: tuple[str, ...], memo: MemoRobot, tree: Tree) -> None:
        self.actions = actions
        self.children: dict[str, Node] = {}
        self.look: Look | None = None
        self.view = RememberedView(memo, tree, self)


class Tree:
    """All places that are known from a scene.

    Two places of which the robot says that nothing can tell them apart, and which look the same, are one: so
    it is no tree, strictly speaking, after a step ahead and one to the left, in either order.
    """

    __slots__ = ("places", "root", "scene")

    def __init__(self, scene: Scene, memo: MemoRobot) -> None:
        self.scene = scene
        self.root = Node((), memo, self)
        self.places: dict[tuple[Hashable, bytes], Node] = {}


class RememberedView:
    """An observation that may not be in memory: it is looked up, or simulated again, when it is asked for."""

    __slots__ = ("_memo", "_node", "_tree")

    def __init__(self, memo: MemoRobot, tree: Tree, node: Node) -> None:
        self._memo, self._tree, self._node = memo, tree, node

    @property
    def digest(self) -> bytes:
        """Of its colours and depth: `evaps.robots.frames.digest`."""
        return self._memo.look_at(self._tree, self._node).digest

    @property
    def perceptions(self) -> frozenset[str]:
        """Those that are true in it, of all that the robot remembers."""
        return self._memo.look_at(self._tree, self._node).perceptions

    @property
    def frame(self) -> Observation:
        """The observation as the robot gave it."""
        return self._memo.frame_at(self._tree, self._node)

    @property
    def rgb(self) -> Image:
        """Colours, uint8 ``[height, width, 3]``."""
        return self.frame.rgb

    @property
    def depth(self) -> Image:
        """Depth, uint8 ``[height, width]``."""
        return self.frame.depth


class Unsimulated(LookupError):  # noqa: N818 - nothing is wrong
    """A memory that may not simulate was asked for what lies behind a place."""

    def __init__(self, node: Node, action: str) -> None:
        super().__init__(f"what {action} leads to after {' '.join(node.actions) or 'nothing'} is not known")
        self.node, self.action = node, action


class MemoRobot(Robot):
    """A robot that remembers: what was simulated once is looked up from then on.

    Args:
        robot: the robot that simulates what is not known yet.
        perceptions: all that a program may ask it, such as ``"ISTHERE Demon"``.
        eager: look at every place when it is first reached. Otherwise only where a perception, the view or
            the state is asked for: cheaper where few are, dearer where it is done later.
        budget: bytes of memory for frames; those that have to go are simulated again when they are asked for.
        spares: more robots like it. Each stands where it was used last, and whichever is on the way to a
            place is brought there: with one a scene, that of one need not be left for another.

    Attributes:
        robot: the one that was used last.
        simulated_actions: how many actions the underlying robots have executed, replays included.
    """

    def __init__(
        self,
        robot: Robot,
        perceptions: Iterable[str],
        eager: bool = True,
        budget: int = FRAME_BUDGET,
        spares: Sequence[Robot] = (),
    ) -> None:
        self.robot = robot
        self._live: dict[Robot, tuple[Tree, Node] | None] = dict.fromkeys(
            [robot, *spares]
        )  # where each stands
        self.perceptions = frozenset(perceptions)
        self.eager = eager
        self.simulated_actions = 0
        self.frames = FrameStore(budget)
        self._trees: dict[Scene, Tree] = {}
        self._tree: Tree | None = None
        self._node: Node | None = None
        self._simulates = True

    @property
    def node(self) -> Node:
        """Where the robot stands in its tree."""
        return self._place[1]

    @property
    def _place(self) -> tuple[Tree, Node]:
        if self._tree is None or self._node is None:
            raise ValueError("the robot has no scene yet: call reset(scene) first")
        return self._tree, self._node

    def reset(self, scene: Scene) -> None:
        """Go back to the root of the scene's tree.

        Raises:
            SceneError: the scene is not valid for the underlying robot.
        """
        tree = self._trees.get(scene)
        if tree is None:
            tree = Tree(scene, self)
            self._bring_to(tree, tree.root)
            self._trees[scene] = tree
            if self.eager:
                self._arrive(tree, tree.root)
        self._tree, self._node = tree, tree.root

    def act(self, action: str) -> None:
        """Follow the tree, and let it grow where it ends.

        Raises:
            Unsimulated: it would have to grow within `known_only`.
        """
        tree, node = self._place
        child = node.children.get(action)
        if child is None:
            if not self._simulates:
                raise Unsimulated(node, action)
            child = self._grow(tree, node, action)
        self._node = child

    def perceive(self, perception: str) -> bool:
        """Whether a perception is true.

        Raises:
            ValueError: it is not one of those that are remembered.
        """
        if perception not in self.perceptions:
            raise ValueError(f"this memoised robot does not remember the perception {perception!r}")
        return perception in self.look_at(*self._place).perceptions

    def observe(self) -> RememberedView:
        """The current view, to be had when it is asked for."""
        return self.node.view

    def state(self) -> WorldState:
        """The hidden state; for evaluation alone."""
        return self.look_at(*self._place).state

    def fingerprint(self) -> Hashable | None:
        """Places are merged already, so that a place says it all."""
        return None

    def forget(self) -> None:
        """Drop all trees and frames, and the memory that they hold."""
        self._trees.clear()
        self.frames.clear()
        self._tree = self._node = None
        self.leave()

    def leave(self) -> None:
        """Leave the underlying robots to somebody else: they need not stand where they stood any more."""
        self._live = dict.fromkeys(self._live)

    def close(self) -> None:
        """Close the underlying robots; what is known stays known."""
        self.leave()
        for robot in self._live:
            robot.close()

    @contextmanager
    def known_only(self) -> Iterator[None]:
        """In here an action that leads to where nobody was yet is an error.

        Without ``eager``, a look at a place that nobody has looked at still brings a robot there.
        """
        self._simulates = False
        try:
            yield
        finally:
            self._simulates = True

    def extend(self, node: Node, action: str) -> None:
        """Simulate what an action leads to from a place of the current scene's tree."""
        if action not in node.children:
            self._grow(self._place[0], node, action)

    def distance(self, node: Node) -> int | None:
        """How many actions lead a robot from where it stands to a place; None: there is none on the way."""
        robot = self._on_the_way(self._place[0], node)
        return None if robot is None else len(node.actions) - self._done(robot)

    def look_at(self, tree: Tree, node: Node) -> Look:
        """What is known of a place; the underlying robot is brought there if that is nothing yet."""
        if node.look is None:
            self._bring_to(tree, node)
            self._arrive(tree, node)
            assert node.look is not None
        return node.look

    def frame_at(self, tree: Tree, node: Node) -> Observation:
        """The frame of a place, from the store or simulated again."""
        frame = self.frames.get(self.look_at(tree, node).digest)
        if frame is None:
            self._bring_to(tree, node)
            frame = self.robot.observe()
            self.frames.put(digest(frame), frame)
        return frame

    def _look(self) -> Look:
        robot = self.robot
        frame = robot.observe()
        look = Look(frozenset(p for p in self.perceptions if robot.perceive(p)), robot.state(), digest(frame))
        self.frames.put(look.digest, frame)
        return look

    def _arrive(self, tree: Tree, node: Node) -> Node:
        """Look at a new place; if it is one that is known already, that one."""
        node.look = self._look()
        fingerprint = self.robot.fingerprint()
        if fingerprint is None:
            return node
        known = tree.places.setdefault((fingerprint, node.look.digest), node)
        if len(node.actions) < len(known.actions):
            known.actions = node.actions
        if known is not node and not node.children:  # if it is on a way already, it shares what comes after
            node.children = known.children
        return known

    def _grow(self, tree: Tree, node: Node, action: str) -> Node:
        self._bring_to(tree, node)
        self._step(action)
        child = Node((*node.actions, action), self, tree)
        if self.eager:
            child = self._arrive(tree, child)
        node.children[action] = child
        self._live[self.robot] = (tree, child)
        return child

    def _bring_to(self, tree: Tree, node: Node) -> None:
        """Bring a robot to a place: onwards one that is on the way, else one from the start."""
        robot = self._on_the_way(tree, node)
        self.robot = self._to_be_reset(tree) if robot is None else robot
        at = self._live.pop(self.robot)  # and behind the others again: the order is that of their use
        self._live[self.robot] = None  # if it is interrupted, it stands nowhere
        if robot is None or at is None:
            self.robot.reset(tree.scene)
            at = (tree, tree.root)
        for action in node.actions[len(at[1].actions) :]:
            self._step(action)
        self._live[self.robot] = (tree, node)

    def _on_the_way(self, tree: Tree, node: Node) -> Robot | None:
        """The robot that has the fewest actions to go."""
        on_the_way = [
            robot
            for robot, at in self._live.items()
            if at is not None and at[0] is tree and node.actions[: len(at[1].actions)] == at[1].actions
        ]
        return max(on_the_way, key=self._done, default=None)

    def _done(self, robot: Robot) -> int:
        at = self._live[robot]
        return 0 if at is None else len(at[1].actions)

    def _to_be_reset(self, tree: Tree) -> Robot:
        """A robot in this scene, else one that is in none, else the one that was not used for longest."""
        here = (robot for robot, at in self._live.items() if at is not None and at[0] is tree)
        nowhere = (robot for robot, at in self._live.items() if at is None)
        return next(here, None) or next(nowhere, None) or next(iter(self._live))

    def _step(self, action: str) -> None:
        self._live[self.robot] = None
        self.robot.act(action)
        self.simulated_actions += 1
