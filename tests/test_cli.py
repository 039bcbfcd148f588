"""The command line as a user meets it: what it prints, its exit status, its one line about what is wrong."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from evaps.cli.command import Command, exit_status
from evaps.dsl import Program, UserError, run
from evaps.robots.base import EngineError, Scene, SceneError
from evaps.robots.doom import DoomRobot
from evaps.tasks.task import TaskError, load_task

EVAPS = str(Path(sys.executable).with_name("evaps"))  # the installed command
PROGRAM = "DEF run m( WHILE c( not c( INTARGET Demon c) c) w( TURN_LEFT w) ATTACK m)"
ENDLESS = (
    "DEF run m( WHILE c( not c( ISTHERE Demon c) c) w( TURN_LEFT w) WHILE c( ISTHERE Demon c) w( ATTACK w) m)"
)


def scene(y: int = 280, things: bool = True) -> dict[str, Any]:
    demon = {"kind": "Demon", "x": -100, "y": 300}
    return {"robot": {"x": -300, "y": y, "heading": 0}, "things": [demon] if things else []}


def evaps(*args: object, folder: Path, stdin: str | bytes = "") -> subprocess.CompletedProcess[str]:
    """Run the command in a folder."""
    command = [EVAPS, *map(str, args)]
    content = stdin.encode() if isinstance(stdin, str) else stdin
    done = subprocess.run(command, cwd=folder, input=content, capture_output=True, timeout=120)
    return subprocess.CompletedProcess(command, done.returncode, done.stdout.decode(), done.stderr.decode())


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with programs and scenes, right and wrong ones."""
    path = tmp_path_factory.mktemp("cli")
    scenes = [scene(280 + i) for i in range(5)]
    files = {
        "program": PROGRAM,
        "half": "DEF run m( ATTACK",
        "deep": f"DEF run m( {'WHILE c( ISTHERE Demon c) w( ' * 25}ATTACK{' w)' * 25} m)",
        "binary": b"DEF run\n\xff",
        "scene": json.dumps(scene()),
        "unknown": json.dumps({**scene(), "colour": 1}),
        "overlap": json.dumps({**scene(), "things": [{"kind": "Clip", "x": -300, "y": 280}]}),
        "broken": '{"robot":\n {]}',
        "scenes": json.dumps(scenes),
        "four": json.dumps(scenes[:4]),
        "third-is-empty": json.dumps([*scenes[:2], scene(things=False), *scenes[3:]]),
        "third-is-wrong": json.dumps([*scenes[:2], scene(y=90), *scenes[3:]]),
    }
    for name, content in files.items():
        (path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


class TestOnTheEngine:
    def test_run_prints_what_a_run_in_this_process_shows(self, folder: Path) -> None:
        done = evaps("run", "--program", "program", "--scene", "scene", "--json", folder=folder)
        assert (done.returncode, done.stderr) == (0, "")
        robot = DoomRobot()
        robot.reset(Scene.from_json(scene()))
        trace = run(Program.parse(PROGRAM), robot)
        first, last = trace.observations[0], trace.observations[-1]
        assert (last.rgb.shape, last.depth.shape) == ((120, 160, 3), (120, 160))
        found = json.loads(done.stdout)
        final = found.pop("final")
        assert found == {
            "halted": True,
            "actions": ["TURN_LEFT", "ATTACK"],
            "rgb_sha256": hashlib.sha256(last.rgb.tobytes()).hexdigest(),
            "depth_sha256": hashlib.sha256(last.depth.tobytes()).hexdigest(),
            "first_rgb_sha256": hashlib.sha256(first.rgb.tobytes()).hexdigest(),
            "first_depth_sha256": hashlib.sha256(first.depth.tobytes()).hexdigest(),
        }
        assert final == robot.state().to_json()
        robot.close()
        assert list(final) == ["x", "y", "heading", "ammo", "health", "things"]
        assert [list(thing) for thing in final["things"]] == [["kind", "alive", "x", "y"]]
        assert (final["ammo"], final["things"][0]["alive"]) == (49, False)

    def test_run_reads_standard_input_and_sums_up(self, folder: Path) -> None:
        python = Program.parse(PROGRAM).to_python()
        done = evaps("run", "--program", "-", "--scene", "scene", folder=folder, stdin=python)
        assert (done.returncode, done.stderr) == (0, "")
        for part in (python, "halted: 2 actions", "TURN_LEFT ATTACK", "ammunition 49", "Demon"):
            assert part in done.stdout

    def test_a_run_can_be_filmed(self, folder: Path) -> None:
        done = evaps("run", "--program", "program", "--scene", "scene", "--film", "a.gif", folder=folder)
        assert (done.returncode, done.stderr) == (0, "")
        assert (folder / "a.gif").read_bytes().startswith(b"GIF89a")

    @pytest.mark.parametrize(
        ("form", "start"), [("python", '"""A robot program'), ("behavior-tree", "<?xml")]
    )
    def test_export_writes_to_a_file_and_to_standard_output(
        self, folder: Path, form: str, start: str
    ) -> None:
        shown = evaps("export", "--program", "-", "--to", form, folder=folder, stdin=PROGRAM)
        assert shown.stdout.startswith(start)
        evaps("export", "--program", "-", "--to", form, "--out", "out/file", folder=folder, stdin=PROGRAM)
        assert (folder / "out" / "file").read_text() == shown.stdout

    def test_doctor_finds_this_machine_well(self, folder: Path) -> None:
        done = evaps("doctor", "--json", folder=folder)
        assert (done.returncode, done.stderr) == (0, "")
        found = {row["what"]: row for row in map(json.loads, done.stdout.splitlines())}
        assert all(row["well"] for row in found.values() if row["needed"])
        assert "120 x 160" in found["engine"]["found"]

    def test_what_is_said_beside_results_is_more_or_nothing(self, folder: Path) -> None:
        task = Path(__file__).parents[1] / "examples" / "tasks" / "look-around"
        told = {
            how: evaps(*how.split(), "synthesize", task, "--json", folder=folder).stderr
            for how in ("", "--quiet", "--verbose")
        }
        assert told[""] == told["--quiet"] == ""
        assert "programs pass all examples" in told["--verbose"]

    def test_a_run_that_does_not_halt_is_no_error(self, folder: Path) -> None:
        done = evaps("run", "--program", "-", "--scene", "overlap", folder=folder, stdin=ENDLESS)
        assert done.returncode == 2, "the scene is refused before the engine starts"
        (folder / "empty").write_text(json.dumps(scene(things=False)))
        done = evaps("run", "--program", "-", "--scene", "empty", "--json", folder=folder, stdin=ENDLESS)
        found = json.loads(done.stdout)
        assert (done.returncode, found["halted"], found["actions"]) == (0, False, ["TURN_LEFT"] * 20)

    def test_make_task_writes_a_task_that_can_be_loaded(self, folder: Path) -> None:
        arguments = ("make-task", "--program", "program", "--scenes", "scenes", "--out", "new/task")
        done = evaps(*arguments, folder=folder)
        assert (done.returncode, done.stderr) == (0, "")
        task = load_task(folder / "new" / "task")
        assert (task.name, len(task.examples)) == ("task", 5)
        shown = evaps("run", "--program", "program", "--scene", "scene", "--json", folder=folder)
        goal = hashlib.sha256(task.examples[0].goal.rgb.tobytes()).hexdigest()
        assert json.loads(shown.stdout)["rgb_sha256"] == goal
        assert not [p for p in (folder / "new").iterdir() if p.name != "task"]
        again = evaps(*arguments, folder=folder)
        assert (again.returncode, "exists already" in again.stderr) == (2, True)

    def test_make_task_says_which_scene_does_not_do(self, folder: Path) -> None:
        arguments = ("make-task", "--program", "program", "--out", "none", "--scenes")
        done = evaps(*arguments, "third-is-empty", folder=folder)
        assert done.returncode == 2
        assert done.stderr.startswith("evaps: scenes[2]: the program does not halt within 20 actions")
        assert not [p for p in folder.iterdir() if "none" in p.name]

    def test_a_loaded_task_must_have_valid_scenes(self, folder: Path) -> None:
        evaps("make-task", "--program", "program", "--scenes", "scenes", "--out", "bent", folder=folder)
        path = folder / "bent" / "task.json"
        value = json.loads(path.read_text())
        value["examples"][1]["scene"]["things"] *= 2
        path.write_text(json.dumps(value))
        with pytest.raises(TaskError, match=r"examples\[1\]\.scene: Demon at .* overlap"):
            load_task(path.parent)

    def test_ctrl_c_stops_generate_soon(self, folder: Path) -> None:
        command = [EVAPS, "generate", "data", "--workers", "1"]
        job = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, start_new_session=True)
        until = time.monotonic() + 60
        while not (folder / "data" / "dataset.json").exists() and time.monotonic() < until:
            time.sleep(0.1)
        time.sleep(1)
        os.killpg(job.pid, signal.SIGINT)
        error = job.communicate(timeout=60)[1]
        assert job.returncode == 130
        assert error == "evaps: stopped; nothing is lost: the same command goes on where it was\n"


