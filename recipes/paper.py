"""The paper's evaluation: data, trainings, rows, tables and figures, at one of four scales.

    python -m recipes.paper                        # small: all methods, three seeds; goes on where it was
    python -m recipes.paper --seeds 0              # one seed of them
    python -m recipes.paper --methods lgrl evaps   # some of the methods
    python -m recipes.paper --retrain              # all of it anew, in results/small-retrained
    python -m recipes.paper --ship                 # and put LGRL's and EVAPS's in their place
    python -m recipes.paper --scale paper --frozen --seeds 0 --tasks 1000 --noise False --methods lgrl evaps

`make paper SCALE=small` is the first of these. Rows that came with the checkout are not made again. On two
cores without a graphics card small takes 8 to 20 minutes for the data, 7 to 75 for each training, and 5 to 40
for each method's 1,000 test tasks.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pyarrow.parquet as pq
import tyro

from evaps.domain import CHOSEN
from evaps.dsl import UserError
from evaps.evaluate import evaluate
from evaps.files import write_atomically
from evaps.metrics import Results
from evaps.models import METHODS, PROPOSER, SHIPPED, needed_for
from evaps.models.checkpoint import hash_of
from evaps.report import report
from evaps.report.summary import gains_of_scale, lead_table, noise_costs, seeds_table, summary_table
from evaps.report.wording import scale_note
from evaps.robots.workers import Workers
from evaps.tasks.build import generate
from evaps.tasks.dataset import Dataset
from evaps.tasks.identity import short_hash
from evaps.train import train
from evaps.train.scale import SCALES
from recipes.command import start
from recipes.pages import put

DATA_SEED = 0
PAPER = (
    PROPOSER,
    "lgrl-rl",
    "transformer",
    "inferred-trace",
    "latent-execution",
    "sed",
    "naive",
    "evaps-o",
    "evaps-s",
    "evaps",
)
"""The rows of the paper's tables; whoever starts from another one comes after it."""
FURTHER = ("evaps-parallel", "prior")
"""Whom the paper has no row of: its own reading of EVAPS's decoder, and chance."""
NOISE = (0.0, 0.05, 0.1, 0.15, 0.2)
NOISY = (PROPOSER, "evaps")
NOISY_TASKS = 400  # of the test tasks: the first ones
SHIP = ("encoder", "inverse", PROPOSER, "evaps")
"""The checkpoints that come with the package."""
SHARED = ("encoder", "inverse")
"""What all seeds have from the first one: it learns from random walks, and is no part of what is compared.

At the scale ``paper`` the encoder has learned from training tasks, too, with an LGRL of the first seed.
"""


@dataclass(frozen=True)
class Judging:
    """How much is judged at a scale."""

    seeds: int
    """Trainings of each method in PAPER; those in FURTHER have one."""
    tasks: int
    """Test tasks."""
    noise: bool
    """Whether LGRL and EVAPS are judged with noise, too."""


JUDGING = {
    "smoke": Judging(seeds=1, tasks=4, noise=False),
    "quick": Judging(seeds=1, tasks=200, noise=False),
    "small": Judging(seeds=3, tasks=1_000, noise=True),
    "paper": Judging(seeds=5, tasks=10_000, noise=True),
}
"""What else the one dial turns: `evaps.train.scale.SCALES` says how much is trained."""


@dataclass(frozen=True)
class Plan:
    """What is made."""

    scale: str = "small"
    """smoke, quick, small or paper."""
    seeds: tuple[int, ...] = ()
    """Of the trainings; all share encoder and inverse model of seed 0. None: as many as JUDGING has."""
    methods: tuple[str, ...] = (*PAPER, *FURTHER)
    """Who is trained and judged."""
    tasks: int = 0
    """Test tasks; 0: as many as JUDGING has."""
    noise: bool | None = None
    """Judge LGRL and EVAPS with noise, too, and without, five times on 400 tasks; None: as in JUDGING."""
    retrain: bool = False
    """Train and judge everything anew, beside shipped checkpoints and committed rows."""
    frozen: bool = False
    """Take encoder and inverse model that come with evaps, of scale small, instead of this scale's."""
    ship: bool = False
    """Put the checkpoints of SHIP into the package."""
    workers: int = 2
    """Processes that simulate; 0 for none beside this one."""
    root: Path = Path()
    """Folder that data, runs and results are in."""

    def __post_init__(self) -> None:
        """Fill in what the scale says.

        Raises:
            UserError: there is no such scale, or no such method.
        """
        for method in self.methods:
            needed_for(method)
        if self.scale not in JUDGING:
            raise UserError(f"there is no scale {self.scale!r}; known are {', '.join(JUDGING)}")
        usual = JUDGING[self.scale]
        for name, value in (
            ("seeds", self.seeds or tuple(range(usual.seeds))),
            ("tasks", self.tasks or usual.tasks),
            ("noise", usual.noise if self.noise is None else self.noise),
        ):
            object.__setattr__(self, name, value)

    @property
    def kind(self) -> str:
        """The scale and what is unusual, for names of folders, so that nothing else that is there counts."""
        return self.scale + "-frozen" * self.frozen + "-retrained" * self.retrain

    @property
    def data(self) -> Path:
        """Folder of the data set."""
        return self.root / "data" / self.scale

    @property
    def results(self) -> Path:
        """Folder of rows, learning curves and reports."""
        return self.root / "results" / self.kind

    def runs(self, seed: int) -> Path:
        """Folder of a seed's checkpoints."""
        return self.root / "runs" / f"{self.kind}-{seed}"


