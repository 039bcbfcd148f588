"""What the studio's page is told, on the real engine with the shipped checkpoints."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from itertools import count
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import httpx
import pytest
from engine_processes import find_engines
from fastapi.testclient import TestClient

from evaps.dsl import run
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.robots.doom import DoomRobot
from evaps.robots.frames import frame_match
from evaps.robots.memo import MemoRobot
from evaps.studio.forms import TaskForm, example_json, read_task
from evaps.studio.guard import MOST_BYTES
from evaps.tasks.dataset import split_of
from evaps.tasks.generate import generate_task
from evaps.tasks.task import load_task

from .conftest import TASKS

pytestmark = pytest.mark.slow

SCENE = {"robot": {"x": -300, "y": 288, "heading": 0}, "things": [{"kind": "Demon", "x": -100, "y": 300}]}
PROGRAM = "def run():\n    if in_target(Demon):\n        attack()\n    turn_left()\n"


def task(client: TestClient, index: int = 0) -> dict[str, Any]:
    found: dict[str, Any] = client.get(f"/api/tasks/{TASKS[index].name}").json()
    return found


def lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def test_the_page_and_its_parts_are_there(client: TestClient) -> None:
    assert "evaps studio" in client.get("/").text
    assert "javascript" in client.get("/studio.js").headers["content-type"]
    assert "text/css" in client.get("/studio.css").headers["content-type"]
    assert client.get("/secret.txt").status_code == 404


def test_who_can_answer_is_who_has_a_checkpoint(client: TestClient) -> None:
    methods = client.get("/api/facts").json()["methods"]
    assert methods[0] == "verified"
    assert {"evaps", "lgrl"} < set(methods)
    assert "sed" not in methods


def test_a_random_task_is_one_that_no_method_has_learned_from(client: TestClient) -> None:
    drawn = client.post("/api/random-task").json()
    seed = int(drawn["name"].removeprefix("random-"))
    with closing(DoomRobot()) as robot:
        memo = MemoRobot(robot, PERCEPTION_KEYS, eager=False)
        drafts = (generate_task(seed, index, memo) for index in count())
        draft = next(d for d in drafts if split_of(d.program) == "test")
        assert [e["scene"] for e in drawn["examples"]] == [s.to_json() for s in draft.scenes[:5]]
        form = TaskForm.model_validate(drawn)
        for example in read_task(form, robot).examples:
            robot.reset(example.scene)
            run(draft.program, robot)
            assert frame_match(robot.observe(), example.goal)


def test_a_scene_is_shown(client: TestClient) -> None:
    (moment,) = client.post("/api/run", json={"scene": SCENE}).json()["moments"]
    assert moment["rgb"].startswith("data:image/png;base64,")
    assert set(moment["perceived"]) == {"ISTHERE Demon", "INTARGET Demon"}
    assert moment["state"]["x"] == -300


def test_a_run_tells_which_lines_are_at_work(client: TestClient) -> None:
    run = client.post("/api/run", json={"scene": SCENE, "program": PROGRAM}).json()
    assert run["actions"] == ["ATTACK", "TURN_LEFT"]
    assert [moment["lines"] for moment in run["moments"]] == [[1, 2], [3], []]
    assert [thing["alive"] for thing in run["moments"][-1]["state"]["things"]] == [False]


def test_a_wrong_program_is_told_where(client: TestClient) -> None:
    error = client.post("/api/check", json={"program": "def run():\n    jump()\n"}).json()["error"]
    assert (error["line"], error["column"]) == (2, 5)
    assert client.post("/api/check", json={"program": PROGRAM}).json()["python"] == PROGRAM


@pytest.mark.parametrize(
    ("path", "form", "status", "words"),
    [
        ("run", {"scene": {"robot": {"x": 0}}}, 422, "the key 'things' is missing"),
        ("run", {"scene": {**SCENE, "robot": {"x": 900, "y": 288, "heading": 0}}}, 422, "x must be"),
        ("run", {"scene": SCENE, "program": "def"}, 422, "line 1"),
        ("run", {"scene": SCENE, "speed": 3}, 422, "speed"),
        ("check", {"program": "x" * 20_000}, 422, "program"),
        ("synthesize", {"examples": [{"scene": SCENE}] * 4}, 422, "examples"),
        ("synthesize", {"examples": [{"scene": SCENE}] * 5}, 422, "example 1: it has no goal"),
        (
            "task.zip",
            {"name": "../up", "examples": [{"scene": SCENE, "program": PROGRAM}] * 5},
            422,
            "name: begin with a letter or digit",
        ),
    ],
)
def test_what_is_wrong_is_one_line(
    client: TestClient, path: str, form: dict[str, Any], status: int, words: str
) -> None:
    reply = client.post(f"/api/{path}", json=form)
    assert reply.status_code == status
    assert words in reply.json()["error"]
    assert "\n" not in reply.json()["error"]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 421),
        ({"Host": "evil.example:80"}, 421),
        ({"Host": "evil@localhost"}, 421),
        ({"Host": "localhost/evil"}, 421),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Content-Length": str(MOST_BYTES + 1)}, 413),
    ],
)
def test_strangers_are_refused(client: TestClient, headers: dict[str, str], status: int) -> None:
    reply = client.post("/api/run", content=json.dumps({"scene": SCENE}), headers=headers)
    assert reply.status_code == status
    assert client.post("/api/run", json={"scene": SCENE}, headers={"Origin": "http://localhost"}).is_success


def test_pictures_come_back_as_they_were(client: TestClient) -> None:
    loaded = load_task(TASKS[0])
    form = TaskForm.model_validate({"examples": [example_json(e) for e in loaded.examples]})
    for before, after in zip(loaded.examples, read_task(form, DoomRobot()).examples, strict=True):
        assert before.scene == after.scene
        assert (before.goal.rgb == after.goal.rgb).all()
        assert (before.goal.depth == after.goal.depth).all()


def test_a_task_is_saved_as_a_folder_that_can_be_loaded(client: TestClient, tmp_path: Path) -> None:
    form = {"name": "my task", "examples": [{"scene": SCENE, "program": PROGRAM}] * 5}
    reply = client.post("/api/task.zip", json=form)
    ZipFile(io.BytesIO(reply.content)).extractall(tmp_path)
    saved = load_task(tmp_path / "my task")
    shown = client.post("/api/run", json={"scene": SCENE, "program": PROGRAM}).json()
    assert example_json(saved.examples[0])["goal_rgb"] == shown["moments"][-1]["rgb"]


def test_a_search_is_told_live_and_ends_in_a_report(client: TestClient) -> None:
    job, *news, answer = lines(client.post("/api/synthesize", json=task(client)).text)
    told = [line for line in news if line]
    assert all(len(line["passed"]) == 5 for line in told)
    assert told[-1]["passed"] == [True] * 5
    assert answer["solved"]
    assert answer["candidates"][0]["python"].startswith("def run():")
    assert TASKS[0].name in client.get(f"/api/report/{job['job']}").text
    assert client.get("/api/report/other").status_code == 404


def hard_task(method: str = "verified") -> dict[str, Any]:
    """Nothing explains these, and the ways are long: a search does not end by itself."""
    turns = ["def run():\n" + "    turn_left()\n" * n for n in (16, 17, 18, 19, 20)]
    return {
        "method": method,
        "seconds": 300,
        "actions": 100_000,
        "examples": [{"scene": SCENE, "program": text} for text in turns],
    }


@pytest.mark.parametrize("method", ["verified", "enumeration", "blind"])
def test_a_search_can_be_stopped_and_there_is_one_at_a_time(address: str, method: str) -> None:
    with httpx.stream("POST", f"{address}api/synthesize", json=hard_task(method), timeout=120) as reply:
        said = reply.iter_lines()
        job = json.loads(next(said))["job"]
        second = httpx.post(f"{address}api/synthesize", json=hard_task(), timeout=120)
        assert (second.status_code, "under way" in second.json()["error"]) == (503, True)
        assert httpx.post(f"{address}api/stop/{job}", json={}).json() == {"stopped": True}
        answer = [json.loads(line) for line in said][-1]
    assert answer["stopped"]
    assert answer["seconds"] < 60


def test_ctrl_c_ends_the_studio_and_what_it_searches_for() -> None:
    command = [sys.executable, "-m", "evaps", "studio", "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as studio:
        assert studio.stdout is not None
        address = studio.stdout.readline().split()[2]
        with httpx.stream("POST", f"{address}api/synthesize", json=hard_task(), timeout=120) as reply:
            said = reply.iter_lines()
            next(line for line in said if "ways" in line)
            studio.send_signal(signal.SIGINT)
            assert json.loads([line for line in said if line][-1])["stopped"]
        _, complaint = studio.communicate(timeout=60)
    assert "Traceback" not in complaint
    assert "ERROR" not in complaint


def test_a_search_that_nobody_listens_to_ends(address: str) -> None:
    with httpx.stream("POST", f"{address}api/synthesize", json=hard_task(), timeout=120) as reply:
        next(reply.iter_lines())
    deadline = time.monotonic() + 60
    while httpx.post(f"{address}api/synthesize", json={**hard_task(), "seconds": 0.1}).status_code == 503:
        assert time.monotonic() < deadline
        time.sleep(0.5)


def test_an_engine_that_dies_is_replaced_and_that_is_told(client: TestClient) -> None:
    form = {"scene": SCENE, "program": PROGRAM}
    before = [client.post("/api/run", json=form).json() for _ in range(2)]
    dead = client.get("/api/health").json()["engines_replaced"]
    for engine in find_engines(os.getpid()):
        os.kill(engine, signal.SIGKILL)
    assert [client.post("/api/run", json=form).json() for _ in range(2)] == before
    assert client.get("/api/health").json()["engines_replaced"] > dead