INTERRUPTED_IN_IMPORT = """
import multiprocessing, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "evaps.cli.main":
            raise KeyboardInterrupt

if __name__ in ("__mp_main__", sys.argv[1]):
    sys.meta_path.insert(0, Interrupting())
    import evaps.cli
worker = multiprocessing.get_context("spawn").Process(target=print)
worker.start()
worker.join()
sys.exit(worker.exitcode)
"""


@pytest.mark.parametrize(("interrupted", "said"), [("__main__", "evaps: stopped\n"), ("worker", "")])
def test_ctrl_c_while_it_is_loaded_is_told_once(tmp_path: Path, interrupted: str, said: str) -> None:
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED_IN_IMPORT)
    done = subprocess.run([sys.executable, script, interrupted], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, said)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("run --scene scene --program none", "none is missing; check the name"),
        ("run --scene scene --program .", ". is a folder; name a file"),
        ("run --scene scene --program binary", "binary is not UTF-8 text: byte 0xff in line 2"),
        ("run --scene scene --program half", "half: line 1, column 18: found the end of the text, expected"),
        ("run --scene scene --program -", "standard input: line 1, column 1: found"),
        ("run --program program --scene none", "none is missing; check the name"),
        ("run --program program --scene program/x", "program/x is missing; a part of this path is a file"),
        ("run --program program --scene broken", "broken is not JSON: line 2, column 3: "),
        ("run --program program --scene unknown", "unknown: a scene: unknown key 'colour'; known are"),
        ("run --program program --scene overlap", "overlap: the robot at (-300, 280) and Clip at"),
        (
            "make-task --out x --program program --scenes scene",
            "scene: expected a list of exactly 5 scenes, found no",
        ),
        (
            "make-task --out x --program program --scenes four",
            "four: expected a list of exactly 5 scenes, found a",
        ),
        (
            "make-task --out x --program program --scenes third-is-wrong",
            "third-is-wrong: scenes[2]: the robot: y must",
        ),
        ("generate x --tasks 0", "--tasks must be at least 1, not 0"),
        ("generate x --seed -1", "--seed must be at least 0, not -1"),
        ("generate x --address here", "--address is that of a Ray cluster; it needs --engine ray"),
        ("data info x", "x holds no complete data set; make one with: evaps generate x"),
        ("data info scene --check -1", "--check must be at least 0, not -1"),
        ("bench --seconds 0", "--seconds must be more than 0, not 0"),
        ("synthesize task --seconds nan", "--seconds must be more than 0, not nan"),
        ("synthesize task --seed -1", "--seed must be at least 0, not -1"),
        (
            "train verified --data scene --out x",
            "'verified' is a search, which is not trained; train what it uses",
        ),
        ("export --program deep", "Python cannot nest as deep as this program does; try: --to behavior-tree"),
        ("generate .", ". is not empty and no data set; choose another folder"),
        ("generate scene", "scene cannot be written: "),
        ("--tyro-write-completion bash none/here", "none/here: No such file or directory; is there such a"),
    ],
)
def test_a_users_error_is_one_clear_line(folder: Path, arguments: str, message: str) -> None:
    done = evaps(*arguments.split(), folder=folder, stdin="?")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"evaps: {message}")
    assert done.stderr.count("\n") == 1
    assert not (folder / "x").exists()