def make(plan: Plan) -> None:
    """All steps in order; each goes on where it was interrupted.

    Raises:
        UserError: what would be shipped is not made.
    """
    if plan.ship and not (0 in plan.seeds and set(SHIP) <= set(with_what_is_needed(plan.methods))):
        raise UserError(f"--ship is for {', '.join(SHIP)} of seed 0; name lgrl and evaps, and seed 0")
    for seed in plan.seeds:
        for method, noise in rows_wanted(plan, seed):
            if is_done(plan, seed, method, noise):
                tell(f"{method}, seed {seed}: has its rows")
                continue
            make_data(plan)
            for needed in with_what_is_needed((method,)):
                make_checkpoint(plan, seed, needed)
            make_rows(plan, seed, method, noise)
            if noise is None:
                keep_curves(plan, seed, method)
    for method in SHIP if plan.ship else ():
        ship(plan, method)
    written = report("all", plan.results / "methods", plan.results / "report")
    tell(f"{len(written)} files of tables and figures are in {plan.results / 'report'}")


def rows_wanted(plan: Plan, seed: int) -> Iterator[tuple[str, float | None]]:
    """A seed's methods, each with a share of invalid pixels for the noise figure, or with None."""
    first = seed == plan.seeds[0]
    for method in plan.methods:
        if first or method not in FURTHER:
            yield method, None
    for method in NOISY if plan.noise and first else ():
        if method in plan.methods:
            yield from ((method, share) for share in NOISE)


def rows_path(plan: Plan, seed: int, method: str, noise: float | None = None) -> Path:
    """The file of a method's rows; or of those with noise."""
    rows = plan.results / "methods"
    if noise is None:
        return rows / f"{method}-{seed}.parquet"
    return rows / "noise" / f"{method}-{seed}-{100 * noise:.0f}.parquet"


def is_done(plan: Plan, seed: int, method: str, noise: float | None = None) -> bool:
    """Whether a method's rows came with the checkout, so that its hours need not be spent again.

    They did not if there is a checkpoint that somebody has trained here, or another one is shipped by now.
    """
    shipped = SHIPPED / plan.scale
    if plan.retrain or (plan.runs(seed) / method).exists():
        return False
    comes_along = seed == 0 and (shipped / method).is_dir()
    tasks = plan.tasks if noise is None else min(plan.tasks, NOISY_TASKS)
    weights = {method: weights_of(shipped, method) if comes_along else None}
    return have_rows(rows_path(plan, seed, method, noise), tasks, weights)


def tell(what: str) -> None:
    """Say how far it is."""
    print(what, file=sys.stderr, flush=True)


def have_rows(path: Path, tasks: int, weights: Mapping[str, str | None]) -> bool:
    """Whether a file has rows of so many tasks, of these methods with these weights (None: any)."""
    if not path.exists():
        return False
    made = pq.read_table(path, columns=["method", "weights", "task"])
    pairs = set(zip(made["method"].to_pylist(), made["weights"].to_pylist(), strict=True))
    same = {(method, weights[method] and there) for method, there in pairs if method in weights}
    return same == set(weights.items()) and len(made["task"].unique()) >= tasks


def weights_of(runs: Path, method: str) -> str:
    """What rows say of the checkpoints that they were made with."""
    return short_hash([hash_of(runs / name) for name in dict.fromkeys(needed_for(method))])


def with_what_is_needed(methods: Sequence[str]) -> list[str]:
    """All that has to be trained, in order."""
    needed = ["encoder", "inverse"]
    for method in methods:
        if method in METHODS and (start := METHODS[method].start):
            needed.append(start)
        needed += needed_for(method)
    return list(dict.fromkeys(needed))


def make_data(plan: Plan) -> None:
    """`evaps generate DATA --tasks N --seed 0`."""
    generate(plan.data, SCALES[plan.scale].tasks, DATA_SEED, Workers(plan.workers))


