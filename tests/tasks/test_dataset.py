"""Data sets: the same on any number of workers, resumable, and open to any reader of Parquet."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import datasets
import pandas
import psutil
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evaps.dsl import Program
from evaps.robots.base import state_match
from evaps.robots.frames import digest
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import Workers
from evaps.synthesis.solution import attempt
from evaps.tasks.build import generate
from evaps.tasks.dataset import Dataset, split_of, task_parts
from evaps.tasks.frames import unpack_frames
from evaps.tasks.info import check, summarize
from evaps.tasks.manifest import DatasetError
from evaps.tasks.render import render

TASKS, PART, SEED = 18, 6, 7


def files(folder: Path) -> dict[str, str]:
    """A check sum for every file."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in paths}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set in three parts; tests that change it make a copy."""
    path = tmp_path_factory.mktemp("data") / "set"
    assert generate(path, TASKS, SEED, workers=Workers(2), part=PART) == TASKS
    return path


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def test_one_worker_writes_the_same_bytes_as_two(folder: Path, tmp_path: Path) -> None:
    generate(tmp_path / "other", TASKS, SEED, workers=Workers(1), part=PART)
    names = [f"{room}-0000{n}.parquet" for n in range(3) for room in ("frames/frames", "parts/tasks")]
    assert sorted(files(folder)) == sorted(["dataset.json", "tasks.parquet", *names])
    assert files(tmp_path / "other") == files(folder)


def test_a_part_that_is_missing_is_made_again(folder: Path, copy: Path) -> None:
    (copy / "parts" / "tasks-00001.parquet").unlink()
    (copy / "frames" / "frames-00001.parquet").unlink()
    (copy / "tasks.parquet").unlink()
    kept = copy / "parts" / "tasks-00002.parquet"
    before = kept.stat().st_mtime_ns
    with pytest.raises(DatasetError, match="no complete data set; make one with: evaps generate"):
        Dataset(copy)
    assert generate(copy, TASKS, SEED, workers=Workers(0), part=PART) == TASKS
    assert files(copy) == files(folder)
    assert kept.stat().st_mtime_ns == before


def test_shards_add_up_to_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    for share in (1, 2, 3):
        shard = tmp_path / f"shard{share}"
        generate(shard, TASKS + 1, SEED, workers=Workers(0), part=PART, shard=(share, 3))
        assert not (shard / "tasks.parquet").exists()
        shutil.copytree(shard, whole, dirs_exist_ok=True)
    assert len(list(whole.glob("parts/*"))) == 6  # three more than are needed
    (whole / "dataset.json").unlink()
    shutil.copy(folder / "dataset.json", whole)
    generate(whole, TASKS, SEED, workers=Workers(0), part=PART)
    assert files(whole) == files(folder)


def test_frames_that_were_left_out_are_rendered_to_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    generate(bare, TASKS, SEED, workers=Workers(0), part=PART, frames=False)
    assert not (bare / "frames").exists()
    with pytest.raises(DatasetError, match="evaps render"):
        list(Dataset(bare).frames([0]))
    assert render(bare, workers=Workers(1)) == TASKS
    assert files(bare) == files(folder)