@pytest.mark.parametrize("arguments", ["", "run", "dance", "run --program program --scene scene --jso"])
def test_wrong_arguments_are_refused(folder: Path, arguments: str) -> None:
    done = evaps(*arguments.split(), folder=folder)
    assert done.returncode == 2
    assert done.stderr.startswith("evaps: ")
    assert len(done.stderr.splitlines()) == 1


def test_it_says_which_version_it_is(folder: Path) -> None:
    assert evaps("--version", folder=folder).stdout == f"evaps {version('evaps')}\n"


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    command = f"{sys.executable} -m evaps generate --help | head -c 1"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr) == ("u", "")


def test_debug_shows_where(folder: Path) -> None:
    done = evaps("--debug", "run", "--program", "none", "--scene", "scene", folder=folder)
    assert done.returncode == 2
    assert done.stderr.startswith("Traceback")
    assert done.stderr.splitlines()[-1] == "evaps: none is missing; check the name"


class Raises(Command):
    def __init__(self, error: BaseException) -> None:
        self.error = error

    def run(self) -> None:
        raise self.error


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (UserError("two\nlines"), 2, "evaps: two lines"),
        (SceneError("no such scene"), 2, "evaps: no such scene"),
        (EngineError("the engine has died"), 1, "evaps: the engine has died"),
        (KeyError("x"), 1, "evaps: unexpected KeyError: 'x' (evaps --debug COMMAND ... shows where)"),
        (KeyboardInterrupt(), 130, "evaps: stopped"),
    ],
)
def test_every_end_has_its_status(
    error: BaseException, status: int, line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert exit_status(Raises(error)) == status
    assert capsys.readouterr() == ("", line + "\n")
