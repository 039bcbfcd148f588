"""From tree to text: the rules of the grammar, read in the other direction."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias

from evaps.dsl.nodes import Action, Body, If, IfElse, Repeat, Statement, While
from evaps.dsl.syntax import NODES, Form

_ALIASES = {node: alias for alias, node in NODES.items()}
_STATEMENTS = (Action, If, IfElse, While, Repeat)
_FIELDS = {node: [part.name for part in fields(node)] for node in _ALIASES}
_LAYOUT = ("_NL", "_INDENT", "_DEDENT")
_Work: TypeAlias = "Iterator[_Work]"


@dataclass
class Layout:
    """The pieces of a program's text in one form, and the segment that each belongs to.

    Segments are the whole program (0) and its statements, numbered in the order in which they begin.

    Attributes:
        form: the form that it is written in.
        pieces: tokens in order; in the Python form also line ends, indents and dedents, by their names.
        owners: for each piece, its innermost segment.
        nodes: for each segment its statement, None for the first.
        parents: for each segment the one around it, None for the first.
        spans: for each segment the first of its pieces and the one after its last.
        heads: for each segment the piece at which the first part of its node begins.
    """

    form: Form
    pieces: list[str] = field(default_factory=list)
    owners: list[int] = field(default_factory=list)
    nodes: list[Statement | None] = field(default_factory=list)
    parents: list[int | None] = field(default_factory=list)
    spans: list[tuple[int, int]] = field(default_factory=list)
    heads: list[int] = field(default_factory=list)

    @classmethod
    def of(cls, body: Body, form: Form) -> Layout:
        """The layout of a program in a form.

        Raises:
            ValueError: the tree has a word that the language does not have, or an empty block.
        """
        layout = cls(form)
        work = [layout._segment("program", [body], None, None)]
        while work:  # a stack of generators in place of Python's own, so that blocks may nest to any depth
            inner = next(work[-1], None)
            if inner is None:
                work.pop()
            else:
                work.append(inner)
        return layout

    def _segment(self, alias: str, parts: list[Any], node: Statement | None, parent: int | None) -> _Work:
        index, start = len(self.spans), len(self.pieces)
        self.nodes.append(node)
        self.parents.append(parent)
        self.spans.append((start, start))
        self.heads.append(-1)
        yield self._rule(alias, parts, index)
        self.spans[index] = (start, len(self.pieces))

    def _rule(self, alias: str, parts: list[Any], owner: int) -> _Work:
        """Write a rule of the grammar, with a node's parts in place of the symbols that vary."""
        rest = iter(parts)
        for symbol in self.form.rules[alias]:
            if getattr(symbol, "filter_out", False):
                words = self.form.words[symbol.name]
                self._piece(words[0] if words else symbol.name, owner)
                continue
            if self.heads[owner] < 0:
                self.heads[owner] = len(self.pieces)
            yield self._part(symbol.name, next(rest), owner)

    def _part(self, symbol: str, part: Any, owner: int) -> _Work:
        if isinstance(part, tuple):
            yield self._body(symbol, part, owner)
        elif isinstance(part, _STATEMENTS):
            yield self._segment(_ALIASES[type(part)], _parts(part), part, owner)
        elif type(part) in _ALIASES:
            yield self._rule(_ALIASES[type(part)], _parts(part), owner)
        else:
            self._piece(self._spelt(symbol, part), owner)

    def _body(self, symbol: str, body: Body, owner: int) -> _Work:
        if not body:
            raise ValueError("a block of a program needs at least one statement")
        if not symbol.startswith("__"):  # lark's name for the "one or more" in a rule
            yield self._rule("body", [body], owner)
            return
        for statement in body:
            yield self._part(symbol, statement, owner)

    def _piece(self, piece: str, owner: int) -> None:
        self.pieces.append(piece)
        self.owners.append(owner)

    def _spelt(self, terminal: str, value: Any) -> str:
        words = self.form.spelling.get(terminal, {})
        if value not in words:
            raise ValueError(f"{value!r} is no word of the language; known are {', '.join(words.values())}")
        return words[value]

    def lines(self) -> Iterator[tuple[int, str]]:
        """The lines of the Python form, each with the segment that it shows."""
        depth, owner, line = 0, 0, ""
        for piece, segment in zip(self.pieces, self.owners, strict=True):
            if piece == "_NL":
                yield owner, "    " * depth + _spaced(line)
                line = ""
            elif piece in _LAYOUT:
                depth += 1 if piece == "_INDENT" else -1
            else:
                owner = owner if line else segment
                line += f" {piece}"


def _parts(node: Any) -> list[Any]:
    return [getattr(node, name) for name in _FIELDS[type(node)]]


def _spaced(line: str) -> str:
    """A line of code with the spaces that Python's style guide wants."""
    return re.sub(r" (?=[():])|(?<=\() ", "", line.strip())
