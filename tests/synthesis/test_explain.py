"""Programs from traces: they lead to the goals, they are short, and what made the traces is among them."""

import numpy as np
import pytest

from evaps.dsl import Program, run
from evaps.dsl.counting import longest_run
from evaps.dsl.sampler import PERCEPTION_KEYS, sample_program
from evaps.robots.base import Pose, Scene
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot, Node, Tree
from evaps.robots.scenes import random_scene
from evaps.synthesis.explain import MOST_SUFFIXES, Explainer, Limits, cost_of
from evaps.synthesis.graph import Graph
from evaps.synthesis.known import CONDITIONS


@pytest.fixture(scope="module")
def memo():
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    yield robot
    robot.close()


def graphs_of(program: Program, memo: MemoRobot, seed: int) -> tuple[list[Graph], list[int]]:
    """What is known of five random scenes when the program alone has run on them, and the runs' lengths."""
    memo.forget()
    rng = np.random.default_rng(seed)
    graphs, lengths = [], []
    for _ in range(5):
        memo.reset(random_scene(rng))
        root = memo.node
        trace = run(program, memo)
        assert trace.halted
        graphs.append(Graph.of(root, [memo.node]))
        lengths.append(len(trace.actions))
    return graphs, lengths


def test_actions_alone_are_found_word_by_word(memo: MemoRobot) -> None:
    program = Program.parse("DEF run m( MOVE_LEFT TURN_RIGHT ATTACK m)")
    graphs, _ = graphs_of(program, memo, 0)
    assert Explainer(graphs, Limits()).programs() == [program]


def test_many_places_that_look_like_the_goal_are_no_harm(memo: MemoRobot) -> None:
    """Of 20 in each of five scenes there are 3.2 million combinations; no more are kept than are of use."""
    graphs = []
    for _ in range(5):
        tree = Tree(Scene(Pose(0, 0, 0), ()), memo)
        places = [tree.root]
        for _ in range(20):
            places.append(Node((), memo, tree))
            places[-2].children["TURN_LEFT"] = places[-1]
        graphs.append(Graph.of(places[0], places[1:]))
    assert len(Explainer(graphs, Limits())._suffixes()) <= 2 * MOST_SUFFIXES


def test_who_is_stopped_comes_back_with_what_there_is(memo: MemoRobot) -> None:
    program = Program.parse("DEF run m( MOVE_LEFT TURN_RIGHT ATTACK m)")
    graphs, _ = graphs_of(program, memo, 0)
    asked = iter([False] * 3)
    explainer = Explainer(graphs, Limits(), lambda: next(asked, True))
    assert explainer.programs() == []
    assert next(asked, None) is None, "it has asked"


@pytest.mark.parametrize(
    "text",
    [
        "IF c( ISTHERE Demon c) i( TURN_LEFT i) MOVE_BACKWARD",
        "MOVE_LEFT IFELSE c( not c( ISTHERE Revenant c) c) i( ATTACK i) ELSE e( TURN_LEFT TURN_LEFT e)",
        "REPEAT R=4 r( TURN_LEFT r) MOVE_FORWARD",
        "WHILE c( ISTHERE HellKnight c) w( TURN_RIGHT w) ATTACK",
        "IF c( ISTHERE Demon c) i( TURN_LEFT IF c( ISTHERE Revenant c) i( ATTACK i) i)",
    ],
)
def test_control_flow_is_found(memo: MemoRobot, text: str) -> None:
    """On scenes that tell enough: what is found does there what the program does, and costs no more."""
    program = Program.parse(f"DEF run m( {text} m)")
    for seed in range(40):
        try:
            graphs, lengths = graphs_of(program, memo, seed)
        except AssertionError:
            continue
        if len(set(lengths)) > 1 or "REPEAT" in text:
            break
    explainer = Explainer(graphs, Limits())
    found = explainer.programs()
    assert found
    assert all(explainer.explains(p) for p in found)
    assert explainer.explains(program)
    assert cost_of(found[0]) <= cost_of(program)


def test_what_is_found_is_no_dearer_than_a_random_program_that_made_the_traces(memo: MemoRobot) -> None:
    rng = np.random.default_rng(5)
    tried = 0
    while tried < 12:
        program = sample_program(rng, conditionals=1)
        if longest_run(program) > 8 or cost_of(program) > 40:
            continue
        graphs, _ = graphs_of(program, memo, tried)
        explainer = Explainer(graphs, Limits(body=6 * Limits.action))
        assert explainer.explains(program)
        found = explainer.programs()
        if any(graph.root not in graph.goals for graph in graphs):
            assert found, program
            assert cost_of(found[0]) <= cost_of(program)
        for variant in (v for p in found for v in explainer.variants(p)):
            assert explainer.explains(variant)
        tried += 1


def test_a_goal_that_cannot_be_reached_has_no_program(memo: MemoRobot) -> None:
    graphs, _ = graphs_of(Program.parse("DEF run m( ATTACK m)"), memo, 1)
    apart = Graph.of(graphs[0].root, [graphs[1].root])
    assert Explainer([apart, *graphs[1:]], Limits()).programs() == []


def test_all_conditions_can_be_asked() -> None:
    assert len(CONDITIONS) == len(set(CONDITIONS)) == 12


@pytest.mark.parametrize("body", ["TURN_LEFT MOVE_LEFT TURN_RIGHT", "ATTACK"])
def test_a_long_run_is_explained_by_a_loop(memo: MemoRobot, body: str) -> None:
    program = Program.parse(f"DEF run m( REPEAT R=6 r( {body} r) m)")
    graphs, _ = graphs_of(program, memo, 3)
    assert program in Explainer(graphs, Limits(loops=True)).programs()
