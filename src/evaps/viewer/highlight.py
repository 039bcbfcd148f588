"""The kind of every word of a program, for its colour: one of `TOKEN_TYPES` in both forms."""

from __future__ import annotations

import re
from collections.abc import Iterator

from evaps.dsl.syntax import PYTHON_FORM

_KIND_OF_TERMINAL = {
    "ACTION": "action",
    "PERCEPTION": "perception",
    "SENSE": "perception",
    "THING": "constant",
    "TIMES": "constant",
}
_KINDS = {
    word: kind for name, kind in _KIND_OF_TERMINAL.items() for word in PYTHON_FORM.spelling[name].values()
}


def python_spans(line: str) -> Iterator[tuple[str, str]]:
    """The pieces of a line in the Python form, each with its kind; white space has the kind ``""``."""
    for piece in re.findall(r"\s+|\w+|[^\w\s]+", line):
        if piece.isspace():
            yield "", piece
        else:
            yield _KINDS.get(piece, "control" if piece.isalpha() else "bracket"), piece
