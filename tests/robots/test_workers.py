"""Robots in several processes: the same results, engines that die, and Ctrl-C."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import count, islice
from pathlib import Path
from typing import Any

import pytest
from robot_jobs import die_of_one, die_once, fail, lose_the_engine_once, random_run

from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.base import EngineError
from evaps.robots.workers import RobotConfig, Workers, robot_map

Engines = Callable[[int], set[int]]
ITEMS = range(12)
CONFIG = RobotConfig(PERCEPTION_KEYS)


@pytest.fixture(scope="module")
def expected() -> dict[int, Any]:
    """What this process makes of the items."""
    return dict(robot_map(random_run, ITEMS, Workers(0), CONFIG))


@pytest.mark.parametrize("workers", [1, 2])
def test_the_number_of_workers_does_not_matter(expected: dict[int, Any], workers: int) -> None:
    results = list(robot_map(random_run, ITEMS, Workers(workers), CONFIG))
    assert sorted(item for item, _ in results) == list(ITEMS)
    assert dict(results) == expected


def test_items_know_nothing_of_one_another(expected: dict[int, Any]) -> None:
    again = list(robot_map(random_run, [3, 3, 0, 3], Workers(0), CONFIG))
    assert again == [(item, expected[item]) for item in (3, 3, 0, 3)]


@pytest.mark.parametrize("workers", [0, 2])
def test_an_engine_that_dies_is_replaced(expected: dict[int, Any], tmp_path: Path, workers: int) -> None:
    items = [(seed, tmp_path / f"marker{seed}") for seed in range(3)]
    results = dict(robot_map(lose_the_engine_once, items, Workers(workers), CONFIG))
    assert all(marker.exists() for _, marker in items)
    assert {seed: result for (seed, _), result in results.items()} == {s: expected[s] for s in range(3)}


def test_a_worker_that_dies_is_replaced(engines: Engines, expected: dict[int, Any], tmp_path: Path) -> None:
    """Killed with its items, and so that it can close nothing: its engine must not stay behind."""
    others = engines(os.getpid())
    items = [(seed, tmp_path / f"marker{seed % 4}") for seed in ITEMS]  # four of them kill their worker
    results = dict(robot_map(die_once, items, Workers(2), CONFIG))
    killed = {int(marker.read_text()) for marker in tmp_path.iterdir()}
    assert len(killed) == 4
    assert {seed: result for (seed, _), result in results.items()} == expected
    assert engines(os.getpid()) == others
    assert wait_for(lambda: not killed & living_groups(), 10)


def living_groups() -> set[int]:
    """Process groups that somebody is in: a worker's has its pid, and its engines are in it."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, group = path.read_text().rpartition(")")[2].split()[:3]
            if state != "Z":
                found.add(int(group))
    return found


def test_an_item_that_kills_every_worker_is_told() -> None:
    done = []
    with pytest.raises(EngineError, match="3 workers have died one after the other of the same work"):
        done.extend(robot_map(die_of_one, [5, *range(4)], Workers(1), CONFIG))
    assert not done, "it is told at once, not when everything else is done"


@pytest.mark.parametrize("workers", [0, 1])
def test_an_error_in_an_item_comes_out(workers: int) -> None:
    with pytest.raises(LookupError, match="item 5 cannot be done"):
        list(robot_map(fail, [5], Workers(workers), CONFIG))


def test_items_without_end_are_drawn_as_they_are_needed(engines: Engines) -> None:
    others = engines(os.getpid())
    drawn: list[int] = []
    items = (drawn.append(i) or i for i in count())  # type: ignore[func-returns-value]
    results = robot_map(random_run, items, Workers(1), CONFIG)
    assert len(list(islice(results, 3))) == 3
    assert len(drawn) < 8
    results.close()  # type: ignore[attr-defined]
    assert engines(os.getpid()) == others


