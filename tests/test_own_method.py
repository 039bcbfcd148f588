"""The guide for a method of one's own: its example is short, is found by its entry point, and learns."""

import re
import subprocess
import sys
from pathlib import Path

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


def test_a_method_of_another_package_is_found_and_learns(tmp_path: Path) -> None:
    (tmp_path / "own_method.py").write_text(EXAMPLE.read_text())
    (metadata := tmp_path / "own_method-1.dist-info").mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: own-method\nVersion: 1\n")
    toml = re.search(r'entry-points\."(.*?)"\]\n(mean = ".*")\n', GUIDE)
    assert toml is not None
    (metadata / "entry_points.txt").write_text(f"[{toml[1]}]\n{toml[2].replace(chr(34), '')}\n")
    done = subprocess.run(
        [sys.executable, "-c", LEARN], env={"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) >= 7
