"""The guide for a method of one's own: its example is short, is found by its entry point, and learns."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "examples" / "own_method.py"
GUIDE = (ROOT / "docs" / "own-method.md").read_text()

LEARN = """
import numpy as np, torch
from torch.nn import functional as F
from evaps.dsl import VOCAB
from evaps.dsl.sampler import sample_program
from evaps.models import METHODS, is_repairer, new_method
from evaps.models.beam import beam_search
from evaps.train.lessons import Lessons

torch.manual_seed(0)
assert "mean" in METHODS and not is_repairer("mean")
model = new_method("mean", feature=32, pair=64, hidden=64, dropout=0.0)
rng = np.random.default_rng(0)
programs = [VOCAB.encode(sample_program(rng).tokens) for _ in range(8)]
features = F.normalize(torch.randn(8, 5, 2, 32), dim=-1) * 4
optimizer = torch.optim.Adam(model.parameters(), lr=5e-3)
for _ in range(150):
    optimizer.zero_grad()
    model.loss(features, *Lessons.of(programs).batch(range(8))).backward()
    optimizer.step()
best = [group[0].program.tokens for group in beam_search(model.eval(), features, beam=2)]
print(sum(VOCAB.encode(tokens) == gold for tokens, gold in zip(best, programs)))
"""


def test_the_example_is_as_short_as_promised() -> None:
    assert len(EXAMPLE.read_text().splitlines()) < 60


def python(folder: Path, code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code], env={"PYTHONPATH": str(folder)}, capture_output=True, text=True
    )


def install(folder: Path, entries: str) -> None:
    """What pip leaves behind of a package with these entry points."""
    (folder / "own_method.py").write_text(EXAMPLE.read_text())
    (metadata := folder / "own_method-1.dist-info").mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: own-method\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(f"[evaps.methods]\n{entries}\n")


def test_a_method_of_another_package_is_found_and_learns(tmp_path: Path) -> None:
    toml = re.search(r'entry-points\."evaps.methods"\]\n(mean = ".*")\n', GUIDE)
    assert toml is not None
    install(tmp_path, toml[1].replace('"', ""))
    done = python(tmp_path, LEARN)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 7


@pytest.mark.parametrize(
    ("entry", "what"),
    [
        ("x = nowhere:X", "the method 'x', nowhere:X, cannot be loaded: No module named 'nowhere'"),
        ("x = own_method:X", "cannot be loaded: module 'own_method' has no attribute 'X'"),
        ("x = own_method", "cannot be loaded"),
        ("x = pathlib:Path", "the method 'x', pathlib:Path, is neither a Synthesizer nor a Repairer"),
    ],
)
def test_an_entry_point_that_leads_nowhere_is_one_line(tmp_path: Path, entry: str, what: str) -> None:
    install(tmp_path, entry)
    done = python(tmp_path, "from evaps.models import method_class; method_class('x')")
    assert done.stderr.splitlines()[-1].startswith("evaps.dsl.errors.UserError: ")
    assert what in done.stderr


def test_an_entry_point_cannot_take_a_name_that_is_taken(tmp_path: Path) -> None:
    install(tmp_path, "verified = own_method:Mean")
    done = python(tmp_path, "from evaps.models import METHODS; print('verified' in METHODS)")
    assert done.stdout == "False\n"
    assert "own_method:Mean is not used: there is a method 'verified' already" in done.stderr
