import re

import pytest
from html_tree import parse

from evaps.viewer.page import render_page, write_page


@pytest.fixture(scope="module")
def html(repaired, at_once, unsolved):
    return render_page([repaired, at_once, unsolved])


@pytest.fixture(scope="module")
def page(html):
    return parse(html)


@pytest.fixture(scope="module")
def articles(page):
    return list(page.all("article"))


def test_the_page_is_self_contained(html, page):
    assert not re.search(r"https?://", html)
    assert [e.attributes["href"] for e in page.all("link")] == ["data:,"]
    assert not [e for e in page.all("script") if "src" in e.attributes]
    assert len(html) < 1_500_000


def test_ids_are_unique_and_references_lead_somewhere(page):
    everything = [e for tag in ("article", "h2", "input", "image") for e in page.all(tag)]
    ids = [e.attributes["id"] for e in everything]
    assert len(ids) == len(set(ids))
    links = [e.attributes["href"] for tag in ("use", "a") for e in page.all(tag)]
    assert {link.removeprefix("#") for link in links} <= set(ids)
    assert {label.attributes["for"] for label in page.all("label")} <= set(ids)


def test_names_are_escaped(html, page):
    assert "turn and shoot <b>&" in [e.text for e in page.all("h2")]
    assert not list(page.all("b", ""))
    assert "<b>&" not in html


def test_the_index_leads_to_every_task(page):
    (index,) = page.all("nav")
    assert index.words.startswith("2 of 3 solved")
    entries = [(a.attributes["href"], next(a.all("span", "verdict")).text) for a in index.all("a")]
    assert entries == [("#task-1", "Solved"), ("#task-2", "Solved"), ("#task-3", "Not solved")]


def test_the_verdicts(articles):
    verdicts = [next(article.all("dd", "verdict")).text for article in articles]
    pairs = [next(article.all("span", "meter")).words for article in articles]
    assert verdicts == ["Solved", "Solved", "Not solved"]
    assert pairs == ["5 of 5", "5 of 5", "3 of 5"]


def test_programs_stand_there_in_both_forms(articles, repaired):
    shown = [pre.text for pre in articles[0].all("pre")]
    best = repaired.solution.candidates[0]
    others = [c.program for c in repaired.solution.candidates[1:]]
    rest = [best.attempts[0].program, best.attempts[1].program, *others]
    assert shown == [program.to_python() for program in (best.program, *rest)]
    assert next(articles[0].all("code", "tokens")).text == str(best.program)


def test_edits_are_struck_and_inserted(articles):
    first, second = articles[0].all("p", "diff")
    deleted = ["WHILE c( INTARGET Revenant c) w( MOVE_LEFT w)", "TURN_RIGHT"]
    assert [e.text for e in first.all("del")][:2] == deleted
    assert [e.text for e in first.all("ins")] == ["TURN_LEFT"]
    assert [e.text for e in second.all("del")] == []
    assert [e.text for e in second.all("ins")] == ["REPEAT R=2 r(", "r)"]
    heads = [li.words for li in articles[0].all("small") if "→" in li.text]
    assert heads == ["1 of 5 → 3 of 5", "3 of 5 → 5 of 5"]


def test_what_was_right_at_once_has_no_repair(articles):
    assert "nothing had to be repaired" in articles[1].words
    assert not list(articles[1].all("p", "diff"))
    assert not list(articles[1].all("table"))


def test_each_example_says_whether_it_passes(articles, unsolved):
    (examples,) = articles[2].all("ol", "examples")
    marks = [mark.text for mark in examples.all("span", "mark")]
    passed = unsolved.solution.candidates[0].final.passed
    assert passed == (False, True, True, True, False)
    assert marks == ["passes" if p else "fails" for p in passed]


def test_views_around_segments(articles, repaired):
    tables = list(articles[0].all("table"))
    proposal = repaired.solution.candidates[0].attempts[0]
    assert len(tables) == len(repaired.task.examples)
    for table, trace in zip(tables, proposal.traces, strict=True):
        rows = list(table.all("tr"))[1:-1]
        lines = [next(row.all("code")).text.split("  # ")[0] for row in rows]
        assert lines == [line for _, line in trace.program.python_lines]
        never = [row for row in rows if "never executed" in row.text]
        assert len(never) == len(trace.program.segments) - len(trace.segment_times)


def test_filmstrips_have_every_view_action_and_condition(articles, repaired):
    strips = list(articles[0].all("ol", "strip"))
    for strip, trace in zip(strips, repaired.solution.candidates[0].final.traces, strict=True):
        assert len(list(strip.all("use"))) == len(trace.observations) + 1  # the goal
        assert [e.text for e in strip.all("span", "step")] == [f"{a.lower()}()" for a in trace.actions]
        (check,) = strip.all("ul", "checks")
        assert check.words in ("if is_there(Demon) true", "if is_there(Demon) false")
        assert "the same view" in strip.text


def test_every_view_is_there_once_and_has_a_text(page, articles):
    pictures = [image.attributes["href"] for image in page.all("image")]
    assert len(pictures) == len(set(pictures))
    assert all(picture.startswith("data:image/png;base64,") for picture in pictures)
    assert {use.attributes["href"] for use in page.all("use")} == {
        f"#{image.attributes['id']}" for image in page.all("image")
    }
    views = [svg for article in articles for svg in article.all("svg")]
    assert len(views) > 2 * len(pictures)
    assert all(svg.attributes["role"] == "img" and svg.attributes["aria-label"] for svg in views)


def test_a_page_is_written_whole(tmp_path, at_once):
    path = tmp_path / "new" / "page.html"
    write_page(path, [at_once])
    parse(path.read_text(encoding="utf-8"))
    assert [p.name for p in path.parent.iterdir()] == ["page.html"]
    assert not list(parse(path.read_text(encoding="utf-8")).all("nav"))


def test_a_page_without_tasks():
    assert "no tasks" in parse(render_page([])).text
