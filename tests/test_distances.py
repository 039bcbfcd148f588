"""Candidates by how many tokens they are from the gold program."""

from pathlib import Path
from typing import Any

from evaps.metrics import MethodResults
from recipes.distances import mended, table_of
from recipes.result import read_result

ROOT = Path(__file__).parents[1]

GOLD = ["DEF", "run", "m(", "MOVE_LEFT", "TURN_LEFT", "m)"]


def row(*attempts: tuple[str, bool]) -> dict[str, Any]:
    made = [{"program": f"DEF run m( {body} m)", "generalization_state": right} for body, right in attempts]
    return {"task": 7, "rank": 0, "attempts": made}


def test_candidates_are_counted_by_distance_and_by_round() -> None:
    rows = [
        row(("MOVE_LEFT TURN_LEFT", True)),  # right already
        row(("MOVE_LEFT", False), ("MOVE_LEFT TURN_LEFT", True)),
        row(("MOVE_LEFT", False), ("MOVE_RIGHT", False), ("MOVE_LEFT TURN_LEFT", True)),
        row(("ATTACK MOVE_RIGHT TURN_RIGHT", False)),
    ]
    found = mended([MethodResults("evaps", 0, {7: rows})], {7: GOLD})
    assert [bucket["candidates"] for bucket in found] == [2, 0, 1, 0, 0]
    assert (found[0]["one round"], found[0]["all rounds"]) == (50.0, 100.0)
    assert (found[2]["one round"], found[2]["all rounds"]) == (0.0, 0.0)
    table = table_of({"evaps": found})
    assert table.head == ["method", "1", "2", "3 to 4", "5 to 8", "9 and more"]
    assert table.rows[0][:2] == ["EVAPS", "50.0 / 100.0"]


def test_docs_show_what_was_counted() -> None:
    found = read_result(ROOT / "results/small/distances.json")
    assert table_of(found).markdown().strip() in (ROOT / "docs/findings.md").read_text()
