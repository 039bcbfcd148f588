"""What the grammar file says: the words, rules and parse table of each of its two forms."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from threading import Lock
from typing import Any

from lark import Lark, Token, Transformer
from lark.exceptions import LarkError
from lark.grammar import NonTerminal, Rule, Symbol
from lark.indenter import Indenter
from lark.lexer import PatternRE, TerminalDef
from lark.parsers.lalr_analysis import Shift

from evaps.domain import CHOSEN
from evaps.dsl.nodes import Action, If, IfElse, Not, Perception, Repeat, While

NODES: dict[str, type[Any]] = {
    "action": Action,
    "perception": Perception,
    "not_": Not,
    "if_": If,
    "if_else": IfElse,
    "while_": While,
    "repeat": Repeat,
}
"""The node that each alias of the grammar stands for; its fields are the rule's parts, in order."""

NOTHING = r"[^\s\S]"
"""A pattern that matches nothing."""

Stack = tuple[int, ...]
"""The states of the parser that are open: all that it remembers of the tokens so far."""


def _spellings(python: bool) -> dict[str, dict[str | int, str]]:
    """For each kind of word that a domain has its own of: how each of its values is written in a form."""
    spelt: Callable[[str], str] = CHOSEN.spelt if python else str
    perceptions: dict[str | int, str] = {word: spelt(word) for word in CHOSEN.perceptions}
    return {
        "ACTION": {word: spelt(word) for word in CHOSEN.actions},
        "PERCEPTION": perceptions if CHOSEN.things else {},
        "SENSE": {} if CHOSEN.things else perceptions,
        "THING": {word: word for word in CHOSEN.things},
        "TIMES": {count: str(count) for count in CHOSEN.counts},
        "COUNT": {count: f"R={count}" for count in CHOSEN.counts},
    }


class _TreeBuilder(Transformer[Token, Any]):
    """Builds nodes while lark parses."""

    def __init__(self, spellings: Mapping[str, Mapping[str | int, str]]) -> None:
        super().__init__()
        for alias, node in NODES.items():
            setattr(self, alias, lambda parts, node=node: node(*parts))
        for terminal, spelling in spellings.items():
            values = {word: value for value, word in spelling.items()}
            setattr(self, terminal, values.__getitem__)
        self.body = tuple
        self.program = lambda parts: parts[0]


class Indentation(Indenter):
    """Puts indents and dedents, as tokens, between the lines of the Python form."""

    NL_type = "_NL"
    OPEN_PAREN_types: list[str] = []  # noqa: RUF012 - a list to lark; a line never ends inside parentheses
    CLOSE_PAREN_types: list[str] = []  # noqa: RUF012
    INDENT_type = "_INDENT"
    DEDENT_type = "_DEDENT"
    tab_len = 8

    def process(self, stream: Iterator[Token]) -> Iterator[Token]:
        """The tokens with indents and dedents between them."""
        tokens: Iterator[Token] = super().process(self._from_margin(stream))  # type: ignore[no-untyped-call]
        return tokens

    def _from_margin(self, stream: Iterator[Token]) -> Iterator[Token]:
        """Lark looks at the indentation of every line but the first."""
        for number, token in enumerate(stream):
            if number == 0 and token.type != self.NL_type and (token.column or 1) > 1:
                yield Token(self.INDENT_type, "", 0, 1, 1, token.line, token.column, token.start_pos)
            yield token


class Form:
    """One of the two ways to write a program, as read off the grammar file, with the domain's words.

    Args:
        start: the rule that a whole text in this form follows.
        python: whether lines and indentation count, and actions are written in lower case.

    Attributes:
        words: for each terminal, its words in alphabetical order; none for line ends and indentation.
        rules: for each node, "body" and "program", how it is written.
        spelling: for each terminal that a domain has its own words of, the word for each value in the tree.
        table: the parse table.
    """

    def __init__(self, start: str, python: bool) -> None:
        self._python = python
        self.spelling = _spellings(python)
        self.words: dict[str, tuple[str, ...]] = {}
        self._lock = Lock()
        self.lark = Lark.open(
            "grammar.lark",
            rel_to=__file__,
            start=start,
            parser="lalr",
            lexer="basic",
            transformer=_TreeBuilder(self.spelling),
            postlex=Indentation() if python else None,
            edit_terminals=self._edit,
        )
        rules = [rule for rule in _reachable(self.lark.rules, start) if self._has_words(rule)]
        used = [symbol.name for rule in rules for symbol in rule.expansion if symbol.is_term]
        self.words = {name: self.words.get(name, ()) for name in dict.fromkeys(used)}
        self.rules = {rule.alias or rule.origin.name: rule.expansion for rule in rules}
        self.table = Table(self.lark, start, rules)

    def _edit(self, terminal: TerminalDef) -> None:
        """Give a terminal the domain's words, note them, and let it match whole words only."""
        name = terminal.name
        if name == "_NL" and not self._python:
            terminal.pattern = PatternRE(NOTHING)  # line ends are white space
        if name in ("COMMENT", "WHITE", "_NL"):
            return
        words = self.spelling[name].values() if name in self.spelling else [_word(terminal)]
        self.words[name] = tuple(sorted(words))
        boundary = r"(?:(?<!\w)|(?!\w))" if self._python else r"(?!\S)"
        pattern = "|".join(re.escape(word) for word in self.words[name])
        terminal.pattern = PatternRE(f"(?:{pattern}){boundary}" if pattern else NOTHING)

    def _has_words(self, rule: Rule) -> bool:
        """Whether the domain has words for a rule: one without things has none for its perceptions."""
        return all(self.words.get(symbol.name, True) for symbol in rule.expansion if symbol.is_term)

    def parse(self, text: str) -> Any:
        """The body of the program in the text; lark's own errors, if it is none."""
        with self._lock:  # the indenter keeps state between tokens
            return self.lark.parse(text)

    def lex(self, text: str) -> tuple[list[Token], LarkError | None]:
        """The tokens of a text, up to the first place that is none, and lark's error there."""
        tokens: list[Token] = []
        with self._lock:
            try:
                for token in self.lark.lex(text):
                    tokens.append(token)  # one by one, to keep those before an error
            except LarkError as error:
                return tokens, error
        return tokens, None


