"""Tables and figures say what the rows say."""

import csv
import re
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rows import repaired, results_of, rows, table_of

from evaps.dsl import UserError
from evaps.metrics import Results
from evaps.report import BUDGETS, LEARNING, NOISE, REPORTS, SEARCHED, SIZES, report
from evaps.report.answers import answer_table, budget_table, noise_table
from evaps.report.comparisons import checked, differences
from evaps.report.curves import actions, candidates, complexity, learning, noise, seconds, sizes
from evaps.report.dots import Dot
from evaps.report.figure import Figure, Line
from evaps.report.repairs import edits, effects, rounds
from evaps.report.summary import gains_of_scale, lead_table, noise_costs, summary_table, summary_values
from evaps.report.table import Table
from evaps.report.tables import table_1, table_2
from evaps.report.wording import scale_note


def test_table_1_has_means_deviations_and_the_papers_figures() -> None:
    results = results_of(
        rows("lgrl", [0, None], 0),
        rows("lgrl", [0, 0], 1),
        rows("lgrl-rl", [0, None], 0),
        rows("lgrl-rl", [0, None], 1),
        rows("evaps", [0, 0], 0),
        rows("evaps", [0, 0], 1),
    )
    table = table_1(results)
    lgrl, rewarded, evaps = table.rows
    assert lgrl[0] == "LGRL"
    assert lgrl[1] == "75.0 ± 35.4"
    assert rewarded[1] == "50.0 ± 0.0 (2.2)"
    assert evaps[table.head.index("generalization @20")] == "100.0 ± 0.0 (76.8)"
    assert lgrl[-1] == "2"


def test_a_picture_shows_what_its_table_says() -> None:
    fewer = [row | {"top_k": 5} for row in rows("evaps", [0, None]) if row["rank"] < 5]
    other = [row | {"top_k": 5} for row in rows("naive", [None, None]) if row["rank"] < 5]
    results = results_of(fewer, other, [row | {"seed": 1} for row in other])
    first, second = table_1(results).picture, table_2(results).picture
    assert first
    assert second
    assert [panel.title for panel in first.panels] == ["exact", "semantic", "generalization"]
    assert first.panels[2].dots["EVAPS"] == [Dot(50, 50, 50, 48.90), Dot(50, 50, 50, 67.82), None]
    shares, gains = second.panels
    assert shares.dots["EVAPS"] == first.panels[2].dots["EVAPS"]
    gain = gains.dots["EVAPS"][0]
    assert gain
    assert (gain.value, gain.low, gain.high, gain.paper) == (50, 0, 100, pytest.approx(18.61))
    assert gains.dots["Naive"] == [None, None, None]
    svg = first.draw()["svg"].decode()
    assert len(re.findall(r'id="axes_\d+"', svg)) == 3


