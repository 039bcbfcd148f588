import re
from dataclasses import replace

import pytest
from html_tree import parse

from evaps.dsl import Program
from evaps.synthesis.solution import Candidate, attempt
from evaps.viewer.explain import explain
from evaps.viewer.gallery import Answer, Exhibit, code_spans, write_gallery

MEANT = """
def run():
    turn_left()
    if is_there(Demon):
        attack()
"""
OTHER_WAY = """
def run():
    for _ in range(2):
        turn_left()
    turn_right()
    if is_there(Demon):
        attack()
"""
EARLY = """
def run():
    turn_left()
"""
ASKS_AMISS = """
def run():
    turn_left()
    if not is_there(Demon):
        attack()
"""
NEVER_ENDS = """
def run():
    turn_left()
    while not in_target(Demon):
        if in_target(Demon):
            move_forward()
"""
EQUAL_LINES = """
def run():
    move_forward()
    if is_there(Demon):
        if not is_there(Demon):
            move_forward()
"""
ASKS_OFTEN = """
def run():
    turn_left()
    if in_target(Revenant):
        attack()
    if in_target(HellKnight):
        attack()
    if not is_there(Demon):
        move_forward()
"""
ENDLESS = """
def run():
    turn_left()
    if is_there(Demon):
        attack()
    while not in_target(Demon):
        if in_target(Demon):
            move_forward()
"""
TWICE = """
def run():
    turn_left()
    turn_left()
"""
WHY = {
    "quick": "In example",
    "mended": "It is the hidden program.",
    "roundabout": "Another program than the hidden one, with the same outcome in all scenes.",
    "other view": "Another program than the hidden one. It leads to the same state in all scenes",
    "other state": "All views are right, but the robot or a thing is in another state",
}
SCENES = [f"scene {i}" for i in range(1, 6)]


@pytest.fixture(scope="module")
def tried(world):
    task = world.task("task-1", MEANT)
    return lambda text: attempt(Program.parse(text), task, world.robot)


@pytest.fixture(scope="module")
def exhibit(world, tried):
    chains = {"quick": [EARLY], "mended": [ASKS_AMISS, EARLY, MEANT], "roundabout": [OTHER_WAY]}
    answers = tuple(
        Answer(method, Candidate(tuple(map(tried, chain)), 0, method), chain[-1] != EARLY)
        for method, chain in chains.items()
    )
    amiss, whole = (Candidate((tried(text),), 0, "") for text in (EARLY, OTHER_WAY))
    answers += Answer("other view", amiss, True), Answer("other state", whole, False)
    goals = tuple(example.goal for example in world.task("task-1", MEANT).examples)
    return Exhibit("task-1", goals, tried(MEANT), answers)


@pytest.fixture(scope="module")
def page(tmp_path_factory, exhibit):
    path = tmp_path_factory.mktemp("gallery") / "gallery.html"
    write_gallery(path, [exhibit, exhibit], ["Drawn <by> lot."])
    return parse(path.read_text(encoding="utf-8"))


def test_what_is_right_needs_no_explanation(tried):
    assert explain(tried(MEANT), tried(MEANT), SCENES).sentences == ()
    assert explain(tried(OTHER_WAY), tried(MEANT), SCENES).sentences == ()


def test_an_explanation_names_the_moment_at_which_the_runs_part(tried):
    found = explain(tried(EARLY), tried(MEANT), SCENES)
    assert not tried(EARLY).passed[found.scene]
    parting, asked, lacking = found.sentences
    assert parting == (
        f"In {SCENES[found.scene]} it does what was meant for 1 action, then ends "
        "where the hidden program goes on with `attack()`."
    )
    assert asked == "What the hidden program asks at that view: `if is_there(Demon)` is true."
    assert lacking == "It has no `if`; the hidden program has."


def test_an_explanation_names_what_both_have_asked(tried):
    found = explain(tried(ASKS_AMISS), tried(MEANT), SCENES)
    own, other = found.sentences[1:3]
    demon = found.sentences[0].endswith("goes on with `attack()`.")  # which the hidden program shoots at
    assert own == f"What it asks at that view: `if not is_there(Demon)` is {str(not demon).lower()}."
    assert (
        other == f"What the hidden program asks at that view: `if is_there(Demon)` is {str(demon).lower()}."
    )


def test_of_many_questions_the_last_ones_are_named(tried):
    sentences = explain(tried(ASKS_OFTEN), tried(MEANT), SCENES).sentences
    asked = next(s for s in sentences if s.startswith("What it asks last at that view: "))
    assert "`if in_target(HellKnight)` is" in asked
    assert "`if not is_there(Demon)` is" in asked
    assert "Revenant" not in asked


def test_an_explanation_says_that_a_run_does_not_end(tried):
    whole = explain(tried(ENDLESS), tried(MEANT), SCENES).sentences
    assert "it does what was meant, and then goes on without an action, and without an end" in whole[0]
    assert whole[-1] == "No scene reaches line 7, `move_forward()`."
    halfway = explain(tried(NEVER_ENDS), tried(TWICE), SCENES).sentences
    assert "then goes on without an action where the hidden program goes on with `turn_left()`" in halfway[0]
    assert "Its run does not come to an end." in halfway


def test_lines_that_look_alike_are_told_apart_by_their_numbers(tried):
    sentences = explain(tried(EQUAL_LINES), tried(MEANT), SCENES).sentences
    assert "No scene reaches line 5, `move_forward()`." in sentences


def test_what_fails_in_the_last_scene_alone_is_told(tried):
    passing, failing = tried(MEANT), tried(EARLY)
    last = replace(failing, passed=(True, True, True, True, False))
    assert explain(last, passing, SCENES).sentences[0] == "It passes everywhere but in scene 5."
    assert "everywhere" not in explain(failing, passing, SCENES).sentences[0]


def test_code_stands_between_backticks():
    assert list(code_spans("It has no `if`.")) == [(False, "It has no "), (True, "if"), (False, ".")]


def test_the_overview_counts_what_is_right_and_leads_to_it(page):
    (overview,) = page.all("table")
    head, *tasks, foot = overview.all("tr")
    assert [cell.text for cell in head.all("th")] == ["Task", *WHY]
    for row in tasks:
        passed, *others = row.all("a", "verdict")
        assert re.fullmatch("[0-4]", passed.words)
        assert passed.attributes["aria-label"] == f"quick, task-1: wrong, {passed.words} of 5 views"
        assert [a.words for a in others] == ["✓", "✓", "✓", "5"]
    assert [cell.text for cell in foot.all("td")] == ["0", "2", "2", "2", "0"]  # of two
    links = [a.attributes["href"] for a in overview.all("a")]
    there = [e.attributes.get("id") for tag in ("article", "details") for e in page.all(tag)]
    assert sorted(links) == sorted(f"#{name}" for name in there)


def test_each_answer_has_its_program_its_repairs_and_its_run(page, exhibit):
    article = next(page.all("article"))
    for section, answer in zip(article.all("details"), exhibit.answers, strict=True):
        candidate = answer.candidate
        assert next(section.all("pre")).text == candidate.program.to_python()
        assert len(list(section.all("p", "diff"))) == len(candidate.attempts) - 1
        own, *hidden = section.all("ol", "strip")
        scene = exhibit.explained(answer).scene
        assert len(list(own.all("use"))) == len(candidate.final.traces[scene].observations) + 1  # the goal
        assert len(hidden) == (0 if candidate.final.solved else 1)
        (why,) = section.all("p", "why")
        assert why.words.startswith(WHY[answer.method])


def test_the_lead_is_escaped(page):
    assert "Drawn <by> lot." in page.text
