"""Tasks to learn from, on the real engine."""

from pathlib import Path

import pytest

from evaps.models import SHIPPED
from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.tasks.dataset import Dataset
from evaps.train.run import Run

TASKS = 24


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("tasks") / "data"
    generate(folder, TASKS, 7, Workers(0), part=TASKS + 1)
    return Dataset(folder)


@pytest.fixture
def run(dataset: Dataset, tmp_path: Path) -> Run:
    for name in ("encoder", "inverse", "lgrl"):
        (tmp_path / name).symlink_to(SHIPPED / "small" / name)
    return Run(dataset, tmp_path, "smoke", 0, Workers(0))
