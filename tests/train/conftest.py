"""Tasks to learn from, on the real engine."""

import pytest

from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.tasks.dataset import Dataset

TASKS = 24


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("tasks") / "data"
    generate(folder, TASKS, 7, Workers(0), part=TASKS + 1)
    return Dataset(folder)
