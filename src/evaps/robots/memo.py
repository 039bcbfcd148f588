"""Memoised worlds: one sequence of actions from one scene always ends in the same place; simulate it once."""

from __future__ import annotations

from collections.abc import Iterable

from evaps.robots.base import Observation, Robot, Scene, WorldState


class Node:
    """A place in the tree of what can happen from a scene: what one sequence of actions leads to."""

    __slots__ = ("actions", "children", "observation", "perceptions", "state")

    def __init__(self, actions: tuple[str, ...], robot: Robot, known: Iterable[str]) -> None:
        self.actions = actions
        self.children: dict[str, Node] = {}
        self.observation: Observation = robot.observe()
        self.perceptions = frozenset(p for p in known if robot.perceive(p))
        self.state: WorldState = robot.state()


class MemoRobot(Robot):
    """A robot that remembers: what was simulated once is looked up from then on.

    Args:
        robot: the robot that simulates what is not known yet.
        perceptions: all that a program may ask it, such as ``"ISTHERE Demon"``.

    Attributes:
        simulated_actions: how many actions the underlying robot has executed, replays included.
    """

    def __init__(self, robot: Robot, perceptions: Iterable[str]) -> None:
        self.robot = robot
        self.perceptions = frozenset(perceptions)
        self.simulated_actions = 0
        self._roots: dict[Scene, Node] = {}
        self._scene: Scene | None = None
        self._node: Node | None = None
        self._live: tuple[Scene, tuple[str, ...]] | None = None  # where the underlying robot stands

    @property
    def node(self) -> Node:
        """Where the robot stands in its tree."""
        if self._node is None:
            raise ValueError("the robot has no scene yet: call reset(scene) first")
        return self._node

    def reset(self, scene: Scene) -> None:
        """Go back to the root of the scene's tree."""
        if scene not in self._roots:
            self._live = None
            self.robot.reset(scene)
            self._live = (scene, ())
            self._roots[scene] = Node((), self.robot, self.perceptions)
        self._scene, self._node = scene, self._roots[scene]

    def act(self, action: str) -> None:
        """Follow the tree, and let it grow where it ends."""
        child = self.node.children.get(action)
        if child is None:
            child = self.node.children[action] = self._simulate(action)
        self._node = child

    def perceive(self, perception: str) -> bool:
        """Looked up, never simulated.

        Raises:
            ValueError: it is not one of those that are remembered.
        """
        if perception not in self.perceptions:
            raise ValueError(f"this memoised robot does not remember the perception {perception!r}")
        return perception in self.node.perceptions

    def observe(self) -> Observation:
        """Looked up, never simulated."""
        return self.node.observation

    def state(self) -> WorldState:
        """Looked up, never simulated; for evaluation alone."""
        return self.node.state

    def forget(self) -> None:
        """Drop all trees, and the memory that they hold: 38 KB a node."""
        self._roots.clear()
        self._scene = self._node = None

    def close(self) -> None:
        """Close the underlying robot."""
        self.robot.close()

    def _simulate(self, action: str) -> Node:
        self._bring_to(self.node.actions)
        self._step(action)
        return Node((*self.node.actions, action), self.robot, self.perceptions)

    def _bring_to(self, actions: tuple[str, ...]) -> None:
        """Bring the underlying robot to where this one stands: onwards if on the way, else from the start."""
        assert self._scene is not None
        scene, done = self._live or (None, ())
        if scene != self._scene or done != actions[: len(done)]:
            self._live = None  # if the robot dies in between, it stands nowhere
            self.robot.reset(self._scene)
            self._live, done = (self._scene, ()), ()
        for action in actions[len(done) :]:
            self._step(action)

    def _step(self, action: str) -> None:
        assert self._live is not None
        scene, done = self._live
        self._live = None
        self.robot.act(action)
        self._live = (scene, (*done, action))
        self.simulated_actions += 1