def test_frames_that_were_left_out_are_made_when_they_are_wanted(folder: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    generate(bare, TASKS, SEED, workers=Workers(0), part=PART, frames=False)
    generate(bare, TASKS, SEED, workers=Workers(0), part=PART)
    assert files(bare) == files(folder)


def test_the_table_alone_is_enough_to_render(folder: Path, tmp_path: Path) -> None:
    for name in ("dataset.json", "tasks.parquet"):
        shutil.copy(folder / name, tmp_path)
    assert render(tmp_path, Workers(0)) == TASKS
    assert files(tmp_path) == {k: v for k, v in files(folder).items() if not k.startswith("parts")}


def test_frames_of_a_smaller_set_are_not_taken_for_all(folder: Path, copy: Path) -> None:
    path = copy / "frames" / "frames-00001.parquet"
    pq.write_table(pq.read_table(path).slice(0, 2), path)
    with pytest.raises(DatasetError, match=f"frames of {PART - 2} tasks are missing; .* evaps render"):
        list(Dataset(copy).frames(range(TASKS)))
    (copy / "frames" / "frames-00002.parquet").write_bytes(b"damaged")
    assert render(copy, Workers(0)) == TASKS
    assert files(copy) == files(folder)


def test_a_check_reads_the_frames(copy: Path, robot: MemoRobot) -> None:
    path = copy / "frames" / "frames-00000.parquet"
    table = pq.read_table(path)
    shifted = table["frames"].to_pylist()
    column = pa.array([shifted[-1], *shifted[:-1]])
    pq.write_table(table.set_column(1, table.schema.field(1), column), path)
    assert check(Dataset(copy), 1, robot) == ["the frames of task 0 are not its own; delete and render them"]


def test_there_is_nothing_to_render_in_a_folder_without_tasks(folder: Path, tmp_path: Path) -> None:
    shutil.copy(folder / "dataset.json", tmp_path)
    with pytest.raises(DatasetError, match="has no tasks yet; make them with: evaps generate"):
        render(tmp_path, Workers(0))


def test_a_larger_set_that_is_not_complete_yet_is_not_opened(copy: Path) -> None:
    identity = json.loads((copy / "dataset.json").read_text())
    (copy / "dataset.json").write_text(json.dumps({**identity, "tasks": TASKS + 1}))  # and then interrupted
    with pytest.raises(DatasetError, match=f"has {TASKS} of {TASKS + 1} tasks; go on with: evaps generate"):
        Dataset(copy)


@pytest.mark.parametrize("name", ["tasks.parquet", "frames/frames-00000.parquet"])
def test_a_damaged_file_is_one_line(copy: Path, name: str) -> None:
    path = copy / name
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(DatasetError, match=f"{path.name} is damaged") as error:
        list(Dataset(copy).frames([0]))
    assert "\n" not in str(error.value)


def test_a_damaged_part_is_one_line(copy: Path) -> None:
    path = copy / "parts" / "tasks-00001.parquet"
    path.write_bytes(b"")
    with pytest.raises(DatasetError, match=f"{path.name} is damaged"):
        generate(copy, TASKS, SEED, workers=Workers(0), part=PART)


def test_fewer_tasks_than_there_are_do_not_throw_any_away(copy: Path) -> None:
    before = files(copy)
    with pytest.raises(DatasetError, match=f"is for {TASKS} tasks"):
        generate(copy, TASKS - 1, SEED, workers=Workers(0), part=PART)
    assert files(copy) == before


def test_where_a_program_comes_twice_one_more_is_made(folder: Path, copy: Path) -> None:
    path = copy / "parts" / "tasks-00002.parquet"
    table = pq.read_table(path)
    first = pq.read_table(copy / "parts" / "tasks-00000.parquet")["program"][0].as_py()
    twice = pa.array([first, *table["program"].to_pylist()[1:]])
    at = table.schema.get_field_index("program")
    pq.write_table(table.set_column(at, "program", twice), path)
    assert generate(copy, TASKS, SEED, workers=Workers(0), part=PART) == TASKS + PART
    rows, before = Dataset(copy).rows, Dataset(folder).rows
    assert rows.column("index") == [i for i in range(TASKS + 1) if i != 2 * PART]
    assert rows[: 2 * PART] == before[: 2 * PART]


def test_programs_are_distinct_and_in_the_split_of_their_hash(folder: Path) -> None:
    data = Dataset(folder)
    assert len(data) == len(set(data.rows.column("program"))) == TASKS
    assert data.rows.column("index") == list(range(TASKS))
    for row in data.rows:
        program = Program.parse(row["program"])
        assert row["split"] == split_of(program) == split_of(row["program"])
    splits = [data.split(name) for name in ("train", "validation", "test")]
    assert sorted(p for split in splits for p in split) == list(range(TASKS))
    assert data.split("train")


def test_splits_have_their_shares() -> None:
    found = [split_of(f"program {i}") for i in range(10_000)]
    shares = {name: found.count(name) / len(found) for name in ("train", "validation", "test")}
    assert shares == pytest.approx({"train": 0.7, "validation": 0.2, "test": 0.1}, abs=0.015)
    assert split_of("DEF run m( ATTACK m)") == "validation", "another hash would mix the splits"


def test_any_reader_of_parquet_can_open_it(folder: Path) -> None:
    tasks = pq.read_table(folder / "tasks.parquet")
    columns = ["index", "program", "split", "steps", "scenes", "states", "actions"]
    assert tasks.column_names == [*columns, "first_digests", "last_digests"]
    assert tasks.num_rows == TASKS
    row: dict[str, Any] = tasks.to_pylist()[0]
    assert list(row["scenes"][0]["robot"]) == ["x", "y", "heading"]
    assert {len(row[key]) for key in ("scenes", "states", "actions", "first_digests", "last_digests")} == {6}
    assert row["steps"] == max(len(actions.split()) for actions in row["actions"])
    identity = json.loads((folder / "dataset.json").read_text())
    assert (identity["seed"], identity["tasks"], identity["part"]) == (SEED, TASKS, PART)


def test_pandas_and_datasets_open_it_without_our_code(folder: Path) -> None:
    frame = pandas.read_parquet(folder / "tasks.parquet")
    assert (len(frame), frame["program"].nunique()) == (TASKS, TASKS)
    assert list(frame["scenes"][0][0]["robot"]) == ["x", "y", "heading"]
    found = datasets.Dataset.from_parquet(
        str(folder / "tasks.parquet"), cache_dir=str(folder.parent / "cache"), keep_in_memory=True
    )
    assert found["program"] == frame["program"].tolist()
    assert found[3]["last_digests"] == list(frame["last_digests"][3])


def test_frames_are_what_the_digests_say(folder: Path) -> None:
    data = Dataset(folder)
    seen = 0
    for position, packed in data.frames(range(TASKS)):
        row = data.rows[position]
        frames = unpack_frames(packed)
        assert [digest(frame) for frame in frames] == [*row["first_digests"], *row["last_digests"]]
        seen += 1
    assert seen == TASKS


def test_a_task_takes_little_room(folder: Path) -> None:
    sizes = [path.stat().st_size for path in folder.glob("parts/*")]
    assert sum(sizes) / TASKS < 4_000, "with the overhead of parts of six; 600 bytes in parts of a hundred"
    frames = [path.stat().st_size for path in folder.glob("frames/*")]
    assert sum(frames) / TASKS < 100_000


def test_traces_show_every_step(folder: Path, copy: Path) -> None:
    assert render(copy, Workers(0), traces=True) == TASKS
    data = Dataset(copy)
    for number in range(TASKS // PART):
        for trace in pq.read_table(copy / "traces" / f"traces-{number:05d}.parquet").to_pylist():
            row = data.rows[trace["index"]]
            for example, actions in enumerate(row["actions"]):
                views = unpack_frames(trace["observations"][example])
                assert len(views) == len(trace["perceptions"][example]) == len(actions.split()) + 1
                assert digest(views[0]) == row["first_digests"][example]
                assert digest(views[-1]) == row["last_digests"][example]
    before = files(copy)
    assert render(copy, Workers(0), traces=True) == TASKS
    assert files(copy) == before


def test_rows_that_do_not_hold_are_found(folder: Path, copy: Path, robot: MemoRobot) -> None:
    assert check(Dataset(folder), 5, robot) == []
    path = copy / "tasks.parquet"
    table = pq.read_table(path)
    rows = table.to_pylist()
    rows[0]["last_digests"][2] = b"0" * 16
    rows[-1]["states"][0]["ammo"] += 1
    pq.write_table(pa.Table.from_pylist(rows, table.schema), path)
    faults = check(Dataset(copy), TASKS, robot)
    assert faults == [
        "task 0 does not run as it did; generate the data set again",
        f"task {TASKS - 1} does not end as it did",
    ]


def test_a_summary_counts_what_is_there(folder: Path) -> None:
    data = Dataset(folder)
    summary = summarize(data)
    assert sum(summary.splits.values()) == sum(summary.buckets.values()) == TASKS
    loops = sum("WHILE" in program.split() for program in data.rows.column("program"))
    assert summary.control["WHILE"] == loops
    assert summary.steps[0] >= 2
    assert summary.tokens[2] <= 32
    assert set(summary.bytes_per_task) == {"tasks.parquet", "frames"}


GENERATE = """
import sys
from pathlib import Path
from evaps.robots.workers import Workers
from evaps.tasks.build import generate

if __name__ == "__main__":
    folder, tasks, seed, workers, part = sys.argv[1:]
    generate(Path(folder), int(tasks), int(seed), Workers(int(workers)), int(part))
"""


@pytest.mark.parametrize("victim", ["worker", "command"])
def test_what_was_killed_half_way_becomes_the_same_bytes(folder: Path, tmp_path: Path, victim: str) -> None:
    script, target = tmp_path / "script.py", tmp_path / "set"
    script.write_text(GENERATE)
    command = [sys.executable, str(script), str(target), *map(str, (TASKS, SEED, 2, PART))]
    job = subprocess.Popen(command)
    until = time.monotonic() + 60
    while not list(target.glob("parts/*.parquet")) and time.monotonic() < until:
        time.sleep(0.01)
    assert job.poll() is None, "it is too late to kill it"
    if victim == "command":
        job.kill()
        job.wait(60)
        assert not (target / "tasks.parquet").exists()
        subprocess.run(command, check=True, timeout=120)
    else:
        os.kill(next(iter(spawned_by(job.pid))), signal.SIGKILL)
        assert job.wait(120) == 0
    assert files(target) == files(folder)


def spawned_by(pid: int) -> set[int]:
    """Workers below a process: not the one that only tracks resources."""
    children = psutil.Process(pid).children()
    return {child.pid for child in children if any("spawn_main" in word for word in child.cmdline())}


def test_gold_tasks_are_solved_by_their_programs(folder: Path, robot: MemoRobot) -> None:
    data = Dataset(folder)
    positions = [0, PART + 1, TASKS - 1]  # one of each part
    (part,) = (part.loaded(data) for part in task_parts(folder, data, positions, size=10))
    golds = list(part.golds())
    assert [gold.name for gold in golds] == [f"task-{p}" for p in positions]
    for position, gold in zip(positions, golds, strict=True):
        assert str(gold.program) == data.rows[position]["program"]
        assert gold.steps == data.rows[position]["steps"]
        assert attempt(gold.program, gold.task, robot).solved
        test = gold.outcomes[5]
        robot.reset(test.scene)
        for action in data.rows[position]["actions"][5].split():
            robot.act(action)
        assert state_match(robot.state(), test.state)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": SEED + 1}, f"has seed {SEED}, not {SEED + 1}; use another folder"),
        ({"part": 100}, f"has part {PART}, not 100; use another folder"),
    ],
)
def test_another_data_set_is_refused_and_left_alone(
    folder: Path, changes: dict[str, int], message: str
) -> None:
    before = files(folder)
    with pytest.raises(DatasetError, match=message):
        generate(folder, **{"tasks": TASKS, "seed": SEED, "workers": 0, "part": PART, **changes})
    assert files(folder) == before


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("notes.txt", "mine", "is not empty and no data set; choose another folder"),
        ("dataset.json", "{", "is not JSON: line 1, column 2"),
        ("dataset.json", "[]", "expected an object with the seed"),
        ("dataset.json", "{}", "has format None, not 2"),
        ("dataset.json", '{"format": 2, "robot": "karel"}', "has robot karel, not doom"),
        ("dataset.json", '{"tasks": "x"}', "tasks must be a whole number, not 'x'"),
    ],
)
def test_a_foreign_folder_is_refused_and_left_alone(
    tmp_path: Path, name: str, content: str, message: str
) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(DatasetError, match=message):
        generate(tmp_path, TASKS, SEED, workers=Workers(0))
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(name, content)]