SCRIPT = """
import sys
sys.path.append(sys.argv[1])
from evaps.robots.workers import RobotConfig, Workers, robot_map
from robot_jobs import play_for_ever

if __name__ == "__main__":
    try:
        workers, config = Workers(int(sys.argv[2])), RobotConfig(("ISTHERE Demon",))
        list(robot_map(play_for_ever, range(0, 10**6, 1000), workers, config))
    except KeyboardInterrupt:
        sys.exit(130)
"""


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> bool:
    until = time.monotonic() + seconds
    while not condition() and time.monotonic() < until:
        time.sleep(0.05)
    return condition()


def start_job(tmp_path: Path, workers: int, engines: Engines) -> tuple["subprocess.Popen[bytes]", set[int]]:
    """A program whose workers play, and their engines."""
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, "script.py", str(Path(__file__).parent), str(workers)]
    job = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
    )
    assert wait_for(lambda: len(engines(job.pid)) == max(workers, 1))
    return job, engines(job.pid)


def all_gone(pids: set[int]) -> bool:
    return not any(Path(f"/proc/{pid}").exists() for pid in pids)


@pytest.mark.parametrize("to_the_group", [True, False], ids=["terminal", "kill"])
@pytest.mark.parametrize("workers", [0, 2])
def test_ctrl_c_leaves_no_engine_behind(
    engines: Engines, tmp_path: Path, workers: int, to_the_group: bool
) -> None:
    job, started = start_job(tmp_path, workers, engines)
    time.sleep(0.2)
    (os.killpg if to_the_group else os.kill)(job.pid, signal.SIGINT)
    output = job.communicate(timeout=60)[0]
    assert (job.returncode, output) == (130, b"")
    assert wait_for(lambda: all_gone(started), 10)


def test_a_second_ctrl_c_leaves_no_engine_behind_either(engines: Engines, tmp_path: Path) -> None:
    job, started = start_job(tmp_path, 2, engines)
    for _ in range(2):
        time.sleep(0.02)
        job.send_signal(signal.SIGINT)
    job.communicate(timeout=60)
    assert job.returncode != 0
    assert wait_for(lambda: all_gone(started), 10)


@pytest.mark.parametrize("workers", [0, 2])
def test_a_killed_parent_leaves_nothing_behind(engines: Engines, tmp_path: Path, workers: int) -> None:
    job, started = start_job(tmp_path, workers, engines)
    children = Path(f"/proc/{job.pid}/task/{job.pid}/children").read_text().split()
    # an engine that is just being started may leave small files of shared memory
    assert wait_for(lambda: len(list(tmp_path.glob("plays-*"))) == max(workers, 1))
    traces = [trace for pid in started for trace in traces_of(pid)]
    assert len(traces) >= 2 * len(started)
    job.kill()
    job.communicate(timeout=60)
    assert wait_for(lambda: all_gone({*started, *map(int, children)}), 10)
    assert wait_for(lambda: not any(path.exists() for path in traces), 10)


def test_an_engine_that_just_starts_ends_with_its_process(engines: Engines, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, "script.py", str(Path(__file__).parent), "0"]
    job = subprocess.Popen(command, cwd=tmp_path)
    assert wait_for(lambda: bool(engines(job.pid)))
    started = engines(job.pid)
    job.kill()
    job.wait()
    assert wait_for(lambda: all_gone(started), 10)


def test_the_end_of_a_fork_is_not_the_end_of_the_engine(tmp_path: Path) -> None:
    code = """
import os, sys, numpy as np
from evaps.robots.doom import DoomRobot
from evaps.robots.scenes import random_scene
robot = DoomRobot()
robot.reset(random_scene(np.random.default_rng(0)))
if os.fork() == 0:
    sys.exit(0)
os.wait()
pid = robot._engine.pid
robot.act("ATTACK")
robot.observe()
assert robot._engine.pid == pid
"""
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=60)


def traces_of(pid: int) -> list[Path]:
    """The folder of an engine's files, and the files of the memory that it shares."""
    arguments = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    instance = arguments[arguments.index("+viz_instance_id") + 1]
    return [Path(arguments[arguments.index("-file") + 1]).parent, *Path("/dev/shm").glob(f"*{instance}")]
