"""A recipe that cannot do what it was asked for says so in one line, before any work."""

from collections.abc import Callable
from pathlib import Path

import pytest

from evaps.dsl import UserError
from evaps.models import SHIPPED
from evaps.models.checkpoint import hash_of
from recipes.command import start
from recipes.paper import Plan, make, make_checkpoint


def interrupted() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("recipe", "status", "message"),
    [
        (
            lambda: make(Plan("smoke", methods=("foo",))),
            2,
            "evaps: there is no method 'foo'; known are lgrl, ",
        ),
        (
            lambda: make(Plan("big")),
            2,
            "evaps: there is no scale 'big'; known are smoke, quick, small, paper",
        ),
        (lambda: make(Plan("smoke", methods=("naive",), ship=True)), 2, "evaps: --ship is for encoder, "),
        (interrupted, 130, "evaps: stopped"),
    ],
)
def test_a_recipe_ends_with_one_line(
    recipe: Callable[[], None], status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        start(recipe)
    assert ended.value.code == status
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(message)


def test_an_unknown_method_is_refused_with_the_plan() -> None:
    with pytest.raises(UserError, match="no method 'foo'"):
        Plan(methods=("lgrl", "foo"))


def test_a_frozen_encoder_is_the_one_that_comes_with_evaps(tmp_path: Path) -> None:
    plan = Plan("paper", frozen=True, root=tmp_path)
    for seed in (0, 1):
        make_checkpoint(plan, seed, "encoder")
        assert hash_of(plan.runs(seed) / "encoder") == hash_of(SHIPPED / "small" / "encoder")
    assert "frozen" in plan.results.name  # beside rows of an encoder of the scale's own
