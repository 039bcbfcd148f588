"""From nothing to an answer: data, all trainings, evaluation and synthesis at the smoke scale."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch
from safetensors.torch import load_file

from evaps import models
from evaps.dsl import Program, UserError
from evaps.dsl.sampler import PERCEPTION_KEYS
from evaps.evaluate import EvaluationPart, Setting, _facts, evaluate, evaluate_part, match
from evaps.metrics import Results
from evaps.models import SHIPPED, Model, load_model, new_method
from evaps.models.checkpoint import CheckpointError, hash_of, read_config, save_checkpoint
from evaps.models.encoder import Encoder, EncoderConfig
from evaps.robots.base import Scene, WorldState
from evaps.robots.doom import DoomRobot
from evaps.robots.memo import MemoRobot
from evaps.robots.workers import Workers
from evaps.synthesis import Solution, solve
from evaps.tasks.dataset import Dataset, task_parts
from evaps.tasks.frames import pack_frames, unpack_frames
from evaps.tasks.task import Task
from evaps.train import train
from evaps.train.scale import SCALES
from recipes.ablation import Ablation
from recipes.ablation import main as make_ablation
from recipes.gallery import Gallery
from recipes.gallery import main as make_gallery
from recipes.paper import Plan, make
from recipes.result import read_result
from recipes.rewards import main as make_rewards

ROOT = Path(__file__).parents[1]
EVAPS = str(Path(sys.executable).with_name("evaps"))
TIMES = ("seconds",)
VERDICTS = {
    "exact",
    *(f"{kind}_{of}" for kind in ("semantic", "generalization") for of in ("state", "frame")),
}
METHODS = ("lgrl", "evaps", "inferred-trace", "verified")
ACTIONS = 150  # that a search may simulate
UNTRAINED = (
    *("transformer", "sed", "naive", "evaps-o", "evaps-s", "evaps-parallel", "evaps-substitution"),
    "evaps-no-goal",
)
FURTHER = ("sed-search", "inferred-trace+evaps", "verified-with-repairs", "enumeration", "blind", "prior")
TRAINED = ("lgrl", "lgrl-rl", "inferred-trace", "latent-execution", "evaps")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    """Everything that the recipe makes at the smoke scale, for some of the methods."""
    plan = Plan("smoke", methods=TRAINED, tasks=2, workers=0, root=tmp_path_factory.mktemp("pipeline"))
    make(plan)
    return plan


@pytest.fixture(scope="module")
def data(plan: Plan) -> Path:
    return plan.data


@pytest.fixture(scope="module")
def model(plan: Plan) -> Path:
    return plan.runs(0)


def test_the_recipe_makes_rows_curves_tables_and_figures(plan: Plan) -> None:
    rows = plan.results / "methods"
    assert {path.stem for path in rows.glob("*.parquet")} == {f"{method}-0" for method in TRAINED}
    parts = ("latent-execution-retrained", "inferred-trace-policy")
    curves = {path.stem for path in (rows / "curves").glob("*.jsonl")}
    assert curves == {f"{name}-0" for name in (*TRAINED, *parts)}
    made = {path.name for path in (plan.results / "report").iterdir()}
    assert {
        "table-1.md",
        "table-1.tex",
        "table-2.csv",
        "complexity.png",
        "rounds.svg",
        "learning.png",
    } <= made
    table = (plan.results / "report" / "table-1.md").read_text()
    assert "Inferred Trace" in table
    assert "scale smoke" in table


def test_the_recipe_makes_nothing_again(plan: Plan) -> None:
    files = [*plan.runs(0).rglob("*"), *(plan.results / "methods").rglob("*.parquet")]
    before = {path: path.stat().st_mtime_ns for path in files if path.is_file()}
    make(plan)
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_the_encoder_is_trained_on_with_programs(model: Path) -> None:
    facts = json.loads((model / "encoder" / "config.json").read_text())["facts"]
    assert facts["tuning"]["fit"]["steps"] == SCALES["smoke"].tuning_steps
    assert facts["tuning"]["metrics"].keys() >= {"validation_programs", "validation_counts"}
    before, after = (torch.load(model / "encoder" / f / "best.pt") for f in (".", "tuning"))
    saved = load_file(model / "encoder" / "model.safetensors")
    for name in ("convolutions.0.weight", "linear.weight"):
        assert torch.equal(saved[name], after[f"transitions.encoder.{name}"].half())
        assert not torch.equal(saved[name], before[f"encoder.{name}"].half())


def test_the_gallery_runs_what_the_rows_say_and_refuses_other_rows(plan: Plan, tmp_path: Path) -> None:
    rows = plan.results / "methods"
    gallery = Gallery(1, 0, rows, ("lgrl", "evaps"), plan.data, tmp_path / "gallery.html")
    make_gallery(gallery)
    page = gallery.out.read_text()
    assert all(text in page for text in ("LGRL", "EVAPS", "1 test tasks"))
    table = pq.read_table(rows / "lgrl-0.parquet")
    passed = pa.array([5 - n for n in table["pairs_passed"].to_pylist()], pa.int32())
    column = table.schema.get_field_index("pairs_passed")
    pq.write_table(table.set_column(column, "pairs_passed", passed), tmp_path / "lgrl-0.parquet")
    with pytest.raises(UserError, match="the rows of lgrl are of another task-"):
        make_gallery(replace(gallery, rows=tmp_path, methods=("lgrl",)))


def test_the_ablation_says_what_parts_are_worth_with_and_without_the_lstm(
    plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("naive", "evaps"):
        monkeypatch.setitem(models.METHODS, f"{name}-alone", models.METHODS[name])  # taken back in the end
    make_ablation(Ablation(("naive", "evaps"), 0, judge=True, plan=plan))
    found = read_result(plan.results / "ablation.json")["repairers"]
    assert list(found) == ["naive", "naive-alone", "evaps", "evaps-alone"]
    more = found["evaps-alone"]["more than naive-alone"]
    assert more["mean"] == pytest.approx(
        found["evaps-alone"]["likelihood"] - found["naive-alone"]["likelihood"], abs=2e-4
    )
    assert more["low"] <= more["mean"] <= more["high"]
    lost = "lost with another example's observations"
    assert [name for name in found if lost in found[name]] == ["evaps", "evaps-alone"]
    judged = Results.read(plan.results / "methods" / "without-lstm")
    assert set(judged.methods) == set(found)
    weights = load_file(plan.runs(0) / "evaps-alone" / "model.safetensors")
    assert not any(name.startswith(("onwards", "backwards")) for name in weights)


def test_rewards_stand_beside_the_very_lgrl_that_they_start_from(plan: Plan) -> None:
    make_rewards(plan)
    both = plan.results / "methods" / "rewards"
    assert {path.name for path in both.iterdir()} == {"lgrl-0.parquet", "lgrl-rl-0.parquet"}
    for path in both.iterdir():
        programs = [pq.read_table(p, columns=["program", "weights"]) for p in (path, both.parent / path.name)]
        assert programs[0].equals(programs[1])


def test_another_seed_trains_the_method_and_shares_the_encoder(plan: Plan) -> None:
    make(replace(plan, seeds=(1,), methods=("lgrl",)))
    same = {
        name: hash_of(plan.runs(0) / name) == hash_of(plan.runs(1) / name)
        for name in ("encoder", "inverse", "lgrl")
    }
    assert same == {"encoder": True, "inverse": True, "lgrl": False}
    assert "2 seeds" in (plan.results / "report" / "table-1.md").read_text()


def test_each_training_needs_what_comes_before_it(data: Path, tmp_path: Path) -> None:
    for method in ("lgrl", "evaps"):
        with pytest.raises(CheckpointError, match="first: evaps train encoder"):
            train(method, data, tmp_path, "smoke")


def test_nothing_is_built_on_what_was_trained_with_another_encoder(data: Path, tmp_path: Path) -> None:
    save_checkpoint(tmp_path / "encoder", Encoder(EncoderConfig()), "encoder", {})
    (tmp_path / "inverse").symlink_to(SHIPPED / "small" / "inverse")
    with pytest.raises(CheckpointError, match="inverse was trained with another encoder than"):
        train("lgrl", data, tmp_path, "smoke")


def test_a_checkpoint_says_how_it_was_made(model: Path) -> None:
    facts = json.loads((model / "evaps" / "config.json").read_text())["facts"]
    assert (facts["scale"], facts["seed"], facts["dataset"]["seed"]) == ("smoke", 0, 0)
    assert facts["precision"] in ("bfloat16", "float32")
    assert (facts["fit"]["steps"], facts["sizes"]["mutations"]) == (8, 1)
    assert facts["made_from"] == {name: hash_of(model / name) for name in ("encoder", "inverse", "lgrl")}


def test_two_processes_train_a_repairer(data: Path, model: Path, tmp_path: Path) -> None:
    """One finds the mistakes, the same ones; both learn from them, and one writes the checkpoint."""
    shutil.copytree(data, tmp_path / "data", ignore=shutil.ignore_patterns("mistakes-*", "features-*"))
    for name in ("encoder", "inverse", "lgrl"):
        (tmp_path / name).symlink_to(model / name)
    launch = [sys.executable, "-m", "accelerate.commands.launch", "--cpu", "--num_processes", "2"]
    command = ["--main_process_port", "0", "-m", "evaps", "train", "naive", "--data", "data", "--out", "."]
    options = ["--scale", "smoke", "--workers", "0"]
    subprocess.run([*launch, *command, *options], cwd=tmp_path, check=True, timeout=300)
    made, alone = (sorted(folder.glob("mistakes-*/*")) for folder in (tmp_path / "data", data))
    assert [file.name for file in made] == [file.name for file in alone]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(made, alone, strict=True))
    steps = [
        json.loads(row)["step"] for row in (tmp_path / "naive" / "metrics.jsonl").read_text().splitlines()
    ]
    assert steps == sorted(set(steps))
    assert load_model(tmp_path, "naive").repairer is not None


def test_a_training_that_is_done_is_not_done_again(data: Path, model: Path) -> None:
    before = (model / "lgrl" / "model.safetensors").read_bytes()
    metrics = (model / "lgrl" / "metrics.jsonl").read_text()
    train("lgrl", data, model, "smoke")
    assert (model / "lgrl" / "model.safetensors").read_bytes() == before
    assert (model / "lgrl" / "metrics.jsonl").read_text() == metrics


def test_rewards_change_the_weights_and_the_best_are_kept(model: Path) -> None:
    start, end = (load_file(model / name / "model.safetensors") for name in ("lgrl", "lgrl-rl"))
    assert start.keys() == end.keys()
    facts = json.loads((model / "lgrl-rl" / "config.json").read_text())["facts"]
    assert all(start[key].equal(end[key]) for key in start) == (facts["metrics"]["best_step"] == -1)
    last = torch.load(model / "lgrl-rl" / "state.pt")["model"]
    assert any(not start[key].equal(last[key].half()) for key in start)
    rows = [json.loads(line) for line in (model / "lgrl-rl" / "metrics.jsonl").read_text().splitlines()]
    assert {"reward", "validation_semantic"} <= rows[-1].keys()
    looks = [row for row in rows if "validation_best_reward" in row]
    assert [row["step"] for row in looks] == [-1, 2]
    best = max(looks, key=lambda row: row["validation_score"])
    assert facts["metrics"]["best_step"] == best["step"]


def test_latent_execution_is_trained_once_more(model: Path) -> None:
    assert (model / "latent-execution" / "retrained" / "metrics.jsonl").exists()


def test_inferred_trace_says_how_often_its_policy_reaches_the_goals(model: Path) -> None:
    metrics = json.loads((model / "inferred-trace" / "config.json").read_text())["facts"]["metrics"]
    assert {"policy_reaches", "policy_reaches_in_training", "policy_right"} <= metrics.keys()


def test_a_dial_of_another_method_does_not_stand_in_the_way(
    data: Path, model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(SCALES, "smoke", replace(SCALES["smoke"], rl_steps=9, policy_tasks=3))
    train("lgrl", data, model, "smoke")
    monkeypatch.setitem(SCALES, "smoke", replace(SCALES["smoke"], synthesizer_batch=3))
    with pytest.raises(UserError, match="other settings"):
        train("lgrl", data, model, "smoke")


def test_another_seed_does_not_go_on_with_it(data: Path, model: Path) -> None:
    with pytest.raises(UserError, match="other settings"):
        train("lgrl", data, model, "smoke", seed=1)


def test_an_evaluation_is_the_same_again(data: Path, model: Path, tmp_path: Path) -> None:
    tasks = 2
    paths = [
        evaluate(
            data, tmp_path / f"{n}.parquet", str(model), METHODS, "test", tasks, 4, workers=w, actions=600
        )
        for n, w in enumerate((Workers(0), Workers(1)))
    ]
    one, two = (pq.read_table(path).drop_columns(TIMES).to_pylist() for path in paths)
    assert one == two
    for method in ("lgrl", "evaps", "inferred-trace"):
        assert sum(row["method"] == method for row in one) == 4 * tasks
    verified = [row for row in one if row["method"] == "verified"]
    assert len({row["task"] for row in verified}) == tasks
    assert all(row["budget"] == 600 for row in one)
    assert max(row["simulated_actions"] for row in verified) < 1_200, "a search ends soon after its budget"
    assert not list(tmp_path.glob("*.parts*"))
    for row in one:
        assert row["generalization_state"] <= row["semantic_state"]
        assert (row["pairs_passed"] == 5) == row["semantic_frame"]
        assert row["rounds"] <= (5 if row["method"] == "evaps" else 0)
        assert len(row["attempts"]) == row["rounds"] + 1
        assert row["attempts"][-1]["program"] == row["program"]


@pytest.fixture(scope="module")
def all_models(model: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What was trained, and the methods that were not, with random weights."""
    folder = tmp_path_factory.mktemp("models")
    for path in model.iterdir():
        (folder / path.name).symlink_to(path)
    facts = read_config(model / "evaps", "evaps")["facts"]
    for name in UNTRAINED:
        save_checkpoint(folder / name, new_method(name), name, facts)
    return folder


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_no_candidate_depends_on_what_methods_must_not_know(
    data: Path, all_models: Path, noise: float
) -> None:
    """Another hidden program, test scene, test goal, and other hidden states: byte for byte the same."""
    dataset, model = Dataset(data), all_models
    others = ("lgrl-rl", "latent-execution", *UNTRAINED, *FURTHER)
    methods = METHODS if noise else (*METHODS, *others)
    setting = Setting("test", noise, ACTIONS, top_k=4, most_rounds=2)
    facts = {method: _facts(str(model), method, dataset, setting) for method in methods}
    (part,) = task_parts(Path("none"), dataset, dataset.split("test")[:1], 1)
    part = part.loaded(dataset)
    row, frames = part.rows[0], list(unpack_frames(part.frames[0]))
    elsewhere = {**row, "program": "DEF run m( ATTACK m)", "scenes": [*row["scenes"][:5], row["scenes"][0]]}
    elsewhere["states"] = row["states"][::-1]
    hidden = [*frames[:5], frames[0], *frames[6:11], frames[1]]
    other = replace(part, rows=(elsewhere,), frames=(pack_frames(hidden),))
    found = []
    for tasks in (part, other):
        robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
        files = evaluate_part(robot, EvaluationPart(tasks, str(model), facts, setting))
        robot.close()
        table = pq.read_table(pa.BufferReader(files[tasks.path]))
        found.append(table.drop_columns(["seconds", "steps"]).to_pylist())
    for row in chain(*found):
        for key in VERDICTS:
            row.pop(key)
        for attempt in row["attempts"]:
            for key in VERDICTS & attempt.keys():
                attempt.pop(key)
    assert found[0] == found[1]
    assert {row["method"] for row in found[0]} == set(methods)
    golds = [next(iter(tasks.golds())) for tasks in (part, other)]
    robot = MemoRobot(DoomRobot(), PERCEPTION_KEYS)
    judged = [match(golds[0].program, gold, robot) for gold in golds]
    robot.close()
    assert [found.semantic_state for found in judged] == [True, False], "the verdicts do depend on it"


