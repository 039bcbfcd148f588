"""What a folder says of the data set in it: ``dataset.json``."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

from evaps.dsl import UserError
from evaps.files import write_atomically
from evaps.robots.world import world
from evaps.tasks.files import read_json

FORMAT = 2
PART = 100  # indices in a part, unless dataset.json says otherwise


class DatasetError(UserError):
    """A folder that is no data set, or not the one that was asked for; one line."""


def read_identity(folder: Path) -> dict[str, Any]:
    """What ``dataset.json`` says: seed, size, robot and versions.

    Raises:
        DatasetError: it is missing or damaged.
    """
    path = folder / "dataset.json"
    found = read_json(path, DatasetError)
    if not isinstance(found, dict):
        raise DatasetError(f"{path}: expected an object with the seed and the size of a data set")
    for key in ("seed", "tasks", "part"):
        if type(found.get(key, 0)) is not int:
            raise DatasetError(f"{path}: {key} must be a whole number, not {found[key]!r}")
    return found


def write_identity(folder: Path, tasks: int, seed: int, part: int) -> None:
    """Say in ``dataset.json`` what the folder holds, or find out that it holds the same.

    Raises:
        DatasetError: it holds another data set, or other files.
    """
    made_by = {"evaps": version("evaps")}
    if (engine := world().engine) is not None:
        made_by[engine] = version(engine)
    identity = {"format": FORMAT, "robot": world().version, "seed": seed, "tasks": tasks, **made_by}
    identity |= {"part": part} if part != PART else {}
    path = folder / "dataset.json"
    if path.exists():
        found = read_identity(folder)
        for key in ("format", "robot", *([engine] if engine else []), "seed", "part"):
            usual = PART if key == "part" else None
            there, wanted = found.get(key, usual), identity.get(key, usual)
            if there != wanted:
                raise DatasetError(f"{folder} has {key} {there}, not {wanted}; use another folder")
        if found.get("tasks", 0) > tasks:
            raise DatasetError(
                f"{folder} is for {found['tasks']} tasks; ask for as many, or use another folder"
            )
        identity["evaps"] = found.get("evaps")  # the version that began it
    elif folder.exists() and any(folder.iterdir()):
        raise DatasetError(f"{folder} is not empty and no data set; choose another folder")
    write_atomically(path, (json.dumps(identity, indent=1) + "\n").encode())
