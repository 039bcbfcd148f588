"""The same work on a real Ray of two workers, one of which is killed on the way."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from robot_jobs import die, die_once, fail, random_run
from test_workers import wait_for

from evaps.dsl import UserError
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.base import EngineError
from evaps.robots.workers import RobotConfig, Workers, robot_map

pytestmark = pytest.mark.slow
ray = pytest.importorskip("ray")
CONFIG = RobotConfig(PERCEPTION_KEYS)
ITEMS = range(6)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A cluster that stays up between the tests, as a remote one would."""
    path = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join(
        [str(Path(__file__).parent), path]
    )  # its workers import from here
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 2, "include_dashboard": False})
    yield cluster.address
    cluster.shutdown()
    os.environ["PYTHONPATH"] = path


@pytest.fixture(scope="module")
def expected() -> dict[int, Any]:
    return dict(robot_map(random_run, ITEMS, Workers(0), CONFIG))


def test_results_are_those_of_this_process(address: str, expected: dict[int, Any]) -> None:
    before = {*Path("/tmp").glob("evaps-*"), *Path("/dev/shm").glob("ViZDoom*")}
    assert dict(robot_map(random_run, ITEMS, Workers(2, "ray", address), CONFIG)) == expected
    wait_for(lambda: not left_behind(before), 10)
    assert not left_behind(before)


def left_behind(before: set[Path]) -> list[Path]:
    """Files of engines of processes that are no more, of those that came since."""
    files = {*Path("/tmp").glob("evaps-*"), *Path("/dev/shm").glob("ViZDoom*")} - before
    living = " ".join(word for p in psutil.process_iter(["cmdline"]) for word in p.info["cmdline"] or ())
    return [path for path in files if path.name not in living and path.name[-10:] not in living]


def test_a_worker_that_dies_is_replaced(address: str, expected: dict[int, Any], tmp_path: Path) -> None:
    items = [(seed, tmp_path / f"marker{seed % 3}") for seed in ITEMS]
    results = dict(robot_map(die_once, items, Workers(2, "ray", address), CONFIG))
    assert len(list(tmp_path.iterdir())) == 3
    assert {seed: result for (seed, _), result in results.items()} == expected


def test_an_error_in_an_item_comes_out(address: str) -> None:
    with pytest.raises(LookupError, match="item 5 cannot be done"):
        list(robot_map(fail, [5], Workers(1, "ray", address), CONFIG))


def test_an_item_that_kills_every_worker_is_told(address: str) -> None:
    with pytest.raises(EngineError, match="workers have died"):
        list(robot_map(die, [0], Workers(1, "ray", address), CONFIG))


def test_more_workers_than_the_cluster_has_processors_are_told(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evaps.robots.ray_workers.PLACED_WITHIN", 5.0)
    with pytest.raises(UserError, match=r"\d of 5 workers found a free processor .* --workers"):
        list(robot_map(random_run, ITEMS, Workers(5, "ray", address), CONFIG))


def test_a_cluster_that_is_not_there_is_one_line() -> None:
    with pytest.raises(UserError, match="no Ray cluster at 'nowhere'") as error:
        list(robot_map(random_run, ITEMS, Workers(1, "ray", "nowhere"), CONFIG))
    assert "\n" not in str(error.value)
    with pytest.raises(UserError, match=r"no Ray cluster at '127.0.0.1:1': Connection refused"):
        list(robot_map(random_run, ITEMS, Workers(1, "ray", "127.0.0.1:1"), CONFIG))


def test_without_ray_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UserError, match=r"pip install 'evaps\[cluster\]'"):
        list(robot_map(random_run, ITEMS, Workers(1, "ray"), CONFIG))