class SealedScene(Scene):
    """A scene that the robot can be put into, and in which nobody else sees where anything is."""

    def __getattribute__(self, name: str) -> Any:
        if name in ("robot", "things", "to_json"):
            reader = sys._getframe(1).f_globals["__name__"]
            assert reader.startswith("evaps.robots."), f"{reader} reads a scene's {name}"
        return super().__getattribute__(name)


class SealedRobot(MemoRobot):
    """A robot whose hidden state nobody may ask for while it is sealed."""

    sealed = False

    def state(self) -> WorldState:
        assert not self.sealed, "a method asks for the hidden state"
        return super().state()


def test_no_method_reads_a_scene_or_the_hidden_state(
    data: Path, all_models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def solve_sealed(model: Model, task: Task, robot: SealedRobot, *options: Any) -> Solution:
        scenes = [SealedScene(e.scene.robot, e.scene.things) for e in task.examples]
        examples = [replace(e, scene=scene) for e, scene in zip(task.examples, scenes, strict=True)]
        robot.sealed = True
        try:
            return solve(model, replace(task, examples=tuple(examples)), robot, *options)
        finally:
            robot.sealed = False

    monkeypatch.setattr("evaps.evaluate.solve", solve_sealed)
    dataset, setting = Dataset(data), Setting("test", 0.0, ACTIONS, top_k=4, most_rounds=2)
    methods = (*METHODS, "evaps-parallel", "sed", *FURTHER)
    facts = {method: _facts(str(all_models), method, dataset, setting) for method in methods}
    (part,) = task_parts(Path("none"), dataset, dataset.split("test")[:1], 1)
    robot = SealedRobot(DoomRobot(), PERCEPTION_KEYS)
    files = evaluate_part(robot, EvaluationPart(part.loaded(dataset), str(all_models), facts, setting))
    robot.close()
    assert set(pq.read_table(pa.BufferReader(files[part.path]))["method"].to_pylist()) == set(methods)


def test_an_evaluation_on_ray_is_the_same(
    data: Path, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [
        evaluate(data, tmp_path / f"{w.backend}.parquet", str(model), ("lgrl",), top_k=2, workers=w)
        for w in (Workers(0), Workers(2, "ray"))
    ]
    one, two = (pq.read_table(path).drop_columns(TIMES).to_pylist() for path in paths)
    assert one == two
    judged = len({row["task"] for row in one})
    assert f"has {judged} tasks; all of them are judged" in capsys.readouterr().err


def test_what_was_judged_is_not_judged_again_and_never_emptied(
    data: Path, model: Path, tmp_path: Path
) -> None:
    def rows_of(methods: tuple[str, ...], top_k: int) -> bytes:
        return evaluate(
            data, tmp_path / "rows.parquet", str(model), methods, tasks=1, top_k=top_k, workers=Workers(0)
        ).read_bytes()

    made = rows_of(("lgrl",), 2)
    assert rows_of(("lgrl",), 2) == made, "with the same seconds"
    with pytest.raises(UserError, match="no method to judge"):
        rows_of((), 2)
    assert (tmp_path / "rows.parquet").read_bytes() == made
    assert rows_of(("lgrl",), 3) != made


def test_a_synthesizer_is_judged_without_a_repairer(data: Path, model: Path, tmp_path: Path) -> None:
    alone = tmp_path / "alone"
    alone.mkdir()
    for name in ("encoder", "lgrl"):
        (alone / name).symlink_to(model / name)
    rows = evaluate(
        data, tmp_path / "rows.parquet", str(alone), ("lgrl",), tasks=1, top_k=2, workers=Workers(0)
    )
    assert pq.read_table(rows)["method"].to_pylist() == ["lgrl", "lgrl"]
    with pytest.raises(CheckpointError, match="evaps"):
        evaluate(data, tmp_path / "no.parquet", str(alone), ("lgrl", "evaps"), tasks=1, workers=Workers(0))


def test_synthesize_answers_in_json_and_writes_the_page(model: Path, tmp_path: Path) -> None:
    tasks = [ROOT / "examples" / "tasks" / name for name in ("look-around", "sidestep-and-shoot")]
    options = ["--model", model, "--json", "--report", tmp_path / "page.html", "--top-k", "3"]
    done = subprocess.run(
        [EVAPS, "synthesize", *map(str, [*tasks, *options])], capture_output=True, text=True, timeout=200
    )
    assert (done.returncode, done.stderr) == (0, "")
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert [answer["task"] for answer in answers] == [task.name for task in tasks]
    for answer in answers:
        passed = [candidate["pairs_passed"] for candidate in answer["candidates"]]
        assert passed == sorted(passed, reverse=True)
        assert answer["solved"] == (passed[0] == 5)
        assert all(Program.parse(candidate["program"]) for candidate in answer["candidates"])
        assert answer["simulated_actions"] > 0
    page = (tmp_path / "page.html").read_text()
    assert all(task.name in page for task in tasks)
    assert 'src="http' not in page


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--method", "nobody"], "no method 'nobody'"),
        (["--model", "nowhere"], "no checkpoint folder 'nowhere'"),
        (["--top-k", "0"], "--top-k must be at least 1"),
        (["--report", "/proc/none/page.html"], "cannot be written"),
    ],
)
def test_wrong_options_give_one_line_before_any_work(model: Path, options: list[str], message: str) -> None:
    task = ROOT / "examples" / "tasks" / "look-around"
    command = [EVAPS, "synthesize", str(task), "--model", str(model), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