def _word(terminal: TerminalDef) -> str:
    """The one word that a terminal of the grammar file itself matches."""
    return re.sub(r"\\(.)", r"\1", terminal.pattern.to_regexp())


def _reachable(rules: list[Rule], start: str) -> list[Rule]:
    """The rules that the start rule uses; lark keeps those of the other form too."""
    names = [start]
    for name in names:
        parts = (part for rule in rules if rule.origin.name == name for part in rule.expansion)
        names += dict.fromkeys(p.name for p in parts if not p.is_term and p.name not in names)
    return [rule for name in names for rule in rules if rule.origin.name == name]


class Table:
    """Lark's LALR table as a function on immutable stacks, and the least cost of emptying one."""

    def __init__(self, lark: Lark, start: str, rules: list[Rule]) -> None:
        table = lark.parser.parser._parse_table
        self._states: dict[int, dict[str, tuple[Any, Any]]] = table.states
        self.start: Stack = (table.start_states[start],)
        self.end: Stack = (*self.start, table.end_states[start])
        self._lengths = _shortest_lengths(rules)
        self._length_of_all = self._lengths[start]
        self._partial = self._partial_rules(rules)

    def step(self, stack: Stack, terminal: str) -> Stack | None:
        """The stack after one more terminal, or None where the grammar forbids it."""
        while True:
            action, argument = self._states[stack[-1]].get(terminal, (None, None))
            if action is None:
                return None
            if action is Shift:
                return (*stack, argument)
            stack = stack[: len(stack) - len(argument.expansion)]
            stack = (*stack, self._states[stack[-1]][argument.origin.name][1])
            if stack == self.end and terminal == "$END":
                return stack

    def _partial_rules(self, rules: list[Rule]) -> dict[int, list[tuple[Stack, int, int]]]:
        """For each state, the rules that may be under way when it is on top of the stack.

        Each is (the top of the stack, from the state before the rule on; tokens that the rest of the rule
        needs at least; the state that replaces the rule's part of the stack).
        """
        partial: dict[int, list[tuple[Stack, int, int]]] = {state: [] for state in self._states}
        for before, actions in self._states.items():
            for rule in rules:
                if rule.origin.name not in actions:
                    continue
                path: Stack = (before,)
                for done, symbol in enumerate(rule.expansion, 1):
                    path = (*path, self._states[path[-1]][symbol.name][1])
                    rest = sum(self._length(part) for part in rule.expansion[done:])
                    partial[path[-1]].append((path, rest, actions[rule.origin.name][1]))
        return partial

    def _length(self, symbol: Symbol) -> int:
        return self._lengths[symbol.name] if isinstance(symbol, NonTerminal) else 1

    def reductions(self, stack: Stack) -> Iterator[tuple[int, Stack]]:
        """Every way to finish a rule under way, as shortly as possible: (tokens, the stack after it)."""
        for path, tokens, state in self._partial[stack[-1]]:
            if stack[-len(path) :] == path:
                after = (*stack[: 1 - len(path)], state)
                if after != stack:
                    yield tokens, after
        if stack == self.start:
            yield self._length_of_all, self.end


def _shortest_lengths(rules: list[Rule]) -> dict[str, int]:
    """The least number of tokens that each nonterminal can stand for."""
    lengths = {rule.origin.name: math.inf for rule in rules}
    for _ in rules:  # as often as a least number can depend on another one
        for rule in rules:
            total = sum(1 if part.is_term else lengths[part.name] for part in rule.expansion)
            lengths[rule.origin.name] = min(total, lengths[rule.origin.name])
    return {name: int(length) for name, length in lengths.items()}


TOKEN_FORM = Form("program", python=False)
PYTHON_FORM = Form("module", python=True)
