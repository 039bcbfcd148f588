"""Dropout off while gradients are wanted: LSTMs on a graphics card learn in training mode only."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from torch import nn


@contextmanager
def without_dropout(model: nn.Module) -> Iterator[None]:
    """Sets every dropout of a model to 0 for a while; the mode of the model stays as it is.

    Args:
        model: its ``nn.Dropout`` modules, and whatever else has a number ``dropout`` (attention, LSTMs).
    """
    found = [
        (m, key, getattr(m, key))
        for m in model.modules()
        for key in ("p", "dropout")
        if isinstance(getattr(m, key, None), float)
    ]
    for module, key, _ in found:
        setattr(module, key, 0.0)
    try:
        yield
    finally:
        for module, key, value in found:
            setattr(module, key, value)
