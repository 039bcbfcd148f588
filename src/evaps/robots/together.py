"""Many programs on one scene, in the order in which the simulator replays least."""

from __future__ import annotations

from collections.abc import Sequence

from evaps.dsl import Limits, Program, Trace, run
from evaps.robots.base import Scene
from evaps.robots.frames import Observation
from evaps.robots.memo import MemoRobot, Node, Unsimulated

Edge = tuple[Node, str]
"""An action that nobody has executed yet, and where."""


USUAL_LIMITS = Limits()


def run_together(
    programs: Sequence[Program], scene: Scene, robot: MemoRobot, limits: Limits = USUAL_LIMITS
) -> list[Trace[Observation]]:
    """The traces of several programs from one scene: the same as one after the other, for less.

    All programs run as far as their ways are known. Then one action that some of them wait for is simulated,
    and these go on; actions behind the place where the simulator stands come first, so that a way which
    leads on from the end of another one is not walked from the start again.

    Args:
        programs: in any order, repetitions included.
        scene: where each of them starts.
        robot: remembers what was simulated before.
        limits: of each run.
    """
    robot.reset(scene)
    traces: dict[int, Trace[Observation]] = {}
    waiting: dict[Edge, list[int]] = {}
    ready: Sequence[int] = range(len(programs))
    while ready:
        for index in ready:
            edge = _run_known(index, programs[index], scene, robot, limits, traces)
            if edge is not None:
                waiting.setdefault(edge, []).append(index)
        ready = _simulate_one(waiting, robot)
    return [traces[index] for index in range(len(programs))]


def _run_known(
    index: int,
    program: Program,
    scene: Scene,
    robot: MemoRobot,
    limits: Limits,
    traces: dict[int, Trace[Observation]],
) -> Edge | None:
    """Run a program as far as its way is known: either its trace, or what has to be simulated first."""
    robot.reset(scene)
    try:
        with robot.known_only():
            traces[index] = run(program, robot, limits)
    except Unsimulated as end:
        return end.node, end.action
    return None


def _simulate_one(waiting: dict[Edge, list[int]], robot: MemoRobot) -> Sequence[int]:
    """Simulate the cheapest action that is waited for; those that can go on now."""
    if not waiting:
        return ()
    node, action = min(waiting, key=lambda edge: _cost(edge[0], robot))
    robot.extend(node, action)
    return waiting.pop((node, action))


def _cost(node: Node, robot: MemoRobot) -> tuple[bool, int]:
    onwards = robot.distance(node)
    return (True, len(node.actions)) if onwards is None else (False, onwards)
