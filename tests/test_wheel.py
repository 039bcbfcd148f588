"""The wheel holds all that evaps needs: unpacked anywhere, it solves the tasks that it brings along."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("wheel")
    build = ["wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(out), str(ROOT)]
    subprocess.run([sys.executable, "-m", "pip", *build], check=True, capture_output=True)
    (wheel,) = out.glob("*.whl")
    zipfile.ZipFile(wheel).extractall(out / "site")
    return out / "site"


def run(unpacked: Path, folder: Path, *args: str) -> subprocess.CompletedProcess[str]:
    env = {**os.environ, "PYTHONPATH": str(unpacked)}
    command = [sys.executable, "-m", "evaps", *args]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=250)


def test_the_demo_runs_from_the_wheel_alone(unpacked: Path, tmp_path: Path) -> None:
    done = run(unpacked, tmp_path, "demo", "--out", "page.html")
    assert (done.returncode, done.stderr) == (0, "")
    assert "of 6 tasks solved" in done.stdout
    assert "sidestep-and-shoot" in (tmp_path / "page.html").read_text()


def test_it_finds_its_checkpoints(unpacked: Path, tmp_path: Path) -> None:
    done = run(unpacked, tmp_path, "doctor")
    assert done.returncode == 0, done.stderr
    assert f"in {unpacked / 'evaps'}" in done.stdout
    assert "encoder, evaps, inverse, lgrl" in done.stdout
