"""Domains: Karel and a robot of somebody else go through the same commands as the Doom robot.

A process has one domain, so each of these works in processes of its own.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from evaps.domain import DOMAINS, DOOM, VARIABLE, Axis, Domain

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


def run(domain: str, *words: object, packages: Path | None = None) -> subprocess.CompletedProcess[str]:
    """A command, in a domain."""
    there = {**os.environ, VARIABLE: domain, "OMP_NUM_THREADS": "1"}
    if packages is not None:
        there["PYTHONPATH"] = os.pathsep.join([str(packages), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run([sys.executable, *map(str, words)], env=there, capture_output=True, text=True)


def evaps(domain: str, *words: object, packages: Path | None = None) -> str:
    """What a command of evaps prints."""
    done = run(domain, "-m", "evaps", *words, packages=packages)
    assert done.returncode == 0, done.stderr
    return done.stdout


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
    Program.from_tokens(VOCAB.decode(tokens))
kinds = {token_type(token) for token in VOCAB.tokens}
assert kinds == {"pad", "action", "perception", "control", "bracket", "constant"}
"""


@pytest.mark.parametrize("name", sorted(DOMAINS))
def test_programs_of_every_domain_round_trip(name: str) -> None:
    done = run(name, "-c", PROPERTIES)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("name", "program"),
    [
        ("karel", "def run():\n    while front_is_clear():\n        move()\n    put_marker()\n"),
        ("karel-window", "def run():\n    turn_left()\n    if front_is_clear():\n        move()\n"),
        ("vacuum", "def run():\n    while not wall_east():\n        suck()\n        east()\n"),
    ],
)
def test_a_task_is_made_learned_from_and_solved(name: str, program: str, tmp_path: Path) -> None:
    """The same commands as in the Doom domain, on a smoke scale."""
    packages = install(tmp_path)

    def command(*words: object) -> str:
        return evaps(name, *words, packages=packages)

    data, runs, task = (tmp_path / part for part in ("data", "runs", "task"))
    command("generate", data, "--tasks", 100, "--seed", 0)
    assert "0 of them differ" in command("data", "info", data, "--check", 5)
    for method in ("encoder", "inverse", "lgrl", "evaps"):
        command("train", method, "--data", data, "--out", runs, "--scale", "smoke")
    methods = ("lgrl", "evaps", "verified")
    rows = tmp_path / "rows.parquet"
    table = command(
        "evaluate", "--data", data, "--model", runs, "--out", rows, "--tasks", 3, "--methods", *methods
    )
    assert table.count("\n|") == 4
    command("report", "table-1", "--rows", rows, "--out", tmp_path / "report")

    code = "import json, numpy; from evaps.robots.world import world; rng = numpy.random.default_rng(1);"
    code += "print(json.dumps([world().random_scene(rng).to_json() for _ in range(5)]))"
    (tmp_path / "scenes.json").write_text(run(name, "-c", code, packages=packages).stdout)
    (tmp_path / "program.py").write_text(program)
    command(
        "make-task", "--program", tmp_path / "program.py", "--scenes", tmp_path / "scenes.json", "--out", task
    )
    page = tmp_path / "page.html"
    solution = json.loads(
        command("synthesize", task, "--model", runs, "--seconds", 60, "--json", "--report", page)
    )
    assert solution["solved"]
    assert page.stat().st_size > 10_000
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps(json.loads((tmp_path / "scenes.json").read_text())[0]))
    film = tmp_path / "film.png"
    command("run", "--program", tmp_path / "program.py", "--scene", scene, "--film", film)
    assert film.read_bytes().startswith(b"\x89PNG")

    elsewhere = run("doom", "-m", "evaps", "data", "info", data)
    assert elsewhere.returncode == 2
    assert f"is of the robot '{name}-v0', and this is the domain doom" in elsewhere.stderr
    elsewhere = run(
        "doom", "-m", "evaps", "synthesize", ROOT / "examples/tasks/turn-and-shoot", "--model", runs
    )
    assert elsewhere.returncode == 2
    assert f"is of the domain '{name}', and this is 'doom'; set EVAPS_DOMAIN={name}" in elsewhere.stderr
    assert elsewhere.stderr.count("\n") == 1


def test_the_guide_names_what_is_there() -> None:
    assert sum(len(file.read_text().splitlines()) for file in EXAMPLES) < 70
    assert len(EXAMPLES[1].read_text().splitlines()) < 60
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
    ("actions", "perceptions", "what"),
    [
        ((), ("a",), "a list of words is empty"),
        (("go",), (), "a list of words is empty"),
        (("go", "go"), ("a",), "'go' is no name, or stands there twice"),
        (("go on",), ("a",), "'go on' is no name"),
    ],
)
def test_words_that_make_no_language_are_refused(
    actions: tuple[str, ...], perceptions: tuple[str, ...], what: str
) -> None:
    with pytest.raises(ValueError, match=what):
        Domain("x", actions, perceptions, "x:WORLD")


def test_every_action_has_its_axis() -> None:
    for domain in DOMAINS.values():
        named = [a for axis in domain.axes for a in (axis.onwards, axis.back) if a is not None]
        assert sorted(named) == sorted(domain.actions)
    assert Domain("x", ("go",), ("a",), "x:WORLD").axes == (Axis("go"),)
    with pytest.raises(ValueError, match="each action has to be on one axis: 'stay'"):
        Domain("x", ("go", "stay"), ("a",), "x:WORLD", opposites=(Axis("go"),))
    assert DOOM.spelt("MOVE_LEFT") == "move_left"
