"""Checkpoints from the Hugging Face hub: ``hub:OWNER/NAME``, or ``hub:OWNER/NAME@REVISION``."""

from __future__ import annotations

import re
from pathlib import Path

from evaps.models.checkpoint import CheckpointError

PREFIX = "hub:"
FILES = ["*/config.json", "*/model.safetensors"]
"""What a set of checkpoints has in a folder for each method."""


def fetch(name: str) -> Path:
    """The folder of a set of checkpoints; what was fetched once is not fetched again.

    Args:
        name: with its prefix.

    Raises:
        CheckpointError: the hub does not have it or cannot be reached, or the library for it is missing.
    """
    try:
        from huggingface_hub import snapshot_download
    except ImportError as error:
        raise CheckpointError(f"{name} needs huggingface_hub; try: pip install 'evaps[hub]'") from error
    repository, _, revision = name.removeprefix(PREFIX).partition("@")
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repository):
        raise CheckpointError(f"{name} names nothing on the hub; it has to be {PREFIX}OWNER/NAME")
    try:
        folder = Path(snapshot_download(repository, revision=revision or None, allow_patterns=FILES))
    except (OSError, ValueError) as error:  # the library's errors are of these two kinds
        reason = next(iter(str(error).strip().splitlines()), type(error).__name__)
        raise CheckpointError(f"{name} cannot be fetched: {reason}") from error
    if not any(folder.glob("*/config.json")):
        raise CheckpointError(f"{name} holds no checkpoints: it has no METHOD/config.json")
    return folder
