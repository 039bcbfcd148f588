"""The import direction between the rooms of the package, and what a light import may load."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "evaps"

# A room may import from rooms of a lower floor and from itself; rooms on one floor do not know each other.
FLOORS = [
    {"bootstrap", "domain", "files", "libraries"},
    {"dsl"},
    {"robots", "models"},
    {"tasks"},
    {"synthesis", "rows"},
    {"train", "evaluate", "metrics"},
    {"report", "viewer", "bench"},
    {"doctor", "studio"},
    {"cli", "recipes"},
    {"__main__"},
]
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
TOP = FLOOR["cli"]


def violations(package: Path) -> list[str]:
    """Every import under `package` that goes the wrong way, as "file:line: what is wrong"."""
    found = []
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        tree = ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
        where = path.relative_to(package.parent)
        if parts == ("__init__",):
            found += [f"{where}:{line}: {fault}" for line, fault in _root_faults(tree, package.name)]
        elif parts[0] not in FLOOR:
            found.append(f"{where}:1: no floor is known for the room {parts[0]!r}; add it to FLOORS")
        else:
            found += [f"{where}:{line}: {fault}" for line, fault in _faults(tree, parts, package.name)]
    return found


def _faults(tree: ast.AST, parts: tuple[str, ...], package: str) -> Iterator[tuple[int, str]]:
    room = parts[0]
    for line, target in _imported_rooms(tree, parts, package):
        if target == room:
            continue
        if target == "" and FLOOR[room] < TOP:
            yield line, f"{room} imports from {package} itself; import from the room that has the name"
        elif target != "" and target not in FLOOR:
            yield line, f"{room} imports {target}, which is no room"
        elif target != "" and FLOOR[target] >= FLOOR[room]:
            yield line, f"{room} must not import {target}"


def _root_faults(tree: ast.Module, package: str) -> Iterator[tuple[int, str]]:
    """`__init__` may import any room, but only inside a function or for type checkers."""
    lazy = (ast.FunctionDef, ast.AsyncFunctionDef)
    for statement in tree.body:
        if isinstance(statement, lazy) or _for_type_checkers(statement):
            continue
        for line, target in _imported_rooms(statement, ("__init__",), package):
            if target not in ("", "dsl"):
                yield line, f"__init__ imports {target} at once; import it inside a function"


def _for_type_checkers(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.unparse(statement.test)


def _imported_rooms(tree: ast.AST, parts: tuple[str, ...], package: str) -> Iterator[tuple[int, str]]:
    """Line and room of every import of the package, however deep in the code; "" is the package itself."""
    for node in ast.walk(tree):
        for name in _imported_names(node, parts, package):
            head, *rest = name.split(".")
            if head == package and rest != ["__version__"]:
                yield node.lineno, _room_of(rest)


def _room_of(rest: list[str]) -> str:
    """A name that starts with a capital, or that no room bears, is read off the package itself."""
    return rest[0] if rest and (len(rest) > 1 or rest[0] in FLOOR) else ""


def _imported_names(node: ast.AST, parts: tuple[str, ...], package: str) -> list[str]:
    """The full dotted names that one import statement asks for; relative ones are resolved."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    module = node.module or ""
    if node.level:
        base = [package, *parts[:-1]]
        module = ".".join([*base[: len(base) - node.level + 1], *([node.module] if node.module else [])])
    return [f"{module}.{alias.name}" for alias in node.names]


def test_imports_go_one_way() -> None:
    faults = violations(PACKAGE)
    assert not faults, "\n" + "\n".join(faults)


@pytest.mark.parametrize(
    ("file", "line", "code"),
    [
        ("dsl/program.py", 1, "import evaps.robots.doom"),
        ("dsl/program.py", 2, "x = 1\nfrom evaps import robots"),
        ("dsl/program.py", 2, "def f():\n    from evaps.tasks.task import Task"),
        ("dsl/program.py", 1, "from evaps import Program"),
        ("robots/doom.py", 1, "from evaps.models import METHODS"),
        ("models/evaps.py", 1, "from ..robots.base import Robot"),
        ("models/__init__.py", 1, "from .. import robots"),
        ("tasks/sub/deep.py", 1, "from ...synthesis import beam"),
        ("train.py", 1, "from . import evaluate"),
        ("evaluate.py", 1, "from .train import fit"),
        ("report.py", 1, "import evaps.viewer"),
        ("synthesis/beam.py", 1, "from evaps.odds import ends"),
        ("odds.py", 1, "import json"),
        ("__init__.py", 1, "from evaps.models import METHODS"),
    ],
)
def test_a_planted_violation_is_found(tmp_path: Path, file: str, line: int, code: str) -> None:
    path = tmp_path / "evaps" / file
    path.parent.mkdir(parents=True)
    path.write_text(code + "\n")
    faults = violations(tmp_path / "evaps")
    assert len(faults) == 1
    assert faults[0].startswith(f"evaps/{file}:{line}: ")


@pytest.mark.parametrize(
    ("file", "code"),
    [
        (
            "dsl/program.py",
            "from .vocab import TOKENS\nfrom evaps.dsl import sampler",
        ),
        (
            "models/evaps.py",
            "import torch\nfrom evaps.dsl import Program\nfrom .encoder import Encoder",
        ),
        ("models/evaps.py", "from evaps import __version__\nfrom evaps.dsl import evaps"),
        ("tasks/task.py", "from ..robots import doom\nfrom evaps.models import METHODS"),
        ("evaluate.py", "from evaps.models.beam import search"),
        ("cli.py", "def main():\n    from evaps import load_task, train, viewer"),
        (
            "__init__.py",
            "import evaps.dsl\ndef __getattr__(name):\n    from evaps import models",
        ),
        ("__init__.py", "if TYPE_CHECKING:\n    from evaps.models import METHODS"),
    ],
)
def test_a_proper_import_is_let_through(tmp_path: Path, file: str, code: str) -> None:
    path = tmp_path / "evaps" / file
    path.parent.mkdir(parents=True)
    path.write_text(code + "\n")
    assert violations(tmp_path / "evaps") == []


HELP = """
from evaps.cli import main
sys.argv = ["evaps", "--help"]
try:
    main()
except SystemExit as stop:
    assert not stop.code, stop.code
"""


@pytest.mark.parametrize("code", ["import evaps", HELP], ids=["import evaps", "evaps --help"])
def test_a_light_start_loads_neither_torch_nor_vizdoom(code: str) -> None:
    script = f"import sys\n{code}\nprint('heavy:', sorted({{'torch', 'vizdoom'}} & set(sys.modules)))"
    assert last_line(script) == "heavy: []"


def test_who_makes_data_does_not_load_torch() -> None:
    """Each worker would pay for it, in seconds and in memory."""
    rooms = "build", "info", "render", "walks"
    imports = "; ".join(f"import evaps.tasks.{room}" for room in rooms)
    assert last_line(f"import sys; {imports}; print('torch' in sys.modules)") == "False"


def last_line(script: str) -> str:
    """What a script of Python prints last."""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()[-1]