def make_checkpoint(plan: Plan, seed: int, method: str) -> None:
    """Take what is there, or train it: `evaps train METHOD --data DATA --out RUNS --seed SEED`."""
    folder = plan.runs(seed) / method
    shipped = SHIPPED / plan.scale / method
    if plan.frozen and method in SHARED:
        take(SHIPPED / "small" / method, folder)
    elif seed and method in SHARED:
        make_checkpoint(plan, 0, method)
        take(plan.runs(0) / method, folder)
    elif seed == 0 and shipped.is_dir() and not plan.retrain:
        take(shipped, folder)
    if not (folder / "config.json").exists():
        train(method, plan.data, plan.runs(seed), plan.scale, seed, Workers(plan.workers))


def take(checkpoint: Path, folder: Path) -> None:
    """Copy a checkpoint to a folder that is not there: whole, or not at all."""
    if folder.exists():
        return
    part = folder.with_name(f".{folder.name}.part")
    part.mkdir(parents=True, exist_ok=True)
    for name in ("config.json", "model.safetensors"):
        shutil.copy(checkpoint / name, part / name)
    part.rename(folder)


def ship(plan: Plan, method: str) -> None:
    """Copy a checkpoint of seed 0 to those that come with evaps."""
    target = SHIPPED / plan.scale / method
    for name in ("config.json", "model.safetensors"):
        write_atomically(target / name, (plan.runs(0) / method / name).read_bytes())


def make_rows(plan: Plan, seed: int, method: str, noise: float | None = None) -> None:
    """The rows of a method and a seed; or those for the noise figure, of fewer tasks."""
    path = rows_path(plan, seed, method, noise)
    if noise is None:
        judge(plan, plan.runs(seed), (method,), path)
    else:
        fewer = replace(plan, tasks=min(plan.tasks, NOISY_TASKS))
        judge(fewer, plan.runs(seed), (method,), path, noise)


def judge(
    plan: Plan,
    runs: Path,
    methods: tuple[str, ...],
    path: Path,
    noise: float = 0.0,
    actions: int = CHOSEN.budget,
) -> None:
    """`evaps evaluate --methods METHODS [--noise SHARE]`, unless it was done with these weights and tasks."""
    path.parent.mkdir(parents=True, exist_ok=True)
    tasks = len(Dataset(plan.data).split("test")[: plan.tasks])
    if have_rows(path, tasks, {method: weights_of(runs, method) for method in methods}):
        return
    workers = Workers(plan.workers)
    evaluate(
        plan.data, path, str(runs), methods, tasks=plan.tasks, workers=workers, noise=noise, actions=actions
    )


def keep_curves(plan: Plan, seed: int, method: str) -> None:
    """Copy the curve of each part of a training, such as latent-execution-retrained, beside the rows."""
    folder = plan.runs(seed) / method
    for metrics in folder.rglob("metrics.jsonl"):
        part = "-".join([method, *metrics.relative_to(folder).parts[:-1]])
        target = plan.results / "methods" / "curves" / f"{part}-{seed}.jsonl"
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(metrics, target)


def noise_page(results: Path) -> str:
    """What noise costs, for docs/findings.md."""
    return noise_costs(results / "methods" / "noise")


def scale_table(smaller: Plan, larger: Plan) -> str:
    """What more tasks give to the methods that have rows at the larger scale, for docs/findings.md."""
    found = Results.read(larger.results / "methods")
    paths = [rows_path(smaller, found.first(method).seed, method) for method in found.methods]
    return gains_of_scale(Results.read(*paths), found)


def readme_table(found: Results) -> str:
    """The README's table beside the paper's figures, its scale, and what may be said of its differences."""
    ahead = "How many points EVAPS is ahead in generalization, with 95 % intervals; in bold if clear of zero:"
    table = summary_table(found, beside_paper=True)
    return "\n\n".join([table, scale_note(found), ahead, lead_table(found, "evaps")])


LARGER = Plan("paper", frozen=True)
"""Whose rows docs/findings.md puts beside those of the small scale."""


def main(plan: Plan) -> None:
    """Make it; what the README and docs/findings.md show of it is put in its place."""
    make(plan)
    if plan.results == LARGER.results:
        put(Path("docs/findings.md"), "scales", scale_table(Plan(), plan))
    if plan.results == Path("results/small"):
        found = Results.read(plan.results / "methods")
        put(Path("README.md"), "results/small/methods", readme_table(found))
        put(Path("docs/findings.md"), "seeds", seeds_table(found))
        if (plan.results / "methods" / "noise").is_dir():
            put(Path("docs/findings.md"), "noise", noise_page(plan.results))


if __name__ == "__main__":
    start(lambda: main(tyro.cli(Plan, description=__doc__)))
