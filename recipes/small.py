"""The small scale: 20,000 tasks, on two cores; makes the shipped checkpoints and the README's figures.

    python -m recipes.small            # everything, resuming where it was
    python -m recipes.small --retrain  # not from the shipped checkpoints

Times are those of two cores without a graphics card.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from evaps.evaluate import evaluate
from evaps.models import SHIPPED
from evaps.report import difference_line, summary_table
from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.train import train
from evaps.train.scale import SCALES
from recipes.pages import put

DATA = Path("data/small")
RUNS = Path("runs/small")
ROWS = Path("results/small/rows.parquet")
SEED = 0
TEST_TASKS = 1_000


def make_data() -> None:
    """`evaps generate data/small --tasks 20000 --seed 0`: 15 minutes."""
    generate(DATA, SCALES["small"].tasks, SEED, Workers(2))


def make_checkpoints() -> None:
    """`evaps train encoder|lgrl|evaps --data data/small --out runs/small`, and the set that is shipped.

    30 minutes with the random walks, 25 with embedding all frames, 35 with running the wrong programs.
    """
    for method in ("encoder", "lgrl", "evaps"):
        train(method, DATA, RUNS, "small", SEED)
        ship(method)


def ship(method: str) -> None:
    """Copy a checkpoint to those that come with evaps."""
    target = SHIPPED / "small" / method
    target.mkdir(parents=True, exist_ok=True)
    for name in ("config.json", "model.safetensors"):
        shutil.copy(RUNS / method / name, target / name)


def make_rows() -> None:
    """`evaps evaluate --data data/small --out results/small/rows.parquet`: the README's table; 22 minutes."""
    evaluate(DATA, ROWS, "small", ("lgrl", "evaps"), tasks=TEST_TASKS)


def make_table() -> None:
    """The README's table, from the rows."""
    put(Path("README.md"), str(ROWS), f"{summary_table(ROWS)}\n\n{difference_line(ROWS)}")


def main() -> None:
    """All steps in order; each goes on where it was interrupted."""
    make_data()
    if "--retrain" in sys.argv or not (SHIPPED / "small" / "evaps").is_dir():
        make_checkpoints()
    make_rows()
    make_table()


if __name__ == "__main__":
    main()