def test_a_table_is_written_without_its_picture_where_nothing_can_draw(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pq.write_table(table_of(rows("lgrl", [0])), tmp_path / "lgrl-0.parquet")
    whole = {path.suffix for path in report("table-1", tmp_path, tmp_path / "out")}
    assert whole == {".md", ".tex", ".csv", ".png", ".svg"}
    monkeypatch.setattr("evaps.report.drawing.can_draw", lambda: False)
    monkeypatch.setattr("evaps.report.can_draw", lambda: False)
    assert {path.suffix for path in report("table-1", tmp_path, tmp_path / "less")} == {".md", ".tex", ".csv"}
    with pytest.raises(UserError, match=r"figures need matplotlib.*evaps\[report\]"):
        report("complexity", tmp_path, tmp_path / "less")


def test_a_difference_is_claimed_only_where_its_interval_says_so() -> None:
    half = [0 if i % 2 else None for i in range(200)]
    other = [0 if i % 2 == 0 else None for i in range(200)]
    notes = " ".join(
        table_1(results_of(rows("evaps", half), rows("lgrl", other), rows("sed", [None] * 200))).notes
    )
    assert "EVAPS against LGRL (one seed): not certainly different at generalization @1" in notes
    assert "EVAPS against SED (one seed): better at generalization @1, +50.0 points" in notes


def test_every_two_methods_are_compared_where_they_can_be() -> None:
    made = [rows("lgrl", [4] * 9), rows("evaps", [0] * 9), rows("sed", [None] * 9), rows("naive", [0])]
    table = differences(results_of(*made))
    assert [row[:2] for row in table.rows] == [["EVAPS", "SED"], ["EVAPS", "LGRL"], ["SED", "LGRL"]]
    always, never = "+100.0 [+100.0, +100.0] *", "+0.0 [+0.0, +0.0]"
    assert table.rows[1][2:] == [always, never, never, "1"]
    assert table.rows[0][2:] == [always, always, always, "1"]
    assert "9 intervals" in table.notes[-1]


@pytest.mark.parametrize("rounds", [3, 5])
def test_as_many_candidates_are_looked_at_as_a_repairer_runs(rounds: int) -> None:
    looked_at = rows("lgrl", [3] * 8)
    for row in looked_at:
        row["pairs_passed"] = 5 * (row["rank"] == 3)
    repaired = rows("evaps", [None] * 8)
    repaired[0]["attempts"] = [
        {"program": "m( MOVE m)", "pairs_passed": 0, "generalization_state": False}
    ] * (1 + rounds)
    note = checked(results_of(looked_at, repaired)).notes[-1]
    assert f"Of the first {1 + rounds} candidates of LGRL" in note
    assert "first of EVAPS (one seed): better, +100.0 points" in note


def test_what_was_not_asked_for_is_left_out() -> None:
    few = [row | {"top_k": 4} for row in rows("lgrl", [0, None]) if row["rank"] < 4]
    results = results_of(few)
    assert [f"{cell}" for cell in table_1(results).rows[0][-4:-1]] == ["50.0", "", ""]
    (line,) = candidates(results).panels["all tasks"].values()
    assert list(line.x) == [1, 2, 3, 4]
    with pytest.raises(ValueError, match="not asked for 5 candidates"):
        results.difference("lgrl", "lgrl", "exact", 5)


def test_only_an_answer_that_passes_all_five_examples_is_one() -> None:
    made = rows("lgrl", [0, 0])  # two programs that generalize, of which one fails in what could be checked
    for row in made:
        row["pairs_passed"] = 5 if row["task"] else 4
    for figure in (actions(results_of(made)), seconds(results_of(made))):
        (line,) = figure.panels["answers"].values()
        assert line.y[-1] == 50


def test_a_method_of_another_package_has_its_row() -> None:
    table = table_1(results_of(rows("lgrl", [0]), rows("mean", [None]), rows("verified", [0])))
    assert [row[0] for row in table.rows] == ["LGRL", "mean"]


@pytest.mark.parametrize(
    ("seeds", "said"), [(1, "nothing about training again"), (2, "say little of how much"), (5, "")]
)
def test_a_note_says_what_so_many_seeds_are_good_for(seeds: int, said: str) -> None:
    note = scale_note(results_of(*(rows("lgrl", [0, None], seed) for seed in range(seeds))))
    assert said in note
    assert ("nothing about training" in note, "say little of how much" in note) == (seeds == 1, seeds == 2)
    assert "repairers" not in note
    assert "repairers" in scale_note(results_of(repaired("naive", [[False, True]])))


def test_table_2_shows_gains_over_naive() -> None:
    table = table_2(results_of(rows("naive", [0, None, None, None]), rows("evaps", [0, 0, None, None])))
    gain = table.head.index("gain @1")
    assert [row[gain] for row in table.rows] == ["", "+25.0 [+0.0, +75.0] (+18.6)"]


def test_rounds_follow_every_candidate_to_where_it_was_then() -> None:
    results = results_of(repaired("evaps", [[False, False, True], [False, True], [True], [True, False]]))
    line = rounds(results).panels["top-1"]["EVAPS"]
    assert list(line.y) == [50, 50, 75]


def test_effects_count_what_repair_fixed_and_what_it_broke() -> None:
    results = results_of(repaired("evaps", [[False, True], [True, False], [True], [False, False]]))
    (row,) = effects(results).rows
    assert row == ["EVAPS", "4", "25.00 %", "25.00 %", "25.00 %", "25.00 %", "50.00 %"]


def test_edits_name_the_tokens_that_were_exchanged() -> None:
    kinds, tokens = edits(results_of(repaired("evaps", [[False, True]])))
    assert kinds.rows[kinds.head.index("action") - 1][kinds.head.index("action")] == "1"
    assert sorted(row[0] for row in tokens.rows) in (
        ["MOVE_LEFT to ATTACK", "nothing to MOVE_RIGHT"],
        ["MOVE_LEFT to MOVE_RIGHT", "nothing to ATTACK"],
    )
    assert {row[2] for row in tokens.rows} == {"100.0 %"}


def test_complexity_has_a_panel_for_each_bucket_of_steps() -> None:
    made = rows("lgrl", [0, 4])
    for row in made:
        row["steps"] = 2 if row["task"] == 0 else 12
    panels = complexity(results_of(made)).panels
    assert list(panels["2 steps (1 tasks)"]["LGRL"].y) == [100] * 20
    assert list(panels["7+ steps (1 tasks)"]["LGRL"].y) == [0] * 4 + [100] * 16
    assert not panels["3 steps (0 tasks)"]


def test_an_answer_counts_from_what_it_has_cost() -> None:
    made = rows("lgrl", [0])
    made[0] |= {"pairs_passed": 5, "simulated_actions": 1000}
    line = actions(results_of(made)).panels["answers"]["LGRL"]
    assert all(y == (100 if x >= 1000 else 0) for x, y in zip(line.x, line.y, strict=True))


def test_gains_are_over_the_seeds_that_both_have() -> None:
    alone = rows("naive", [0, None, None, None])
    better = [*rows("evaps", [0, None, None, None]), *rows("evaps", [0, 0, 0, 0], seed=1)]
    table = table_2(results_of(alone, better))
    assert table.rows[1][table.head.index("generalization @1")].startswith("62.5 ± ")
    assert table.rows[1][table.head.index("gain @1")].startswith("+0.0 [+0.0, +0.0]")
    assert "over the seeds that both have" in table.notes[1]


def test_what_answers_cost_is_shown_of_searches_too_and_nothing_else_is(tmp_path: Path) -> None:
    (tmp_path / SEARCHED).mkdir()
    pq.write_table(table_of(rows("lgrl", [0])), tmp_path / "lgrl-0.parquet")
    assert report("actions", tmp_path, tmp_path / "before")  # a folder without rows is none
    pq.write_table(table_of(rows("verified", [0])), tmp_path / SEARCHED / "verified.parquet")
    report("all", tmp_path, tmp_path / "out")
    shown = {p.stem for p in (tmp_path / "out").glob("*.csv") if "verified synthesis" in p.read_text()}
    assert shown == set(BUDGETS)


def test_every_report_is_written_in_every_form(tmp_path: Path) -> None:
    folder = tmp_path / "rows"
    (folder / "curves").mkdir(parents=True)
    (folder / "noise").mkdir()
    (folder / "sizes").mkdir()
    blurred = [row | {"noise": 0.1} for row in rows("lgrl", [None, 3])]
    pq.write_table(table_of(blurred), folder / "noise" / "lgrl-0-10.parquet")
    pq.write_table(table_of(rows("lgrl", [0])), folder / "sizes" / "lgrl-0-100.parquet")
    (folder / "curves" / "lgrl-0.jsonl").write_text(
        '{"step": 1, "loss": 2}\n{"step": 2, "validation_loss": 1, "validation_solved": 0.5}\n'
    )
    pq.write_table(table_of(rows("lgrl", [0, None])), folder / "lgrl-0.parquet")
    pq.write_table(table_of(repaired("evaps", [[False, True], [True]])), folder / "evaps-0.parquet")
    written = report("all", folder, tmp_path / "out")
    names = {path.stem for path in written}
    assert names == {*REPORTS, NOISE, SIZES, LEARNING}
    texts, pictures = {".md", ".tex", ".csv"}, {".png", ".svg"}
    tables = {"differences", "frames", "checked", "effects", "edits"}
    for name in names:
        suffixes = {path.suffix for path in written if path.stem == name}
        assert suffixes == (texts if name in tables else texts | pictures)
    for path in written:
        content = path.read_bytes()
        assert content
        if path.suffix == ".png":
            assert content.startswith(b"\x89PNG")
    dots = list(csv.DictReader((tmp_path / "out" / "table-1.csv").open()))
    assert dots[0] == {
        "shown": "exact",
        "row": "LGRL",
        "of": "top-1",
        "value": "50",
        "low": "50",
        "high": "50",
        "paper": "",
    }
    assert (tmp_path / "out" / "edits.csv").read_text().startswith("table,")
    again = report("complexity", folder, tmp_path / "again")
    assert [p.read_bytes() for p in again] == [(tmp_path / "out" / p.name).read_bytes() for p in again]
    solved = learning(folder / "curves").panels["solved by the first four programs (%)"]["LGRL"]
    assert list(solved.y) == [50]
    (folder / "curves" / "evaps-0.jsonl").write_text(
        '{"step": 2, "validation_likelihood": -1, "validation_semantic": 0.25}\n'
    )
    mended = learning(folder / "curves").panels["failures that one repair mends (%)"]
    assert {name: list(line.y) for name, line in mended.items()} == {"EVAPS": [25]}


def test_trainings_of_one_method_share_its_colour_and_not_its_dashes(tmp_path: Path) -> None:
    for method, seed in (("lgrl", 0), ("lgrl", 1), ("evaps", 0)):
        (tmp_path / f"{method}-{seed}.jsonl").write_text('{"step": 99, "validation_loss": 1}\n')
    figure = learning(tmp_path)
    styles = figure.styles()
    one, two, other = (styles[name] for name in ("LGRL, seed 0", "LGRL, seed 1", "EVAPS"))
    assert one["color"] == two["color"] != other["color"]
    assert one["linestyle"] != two["linestyle"]
    (lines,) = figure.panels.values()
    assert lines["EVAPS"].x == [100], "batches, and not the number of the last one"


def test_noise_has_a_panel_for_each_share() -> None:
    figure = noise({0.2: results_of(rows("lgrl", [0, None])), 0.0: results_of(rows("lgrl", [0, 0]))})
    first = {title: lines["LGRL"].y[0] for title, lines in figure.panels.items()}
    assert first == {"0 % of the pixels invalid": 100, "20 % of the pixels invalid": 50}
    assert "paper's EVAPS up to 7.5 points" in figure.tables()[-1].markdown()


def test_a_legend_has_the_colours_of_its_lines_and_there_are_no_empty_panels() -> None:
    banded = Line([1, 2], [3, 4], [2, 3], [4, 5])
    panels = {title: {"EVAPS": banded, "LGRL": banded} for title in "abcd"} | {"e": {"LGRL": banded}}
    svg = Figure(panels, "x", "y").draw()["svg"].decode()
    legend = svg[svg.index('id="legend_1"') :]
    colours = re.findall(r'<path d="[^"]*" style="[^"]*stroke: (#\w+)[^"]*"', legend)
    assert colours == ["#1f77b4", "#ff7f0e"]
    assert len(re.findall(r'id="axes_\d+"', svg)) == len(panels)
    alone = Figure({"a": {"LGRL": banded}}, "x", "y")
    assert alone.styles()["LGRL"] == Figure(panels, "x", "y").styles()["LGRL"], "the same colour everywhere"


def test_the_ticks_of_few_points_are_these() -> None:
    few = Figure({"a": {"LGRL": Line([20_000, 50_000], [1, 2])}}, "tasks", "y", log=True)
    svg = few.draw()["svg"].decode()
    assert [name in svg for name in ("<!-- 20,000 -->", "<!-- 50,000 -->")] == [True, True]


def test_sizes_has_a_point_for_each_number_of_tasks() -> None:
    few, many = results_of(rows("lgrl", [0, None])), results_of(rows("lgrl", [0, 3]), rows("evaps", [0, 0]))
    panels = sizes({100: few, 1000: many}).panels
    assert {name: (line.x, line.y) for name, line in panels["top-1"].items()} == {
        "LGRL": ([100, 1000], (50, 50)),
        "EVAPS": ([1000], (100,)),
    }
    assert panels["top-5"]["LGRL"].y == (50, 100)
    assert panels["top-5"]["LGRL"].low == (0, 100)


def test_rows_are_told_apart_by_a_column(tmp_path: Path) -> None:
    for tasks in (1000, 100):
        table = table_of([row | {"trained_on": tasks} for row in rows("lgrl", [0])])
        pq.write_table(table, tmp_path / f"lgrl-0-{tasks}.parquet")
    assert list(Results.by_column(tmp_path, "trained_on")) == [100, 1000]
    pq.write_table(table.drop_columns(["trained_on"]), tmp_path / "old.parquet")
    with pytest.raises(UserError, match=r"old.parquet has no column 'trained_on'.*evaluate again"):
        Results.by_column(tmp_path, "trained_on")


@pytest.mark.parametrize(
    ("name", "what"),
    [("table-3", "no report 'table-3'"), (LEARNING, "METHOD-SEED"), ("table-1", "holds no rows")],
)
def test_what_cannot_be_made_is_one_line(tmp_path: Path, name: str, what: str) -> None:
    with pytest.raises(UserError, match=what):
        report(name, tmp_path, tmp_path / "out")


def test_what_is_no_file_of_rows_is_one_line(tmp_path: Path) -> None:
    (file := tmp_path / "rows.parquet").write_bytes(b"no parquet")
    with pytest.raises(UserError, match=r"rows.parquet is damaged"):
        report("table-1", file, tmp_path / "out")
    (text := tmp_path / "README.md").write_text("no rows")
    with pytest.raises(UserError, match=r"README.md is no file of rows"):
        report("table-1", text, tmp_path / "out")
    pq.write_table(pa.table({"x": [1]}), file)
    with pytest.raises(UserError, match=r"holds no rows of evaps evaluate: it has no column 'exact'"):
        report("table-1", file, tmp_path / "out")


def test_what_shows_nothing_is_not_written(tmp_path: Path) -> None:
    pq.write_table(table_of(rows("lgrl", [0])), tmp_path / "lgrl-0.parquet")
    with pytest.raises(UserError, match="holds nothing that rounds could show"):
        report("rounds", tmp_path, tmp_path / "out")
    names = {path.stem for path in report("all", tmp_path, tmp_path / "out")}
    assert names == {*REPORTS} - {"differences", "rounds", "effects", "edits"}


def test_an_ablation_without_its_base_has_no_gains() -> None:
    alone = table_2(results_of(rows("evaps", [0])))
    other_tasks = table_2(results_of(rows("naive", [0, None]), rows("evaps", [0])))
    assert alone.rows[0][alone.head.index("gain @1")] == ""
    assert other_tasks.rows[1][other_tasks.head.index("gain @1")] == ""


def test_learning_tells_seeds_apart_and_leaves_out_who_was_not_validated(tmp_path: Path) -> None:
    row = '{"step": 1, "validation_loss": 2, "validation_solved": 0.5}\n'
    for name in ("lgrl-0", "lgrl-1", "evaps-s-0"):
        (tmp_path / f"{name}.jsonl").write_text(row)
    (tmp_path / "sed-0.jsonl").write_text('{"step": 1, "loss": 2}\n')
    made = learning(tmp_path)
    assert list(made.panels["loss of a token"]) == ["EVAPS+S", "LGRL, seed 0", "LGRL, seed 1"]
    assert not made.alike, "a loss and a share have nothing in common"


def test_signs_that_latex_knows_otherwise_are_escaped() -> None:
    text = Table("a_b", ["x", "y %"], [["1 ± 2", "-3 top-1"], [r"\x{y}~", "[+4.5]"]]).latex()
    assert r"$-$3 top-1" in text
    assert r"\textbackslash{}x\{y\}\textasciitilde{} & [$+$4.5]" in text
    assert r"a\_b" in text
    assert r"y \%" in text
    assert r"1 $\pm$ 2" in text
    assert "resizebox" not in text
    assert r"\resizebox{\textwidth}" in Table("a", "abcdefg", [list("1234567")]).latex()


def test_what_noise_costs_is_told_on_the_same_tasks_and_in_the_same_precision(tmp_path: Path) -> None:
    def write(share: float, ranks: list[int | None], precision: str = "float32") -> None:
        said = {"noise": share, "machine": f"x86_64, 2 cores, {precision}"}
        pq.write_table(table_of([row | said for row in rows("lgrl", ranks)]), tmp_path / f"{share}.parquet")

    write(0.2, [0, None])
    with pytest.raises(UserError, match="no rows of lgrl without noise"):
        noise_costs(tmp_path)
    write(0.0, [0, 0])
    (line,) = noise_costs(tmp_path).splitlines()[2:]
    assert line.startswith("| LGRL | 20 % | 2 | 50.0 (-50.0 [-100.0, +0.0]) |")
    for share, ranks, precision in ((0.0, [0, 0], "bfloat16"), (0.0, [0, 0, 0], "float32")):
        write(share, ranks, precision)
        with pytest.raises(UserError, match="differ in tasks or in precision"):
            noise_costs(tmp_path)


def test_what_a_larger_scale_gains_is_told_on_the_same_tasks() -> None:
    small = results_of(rows("lgrl", [0, None]), rows("evaps", [None, None]))
    large = results_of([row | {"trained_on": 100_000} for row in rows("lgrl", [0, 0])])
    before, after = gains_of_scale(small, large).splitlines()[2:]
    assert before == "| LGRL | 100 | 50.0 | 50.0 | 50.0 |"
    assert after.startswith("| LGRL | 100,000 | 100.0 (+50.0 [+0.0, +100.0]) |")
    with pytest.raises(UserError, match="differ in tasks or in precision"):
        gains_of_scale(small, results_of(rows("lgrl", [0, 0, 0])))


def test_a_figure_is_a_table_too() -> None:
    figure = complexity(results_of(rows("lgrl", [0, None, None, None])))
    (table,) = figure.tables()
    assert (table.head[0], table.head[-1]) == ("candidates", "20")
    assert table.rows == [["LGRL", *["25"] * 8]]
    lines = figure.csv().splitlines()
    assert lines[0] == "panel,line,candidates,generalization (%),low,high"
    assert len(lines) == 1 + 20


def test_a_table_by_noise_has_a_line_for_each_share(tmp_path: Path) -> None:
    for share, ranks in ((0.2, [None, 0]), (0.0, [0, 0])):
        made = [row | {"noise": share, "pairs_passed": 5 * row["exact"]} for row in rows("verified", ranks)]
        pq.write_table(table_of(made), tmp_path / f"{share}.parquet")
    assert noise_table(tmp_path, "verified").splitlines()[2:] == [
        "| 0 % | 2 | 100.0 % | 100.0 % | 1.00 |",
        "| 20 % | 2 | 50.0 % | 50.0 % | 1.00 |",
    ]


def test_a_table_by_budgets_counts_what_was_found_within_them(tmp_path: Path) -> None:
    costs = (200, 900, 900, 20_000)
    answers = [row for row in rows("verified", [0, 0, None, 0]) if row["rank"] == 0]
    for row in answers:
        row |= {"simulated_actions": costs[row["task"]], "pairs_passed": 5 * row["exact"], "seconds": 2.0}
    head, _, line = budget_table({"large": answers}, (300, 1_000), (1.0, 10.0)).splitlines()
    assert head == "| within | tasks | 300 actions | 1,000 actions | 1 s | 10 s |"
    assert line == "| large | 4 | 25.0 / 25.0 | 50.0 / 50.0 | 0.0 / 0.0 | 75.0 / 75.0 |"


def test_a_short_table_has_one_row_for_all_seeds_of_a_method(tmp_path: Path) -> None:
    pq.write_table(table_of(rows("lgrl", [0, None], seed=0)), tmp_path / "lgrl-0.parquet")
    pq.write_table(table_of(rows("lgrl", [0, 3], seed=1)), tmp_path / "lgrl-1.parquet")
    pq.write_table(table_of(rows("naive", [None, None])), tmp_path / "naive-0.parquet")
    head, _, lgrl, naive = summary_table(Results.read(tmp_path)).splitlines()
    assert head.split(" | ")[:3] == ["| method", "seeds", "exact"]
    assert lgrl.split(" | ")[:3] == ["| LGRL", "2", "50.0 / 75.0 / 75.0"]
    assert naive.split(" | ")[:2] == ["| Naive", "1"]
    values = summary_values(Results.read(tmp_path))[0]
    assert (values["method"], values["tasks"], values["seeds"], values["exact@5"]) == ("lgrl", 2, 2, 0.75)
    pooled = answer_table(Results.read(tmp_path)).splitlines()[2].split(" | ")
    assert (pooled[0], pooled[1], pooled[2], pooled[4]) == ("| LGRL", "2", "2", "50.0 %")


def test_short_tables_begin_with_the_best(tmp_path: Path) -> None:
    for method, ranks in (("lgrl", [None, 0]), ("naive", [None, None]), ("evaps", [0, 0])):
        pq.write_table(table_of(rows(method, ranks)), tmp_path / f"{method}.parquet")
    for table in (summary_table(Results.read(tmp_path)), answer_table(Results.read(tmp_path))):
        assert [line.split(" | ")[0] for line in table.splitlines()[2:]] == ["| EVAPS", "| LGRL", "| Naive"]


def test_a_lead_is_bold_only_where_its_interval_is_clear_of_zero() -> None:
    half = [0, None]
    others = (rows("lgrl", [None] * 8), rows("sed", half * 4), rows("naive", [*[0] * 7, None]))
    elsewhere = rows("transformer", [None] * 9)
    table = lead_table(results_of(rows("evaps", [0] * 8), *others, elsewhere), "evaps", (1,))
    assert table.splitlines()[0] == "| EVAPS against | seeds | @1 |"
    assert [line.split(" | ")[0] for line in table.splitlines()[2:]] == ["| Naive", "| SED", "| LGRL"]
    naive, sed, lgrl = (line.split(" | ")[2] for line in table.splitlines()[2:])
    assert naive == "+12.5 [+0.0, +37.5] |"
    assert sed.startswith("**+50.0 [+")
    assert lgrl == "**+100.0 [+100.0, +100.0]** |"


def test_seconds_are_told_of_the_usual_machine_alone() -> None:
    slow = [row | {"machine": "another", "seconds": 9.0} for row in rows("lgrl", [0], seed=1)]
    alone = [row | {"machine": "another", "seconds": 7.0} for row in rows("sed", [0])]
    results = results_of(rows("lgrl", [0]), slow, rows("naive", [0]), alone)
    values = {row["method"]: (row["seconds"], row["seeds"]) for row in summary_values(results)}
    assert values == {"lgrl": (1.0, 2), "naive": (1.0, 1), "sed": (7.0, 1)}


def test_a_method_judged_on_fewer_tasks_says_so() -> None:
    figure = actions(results_of(rows("lgrl", [0, 0]), rows("blind", [0])))
    assert list(figure.panels["answers"]) == [
        "LGRL",
        "blind: draws from the prior until one passes (1 tasks)",
    ]


def test_a_damaged_curve_is_named(tmp_path: Path) -> None:
    (tmp_path / "curves").mkdir()
    (tmp_path / "curves" / "lgrl-0.jsonl").write_text('{"step": 9, "validation_loss": 0.5}\n{bad\n')
    with pytest.raises(
        UserError, match=r"curves/lgrl-0.jsonl has no JSON value in line 2; make the file again"
    ):
        report("learning", tmp_path, tmp_path / "out")


@pytest.mark.parametrize("name", ["noise", "sizes", "learning"])
def test_a_report_of_more_than_rows_needs_their_folder(name: str, tmp_path: Path) -> None:
    pq.write_table(table_of(rows("lgrl", [0])), tmp_path / "lgrl-0.parquet")
    with pytest.raises(
        UserError, match=rf"{name} needs the folder of rows that has (noise|sizes|curves)/ in it"
    ):
        report(name, tmp_path / "lgrl-0.parquet", tmp_path / "out")
