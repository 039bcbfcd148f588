"""``evaps train``: a method from a data set."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from evaps.cli.command import Command, print_result
from evaps.cli.inputs import Folder, check_least, writing
from evaps.cli.workers import available_cores, workers_from


@dataclass(frozen=True)
class Train(Command):
    """Train a method, or go on with it: first `encoder`, then `inverse`, a synthesizer, and a repairer.

    Each gets a folder with its checkpoint in OUT. What a step needs (random walks, embeddings of frames, runs
    of wrong programs) is made once and kept beside the data set.
    """

    stopped: ClassVar[str] = "stopped; the same command goes on where it last saved, a minute ago at most"

    method: Positional[Annotated[str, arg(metavar="encoder|METHOD")]]
    """What to train: encoder; then inverse, whose embedding of pairs all methods start from; then lgrl,
    transformer, inferred-trace or latent-execution; then lgrl-rl, sed, evaps, an ablation of it (naive,
    evaps-o, evaps-s), or another reading of the paper (evaps-parallel, evaps-substitution, evaps-no-goal)."""
    data: Folder
    """Folder of the data set, from `evaps generate`."""
    out: Folder
    """Folder of the checkpoints."""
    scale: str = "small"
    """How much: smoke (40 tasks), quick (3,000), small (20,000) or paper (100,000)."""
    seed: int = 0
    """Of weights, batches and mutations."""
    workers: int = field(default_factory=available_cores)
    """Processes that simulate; by default one a core."""
    tensorboard: bool = False
    """Write the metrics for TensorBoard too (pip install 'evaps[track]'); metrics.jsonl has them always."""
    tuning: int | None = None
    """For encoder: further batches in which it learns with a synthesizer (at scale paper: 4,000)."""
    json: bool = False
    """Print one JSON object, with how good the checkpoint is on validation tasks."""

    def run(self) -> None:
        """Train, with progress on standard error."""
        check_least(seed=(self.seed, 0), tuning=(self.tuning or 0, 0))
        workers = workers_from(self.workers)
        from evaps.models.checkpoint import read_config
        from evaps.train import train

        with writing(self.out):
            folder = train(
                self.method,
                self.data,
                self.out,
                self.scale,
                self.seed,
                workers,
                self.tensorboard,
                self.tuning,
            )
        metrics = read_config(folder, self.method)["facts"].get("metrics", {})
        facts = {"checkpoint": folder, "method": self.method, "metrics": metrics}
        print_result(f"{folder}: the checkpoint of {self.method}", facts, self.json)
