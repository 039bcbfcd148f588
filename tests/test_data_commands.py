"""From a seed to frames and traces on the command line, on local processes and on Ray, and what is in it."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

EVAPS = str(Path(sys.executable).with_name("evaps"))
TASKS = 5

pytestmark = pytest.mark.slow


def evaps(*arguments: object, status: int = 0) -> str:
    command = [EVAPS, *map(str, arguments)]
    # Ray starts slowly where others use the cores, too.
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == status, done.stderr
    return done.stdout + done.stderr


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small data set; a part is as long as usual, so 100 tasks are made."""
    path = tmp_path_factory.mktemp("data") / "set"
    assert f"{TASKS} tasks with distinct programs" in evaps("generate", path, "--tasks", TASKS, "--seed", 4)
    return path


def test_ray_makes_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    evaps("generate", other, "--tasks", TASKS, "--seed", 4, "--engine", "ray", "--workers", 1)
    assert contents(other) == contents(folder)


def test_frames_and_traces_are_rendered(folder: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    evaps("generate", bare, "--tasks", TASKS, "--seed", 4, "--no-frames")
    assert sorted(p.name for p in bare.iterdir()) == ["dataset.json", "parts", "tasks.parquet"]
    assert f"{TASKS} tasks with frames" in evaps("render", bare)
    assert contents(bare) == contents(folder)
    assert f"{TASKS} tasks with traces" in evaps("render", bare, "--traces")
    assert pq.read_metadata(bare / "traces" / "traces-00000.parquet").num_rows == 100


def test_the_page_about_data_sets_runs(folder: Path, tmp_path: Path) -> None:
    """Its Python, word by word."""
    blocks = re.findall(r"```python\n(.*?)```", Path("docs/data.md").read_text(), re.DOTALL)
    assert len(blocks) == 3
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "small").symlink_to(folder)
    for block in blocks:
        subprocess.run([sys.executable, "-c", block], cwd=tmp_path, check=True, timeout=120)


def test_info_counts_and_checks(folder: Path) -> None:
    found = json.loads(evaps("data", "info", folder, "--json", "--check", 3))
    assert sum(found["splits"].values()) == TASKS
    assert (found["checked"], found["faults"]) == (3, [])
    shown = evaps("data", "info", folder, "--check", 2)
    assert "2 tasks run again, 0 of them differ" in shown
    assert "distinct programs" in shown


def test_info_fails_where_a_task_does_not_hold(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "dataset.json").write_bytes((folder / "dataset.json").read_bytes())
    table = pq.read_table(folder / "tasks.parquet")
    digests = [row[::-1] for row in table["last_digests"].to_pylist()]
    at = table.schema.get_field_index("last_digests")
    pq.write_table(table.set_column(at, table.schema.field(at), [digests]), tmp_path / "tasks.parquet")
    assert "does not run as it did" in evaps("data", "info", tmp_path, "--check", 1, status=2)


def test_bench_measures_everything(tmp_path: Path) -> None:
    rows = tmp_path / "bench.jsonl"
    evaps("bench", "--seconds", 0.1, "--batch", 2, "--out", rows)
    figures = {row["name"]: row for row in map(json.loads, rows.read_text().splitlines())}
    assert len(figures) > 15
    assert all(row["value"] > 0 and row["machine"] and row["commit"] for row in figures.values())
    overhead = figures["execution / bare engine, view and perceptions after each"]["value"]
    assert 0.8 < overhead < 2, "the bar is 1.15; this machine may be busy with other tests"
    assert figures["candidate checking, plain / memoised: engine actions"]["value"] > 1.5
