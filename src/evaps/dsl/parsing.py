"""From text to tree, and what is wrong with a text that is no program."""

from __future__ import annotations

import re

from lark.exceptions import LarkError, UnexpectedCharacters
from lark.indenter import DedentError
from lark.lexer import Token

from evaps.dsl.errors import UserError
from evaps.dsl.nodes import Body
from evaps.dsl.syntax import PYTHON_FORM, TOKEN_FORM, Form

_KINDS = {
    "ACTION": "an action",
    "PERCEPTION": "a perception",
    "SENSE": "a perception",
    "_NL": "a new line",
    "_INDENT": "an indented block",
    "_DEDENT": "the end of the block",
    "$END": "the end of the program",
}
_BEGINNINGS = ('"DEF"', '"def"')  # of the two forms
_LAYOUT = {"_NL": "the end of the line", "_INDENT": "an indentation", "_DEDENT": "the end of the block"}


class ProgramError(UserError):
    """A text is not a program. The message is one line.

    Args:
        line: where it goes wrong, from 1.
        column: where in that line, from 1.
        found: what stands there, in human words.
        expected: what could stand there, in human words.
    """

    def __init__(self, line: int, column: int, found: str, expected: tuple[str, ...]) -> None:
        self.line, self.column, self.found, self.expected = line, column, found, expected
        super().__init__(f"line {line}, column {column}: found {found}, expected {_listed(expected)}")

    def __reduce__(self) -> tuple[type[ProgramError], tuple[int, int, str, tuple[str, ...]]]:
        return ProgramError, (self.line, self.column, self.found, self.expected)


def parse_body(text: str) -> Body:
    """The statements of a program in either form.

    Raises:
        ProgramError: the text is not a program.
    """
    form = form_of(text)
    if form is PYTHON_FORM:
        text += "\n"  # its last line ends too
    try:
        body: Body = form.parse(text)
    except LarkError:
        raise _explained(form, text) from None
    return body


def form_of(text: str) -> Form:
    """The form that a text is meant to be in: only the Python form has ``def``, ``:`` and ``()``."""
    code = re.sub(r"#.*", "", text)
    return PYTHON_FORM if re.search(r"\bdef\b|:|\(\)", code) else TOKEN_FORM


def _explained(form: Form, text: str) -> ProgramError:
    """The first fault of a text that does not parse.

    Lark reduces before it finds a token wrong, and then knows less than all that could have stood there;
    so the tokens are stepped through again, each from a stack that is still whole.
    """
    tokens, lexer_error = form.lex(text)
    stack = form.table.start
    for token in tokens:
        after = form.table.step(stack, token.type)
        if after is None:
            return ProgramError(*_place(text, token), _found(form, text, token), _expected(form, stack))
        stack = after
    if isinstance(lexer_error, UnexpectedCharacters):
        word = _word_at(form, text, lexer_error.pos_in_stream or 0)
        return ProgramError(lexer_error.line, lexer_error.column, word, _expected(form, stack))
    if isinstance(lexer_error, DedentError):
        place = tokens[-1].end_line or 1, tokens[-1].end_column or 1
        return ProgramError(*place, "an indentation that no line above has", ("that of a block above",))
    return ProgramError(*_end(text), "the end of the text", _expected(form, stack))


def _place(text: str, token: Token) -> tuple[int, int]:
    """Line and column of a token; those of an indentation are where the new line's text begins."""
    if _is_last(text, token):
        return _end(text)
    if token.type in ("_INDENT", "_DEDENT"):
        return token.end_line or 1, token.end_column or 1
    return token.line or 1, token.column or 1


def _end(text: str) -> tuple[int, int]:
    """Line and column right after all that is not white space."""
    lines = text.rstrip().split("\n")
    return len(lines), len(lines[-1]) + 1


def _is_last(text: str, token: Token) -> bool:
    """Whether a token is mere layout at the end of the text."""
    return token.type in _LAYOUT and not text[token.end_pos or 0 :].strip()


def _found(form: Form, text: str, token: Token) -> str:
    if _is_last(text, token):
        return "the end of the text"
    return _LAYOUT.get(token.type) or _word_at(form, text, token.start_pos or 0)


def _word_at(form: Form, text: str, position: int) -> str:
    """The whole word at a place, quoted, and cut if it is long."""
    match = re.compile(r"\S+" if form is TOKEN_FORM else r"\w+|\S").match(text, position)
    word = match[0] if match else "white space"
    return _quoted(word if len(word) <= 40 else word[:37] + "...")


def _quoted(word: str) -> str:
    return '"' + "".join(c if c.isprintable() else ascii(c)[1:-1] for c in word) + '"'


def _expected(form: Form, stack: tuple[int, ...]) -> tuple[str, ...]:
    """In human words, the kinds of token that may follow."""
    if form is TOKEN_FORM and stack == form.table.start:  # nothing there says which form is meant
        return _BEGINNINGS
    names = (*form.words, "$END")
    described = (_described(form, name) for name in names if form.table.step(stack, name))
    return tuple(sorted(described, key=lambda words: words.startswith('"')))  # kinds first


def _described(form: Form, terminal: str) -> str:
    """A terminal in human words: its kind, or the words themselves where there are few."""
    return _KINDS.get(terminal) or _listed(tuple(_quoted(word) for word in form.words[terminal]))


def _listed(items: tuple[str, ...]) -> str:
    return " or ".join(filter(None, [", ".join(items[:-1]), items[-1]]))
