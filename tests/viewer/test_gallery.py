import re

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
ENDLESS = """
def run():
    turn_left()
    if is_there(Demon):
        attack()
    while not in_target(Demon):
        if in_target(Demon):
            move_forward()
"""
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
    assert asked == "The hidden program asks there: `if is_there(Demon)` is true."
    assert lacking == "It has no `if`; the hidden program has."


def test_an_explanation_names_what_both_have_asked(tried):
    found = explain(tried(ASKS_AMISS), tried(MEANT), SCENES)
    own, other = found.sentences[1:3]
    value = found.sentences[0].endswith("goes on with `attack()`.")  # where the hidden one finds its Demon
    assert own == f"It asks there: `if not is_there(Demon)` is {str(not value).lower()}."
    assert other == f"The hidden program asks there: `if is_there(Demon)` is {str(value).lower()}."


def test_an_explanation_says_that_a_run_does_not_end_and_what_is_never_reached(tried):
    sentences = explain(tried(ENDLESS), tried(MEANT), SCENES).sentences
    assert "it does what was meant, and then goes on without an action" in sentences[0]
    assert sentences[1] == "It does not come to an end there."
    assert sentences[-1] == "No scene reaches its `move_forward()`."


def test_code_stands_between_backticks():
    assert list(code_spans("It has no `if`.")) == [(False, "It has no "), (True, "if"), (False, ".")]


def test_the_overview_counts_what_is_right_and_leads_to_it(page):
    (overview,) = page.all("table")
    head, *tasks, foot = overview.all("tr")
    assert [cell.text for cell in head.all("th")] == ["Task", "quick", "mended", "roundabout"]
    for row in tasks:
        passed, *ticks = (a.words for a in row.all("a", "verdict"))
        assert re.fullmatch("[0-4]", passed)
        assert ticks == ["✓", "✓"]
    assert [cell.text for cell in foot.all("td")] == ["0", "2", "2"]  # of two
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
        assert len(hidden) == (0 if answer.right else 1)
        why = next(section.all("p", "why")).words
        assert why == {
            "mended": "It is the hidden program.",
            "roundabout": "Another program than the hidden one, with the same outcome in all scenes.",
        }.get(answer.method, why)


def test_the_lead_is_escaped(page):
    assert "Drawn <by> lot." in page.text
