"""Readable robot programs from five examples, repaired with what the robot saw when a wrong one ran.

>>> import evaps
>>> task = evaps.load_task("tasks/first")
>>> solution = evaps.synthesize(task, evaps.load_model())
>>> print(solution.program.to_python())

The import also registers the Gymnasium environment ``evaps/Doom-v0``. Each name below is loaded when it is
first used, so that neither torch nor the engine is loaded for nothing.
"""

from typing import TYPE_CHECKING, Any

import gymnasium

if TYPE_CHECKING:
    from evaps.dsl import Program
    from evaps.models import load_model
    from evaps.robots.base import Scene
    from evaps.synthesis import synthesize
    from evaps.tasks.task import Task, load_task

    __version__: str

__all__ = ["Program", "Scene", "Task", "__version__", "load_model", "load_task", "synthesize"]

_ROOMS = {
    "Program": "evaps.dsl",
    "Scene": "evaps.robots.base",
    "Task": "evaps.tasks.task",
    "load_model": "evaps.models",
    "load_task": "evaps.tasks.task",
    "synthesize": "evaps.synthesis",
}

# Gymnasium has no packaging entry point for environments, so this line costs the import of gymnasium: 0.06 s
# on top of numpy. The environment itself is loaded by `gymnasium.make`.
gymnasium.register("evaps/Doom-v0", entry_point="evaps.robots.gym:DoomEnv")


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("evaps")
    elif name in _ROOMS:
        from importlib import import_module

        value = getattr(import_module(_ROOMS[name]), name)
    else:
        raise AttributeError(f"module 'evaps' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
