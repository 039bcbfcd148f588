"""Domains: Karel and a robot of somebody else go through the same commands as the Doom robot.

A process has one domain, so each of these works in processes of its own.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from evaps.domain import DOMAINS, DOOM, VARIABLE, Axis, Domain
from evaps.tasks.files import read_table

ROOT = Path(__file__).parents[1]
EXAMPLES = [ROOT / "examples" / name for name in ("own_domain.py", "own_world.py")]
GUIDE = (ROOT / "docs" / "own-robot.md").read_text()


def install(folder: Path, entry: str = "vacuum = own_domain:DOMAIN") -> Path:
    """What pip leaves behind of a package with the example's domain."""
    for file in EXAMPLES:
        (folder / file.name).write_text(file.read_text())
    (metadata := folder / "own_domain-1.dist-info").mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: own-domain\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(f"[evaps.domains]\n{entry}\n")
    return folder


def environment(domain: str, packages: Path | None = None) -> dict[str, str]:
    """That of a process in a domain, with more packages."""
    path = os.pathsep.join(filter(None, [packages and str(packages), os.environ.get("PYTHONPATH")]))
    return {**os.environ, VARIABLE: domain, "OMP_NUM_THREADS": "1", "PYTHONPATH": path}


def run(domain: str, *words: object, packages: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Python, in a domain."""
    there = environment(domain, packages)
    return subprocess.run([sys.executable, *map(str, words)], env=there, capture_output=True, text=True)


# Bunel et al., ICLR 2018, Figure 1 has programs like this one.
TOKENS = (
    "DEF run m( WHILE c( not c( markersPresent c) c) w( IFELSE c( frontIsClear c) i( move i) ELSE "
    "e( turnLeft e) w) REPEAT R=12 r( putMarker r) m)"
)
PYTHON = """def run():
    while not markers_present():
        if front_is_clear():
            move()
        else:
            turn_left()
    for _ in range(12):
        put_marker()
"""


def test_karel_is_written_in_both_forms() -> None:
    code = "import sys; from evaps.dsl import Program; p = Program.parse(sys.argv[1]);"
    code += "print(p); print(p.to_python())"
    for text in (TOKENS, PYTHON):
        assert run("karel", "-c", code, text).stdout == f"{TOKENS}\n{PYTHON}\n"
    wrong = run("karel", "-c", code, "DEF run m( MOVE_FORWARD m)").stderr
    assert 'found "MOVE_FORWARD", expected an action' in wrong


PROPERTIES = """
import numpy as np
from evaps.dsl import VOCAB, GrammarState, Program, token_type
from evaps.dsl.mutation import mutate
from evaps.dsl.sampler import sample_program

rng = np.random.default_rng(0)
for _ in range(200):
    for program in (p := sample_program(rng), mutate(p, rng, 2)):
        assert Program.parse(str(program)) == Program.parse(program.to_python()) == program
        state = GrammarState.start()
        for token in VOCAB.encode(program.tokens):
            state = state.advance(token)
        assert state.finished
for _ in range(200):  # whatever the grammar allows is a program
    state, tokens = GrammarState.start(), []
    while not state.finished:
        tokens.append(int(rng.choice(np.flatnonzero(state.allowed_within(40 - len(tokens))))))
        state = state.advance(tokens[-1])
    Program.from_ids(tokens)
kinds = {token_type(token) for token in VOCAB.tokens}
assert kinds == {"pad", "action", "perception", "control", "bracket", "constant"}
"""


@pytest.mark.parametrize("name", sorted(DOMAINS))
def test_programs_of_every_domain_round_trip(name: str) -> None:
    done = run(name, "-c", PROPERTIES)
    assert done.returncode == 0, done.stderr


SERVE = """
import contextlib, io, json, sys

from evaps.cli import main

for line in sys.stdin:
    with contextlib.redirect_stdout(out := io.StringIO()):
        status = main(json.loads(line))
    print(json.dumps([status, out.getvalue()]), flush=True)
"""


class Shell:
    """Commands of evaps in one domain, in one process, so that torch is loaded once."""

    def __init__(self, domain: str, packages: Path) -> None:
        self.domain = domain
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVE],
            env=environment(domain, packages),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __call__(self, *words: object) -> str:
        """What a command prints."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps([str(word) for word in words]) + "\n")
        self._process.stdin.flush()
        status, out = json.loads(self._process.stdout.readline())
        assert status == 0
        return str(out)

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


@pytest.fixture(scope="module", params=["karel-window", "vacuum"])
def shell(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shell]:
    """One for a domain of evaps, and one for that of another package."""
    made = Shell(request.param, install(tmp_path_factory.mktemp(request.param)))
    yield made
    made.close()


@pytest.mark.slow
def test_karel_comes_with_checkpoints(tmp_path: Path) -> None:
    told = run("karel", "-m", "evaps", "doctor", "--json").stdout.splitlines()
    found = {finding["what"]: finding for finding in map(json.loads, told)}
    assert found["checkpoints"]["well"]
    assert "lgrl" in found["checkpoints"]["found"]
    done = run("karel", "-m", "evaps", "demo", "--json", "--out", tmp_path / "page.html")
    solved = [json.loads(line)["solved"] for line in done.stdout.splitlines()]
    assert len(solved) == 6, done.stderr
    assert sum(solved) >= 4
    assert "Show depth" not in (tmp_path / "page.html").read_text()


PROGRAMS = {
    "karel-window": "def run():\n    while front_is_clear():\n        move()\n    put_marker()\n",
    "vacuum": "def run():\n    while not wall_east():\n        suck()\n        east()\n",
}


@pytest.mark.slow
def test_a_task_is_made_learned_from_and_solved(shell: Shell, tmp_path: Path) -> None:
    """The same commands as in the Doom domain, at the smoke scale."""
    data, runs, task = (tmp_path / part for part in ("data", "runs", "task"))
    made = json.loads(shell("generate", data, "--tasks", 100, "--seed", 0, "--workers", 0, "--json"))
    assert made == {"data": str(data), "tasks": 100, "indices": made["indices"], "shard": "1/1"}
    assert made["indices"] >= 100
    assert "0 of them differ" in shell("data", "info", data, "--check", 5)
    for method in ("encoder", "inverse", "lgrl", "evaps"):
        words = ("train", method, "--data", data, "--out", runs, "--scale", "smoke", "--workers", 0, "--json")
        trained = json.loads(shell(*words))
        assert (trained["checkpoint"], trained["method"]) == (str(runs / method), method)
        assert trained["metrics"]
    rows, source, scenes = (tmp_path / file for file in ("rows.parquet", "program.py", "scenes.json"))
    judged = ("--data", data, "--model", runs, "--out", rows, "--tasks", 2, "--workers", 0)
    assert shell("evaluate", *judged, "--methods", "lgrl", "evaps").count("\n|") == 3
    again = [
        json.loads(line)
        for line in shell("evaluate", *judged, "--methods", "lgrl", "evaps", "--json").splitlines()
    ]
    assert [(row["method"], row["tasks"]) for row in again] == [("lgrl", 2), ("evaps", 2)]
    assert all(0 <= row["generalization@1"] <= row["generalization@20"] <= 1 for row in again)
    reported = json.loads(shell("report", "table-1", "--rows", rows, "--out", tmp_path / "report", "--json"))
    assert [Path(file).name for file in reported["files"]] == [
        f"table-1.{kind}" for kind in ("md", "tex", "csv", "png", "svg")
    ]
    assert all(Path(file).is_file() for file in reported["files"])

    five = [read_table(data / "tasks.parquet")["scenes"][i].as_py()[0] for i in range(5)]
    scenes.write_text(json.dumps(five))
    source.write_text(PROGRAMS[shell.domain])
    written = json.loads(shell("make-task", "--program", source, "--scenes", scenes, "--out", task, "--json"))
    assert written == {"task": str(task)}
    page, film, scene = (tmp_path / file for file in ("page.html", "film.png", "scene.json"))
    search = ("--model", runs, "--seconds", 60, "--json", "--report", page)
    assert json.loads(shell("synthesize", task, *search))["solved"]
    assert page.stat().st_size > 10_000
    scene.write_text(json.dumps(five[0]))
    shell("run", "--program", source, "--scene", scene, "--film", film)
    assert film.read_bytes().startswith(b"\x89PNG")

    shipped = next((ROOT / "examples" / "tasks").iterdir())
    for words, what in (
        (("data", "info", data), f"is of the robot '{shell.domain}-v"),
        (("synthesize", shipped, "--model", runs), f"is of the domain '{shell.domain}', and this is 'doom'"),
    ):
        elsewhere = run(DOOM.name, "-m", "evaps", *words)
        assert elsewhere.returncode == 2
        assert what in elsewhere.stderr
        assert elsewhere.stderr.count("\n") == 1


def test_the_guide_names_what_is_there() -> None:
    lines = [line for file in EXAMPLES for line in file.read_text().splitlines()]
    assert len([line for line in lines if line]) < 60
    assert '[project.entry-points."evaps.domains"]\nvacuum = "own_domain:DOMAIN"' in GUIDE


@pytest.mark.parametrize(
    ("name", "entry", "what"),
    [
        (
            "nowhere",
            "vacuum = own_domain:DOMAIN",
            "no such domain; known are doom, karel, karel-window, vacuum",
        ),
        (
            "x",
            "x = missing:DOMAIN",
            "the domain 'x', missing:DOMAIN, cannot be loaded: No module named 'missing'",
        ),
        ("x", "x = own_domain:Domain", "'x', own_domain:Domain, is no evaps.domain.Domain"),
    ],
)
def test_a_domain_that_is_not_there_is_one_line(name: str, entry: str, what: str, tmp_path: Path) -> None:
    done = run(name, "-m", "evaps", "--help", packages=install(tmp_path, entry))
    assert done.returncode == 2
    assert what in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("fields", "what"),
    [
        ({"actions": ()}, "it needs actions and perceptions"),
        ({"perceptions": ()}, "it needs actions and perceptions"),
        ({"actions": ("go", "go")}, "'go' stands there twice"),
        ({"actions": ("turnLeft", "turn_left")}, "'turnLeft' stands there twice"),
        ({"actions": ("go", "a")}, "'a' stands there twice"),
        ({"actions": ("go on",)}, "'go on' cannot be a word"),
        ({"actions": ("Run",)}, "'Run' cannot be a word"),
        ({"actions": ("Return",)}, "'Return' cannot be a word"),
        ({"python": {"go": "foo bar"}}, "'go' cannot be a word"),
        ({"counts": ()}, "counts need whole numbers"),
        ({"counts": (2, 2)}, "counts need whole numbers, each once"),
        ({"counts": (2, -1)}, "counts are whole numbers of at least 0"),
        ({"world": "nothing"}, "world has to be MODULE:NAME, not 'nothing'"),
        ({"move": 0}, "move and budget have to be more than 0"),
        ({"opposites": (Axis("go"), Axis("stay"))}, "the axis of 'stay' has no such action"),
        ({"opposites": (Axis("go"), Axis("go"))}, "'go' is on two axes"),
        ({"actions": ("go", "stay"), "opposites": (Axis("go"),)}, "'stay' is on no axis"),
        ({"opposites": (Axis("go", None, "aheda"),)}, "measured as one of counted, ahead, left, not 'aheda'"),
    ],
)
def test_what_makes_no_domain_is_refused(fields: dict[str, Any], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        Domain(**{"name": "x", "actions": ("go",), "perceptions": ("a",), "world": "x:WORLD", **fields})


def test_a_thing_may_be_called_like_an_action() -> None:
    assert Domain("x", ("Demon",), ("a",), "x:WORLD", things=("demon2", "Demon")).things


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (
            "\nWORLD = ",
            "\nWRLD = ",
            "cannot be loaded: AttributeError: module 'own_world' has no attribute 'WORLD'",
        ),
        ("random_scene, (32, 32)", "random_scene, (40, 40)", "says that a view is uint8 of (40, 40)"),
        ("\nWORLD = ", "\nWORLD = (", "cannot be loaded: SyntaxError"),
        ("    def state(self)", "    def stat(self)", "fails on a random scene: TypeError"),
        ("np.full((32, 32), 255, np.uint8), PALETTE", "north_up * 0, PALETTE * 0", "shows black pixels"),
        ("Scene(Pose(*places[0], 0)", "Scene(Pose(0.5, 0, 0)", "expected a whole number, found 0.5"),
    ],
)
def test_a_world_that_does_not_do_is_one_line(tmp_path: Path, old: str, new: str, what: str) -> None:
    packages = install(tmp_path)
    text = (tmp_path / "own_world.py").read_text()
    assert old in text
    (tmp_path / "own_world.py").write_text(text.replace(old, new))
    words = ("generate", tmp_path / "data", "--tasks", 5, "--seed", 0)
    done = run("vacuum", "-m", "evaps", *words, packages=packages)
    assert done.returncode == 2
    assert what in done.stderr
    assert done.stderr.count("\n") == 1


def test_every_action_has_its_axis() -> None:
    for domain in DOMAINS.values():
        named = [a for axis in domain.axes for a in (axis.onwards, axis.back) if a is not None]
        assert sorted(named) == sorted(domain.actions)
    assert Domain("x", ("go",), ("a",), "x:WORLD").axes == (Axis("go"),)
    assert DOOM.spelt("MOVE_LEFT") == "move_left"
