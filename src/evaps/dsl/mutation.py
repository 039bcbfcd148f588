"""Small random changes of a program, as a repairer's first training needs them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evaps.dsl.program import Action, Body, Condition, If, IfElse, Not, Program, Repeat, Statement, While
from evaps.dsl.sampler import ACTIONS, COUNTS, MAX_TOKENS, PERCEPTIONS

Change = Callable[[Statement, np.random.Generator], Body]


def mutate(program: Program, rng: np.random.Generator, times: int = 1) -> Program:
    """The program after so many random mutations, at most 32 tokens long and different from what it was."""
    while True:
        mutated = program
        for _ in range(times):
            mutated = _mutate_once(mutated, rng)
        if mutated != program and len(mutated.tokens) <= MAX_TOKENS:
            return mutated


def _mutate_once(program: Program, rng: np.random.Generator) -> Program:
    while True:
        index = int(rng.integers(1, len(program.segments)))
        body, _ = _rewrite(program.body, index, lambda s: _change(s, rng), 1)
        if body is not None:
            return Program(body)


def _rewrite(body: Body, index: int, change: Callable[[Statement], Body], at: int) -> tuple[Body | None, int]:
    """The body with segment ``index`` changed, and the index behind it; None if a block would be empty."""
    out: list[Statement] = []
    for statement in body:
        if at == index:
            out += change(statement)
            at += _size(statement)
            continue
        at += 1
        for block in ("body", "orelse"):
            inner = getattr(statement, block, None)
            if inner is not None:
                inner, at = _rewrite(inner, index, change, at)
                if inner is None:
                    return None, at
                statement = replace(statement, **{block: inner})  # type: ignore[arg-type]
        out.append(statement)
    return (tuple(out) or None), at


def _size(statement: Statement) -> int:
    blocks = (getattr(statement, block, ()) for block in ("body", "orelse"))
    return 1 + sum(_size(inner) for block in blocks for inner in block)


def _change(statement: Statement, rng: np.random.Generator) -> Body:
    changes = [_insert_before, _insert_behind, _delete, _wrap, *_OWN[type(statement)]]
    return changes[int(rng.integers(len(changes)))](statement, rng)


def _action(rng: np.random.Generator) -> Action:
    return Action(str(rng.choice(ACTIONS)))


def _condition(rng: np.random.Generator) -> Condition:
    perception = PERCEPTIONS[int(rng.integers(len(PERCEPTIONS)))]
    return Not(perception) if rng.random() < 0.5 else perception


def _insert_before(statement: Statement, rng: np.random.Generator) -> Body:
    return (_action(rng), statement)


def _insert_behind(statement: Statement, rng: np.random.Generator) -> Body:
    return (statement, _action(rng))


def _delete(statement: Statement, rng: np.random.Generator) -> Body:
    return ()


def _wrap(statement: Statement, rng: np.random.Generator) -> Body:
    kind = int(rng.integers(3))
    if kind == 0:
        return (Repeat(int(rng.choice(COUNTS)), (statement,)),)
    return ((If if kind == 1 else While)(_condition(rng), (statement,)),)


def _replace_action(statement: Statement, rng: np.random.Generator) -> Body:
    return (_action(rng),)


def _recount(statement: Statement, rng: np.random.Generator) -> Body:
    assert isinstance(statement, Repeat)
    return (replace(statement, times=int(rng.choice(COUNTS))),)


def _unwrap(statement: Statement, rng: np.random.Generator) -> Body:
    assert not isinstance(statement, Action)
    return statement.body


def _ask_other(statement: Statement, rng: np.random.Generator) -> Body:
    assert isinstance(statement, If | IfElse | While)
    return (replace(statement, condition=_condition(rng)),)


def _negate(statement: Statement, rng: np.random.Generator) -> Body:
    assert isinstance(statement, If | IfElse | While)
    condition = statement.condition
    return (
        replace(statement, condition=condition.condition if isinstance(condition, Not) else Not(condition)),
    )


def _other_control(statement: Statement, rng: np.random.Generator) -> Body:
    assert isinstance(statement, If | IfElse | While)
    if isinstance(statement, IfElse):
        return (If(statement.condition, statement.body),)
    if isinstance(statement, While):
        return (If(statement.condition, statement.body),)
    if rng.random() < 0.5:
        return (While(statement.condition, statement.body),)
    return (IfElse(statement.condition, statement.body, (_action(rng),)),)


_CONDITIONAL: list[Change] = [_ask_other, _ask_other, _negate, _other_control, _unwrap]
_OWN: dict[type, list[Change]] = {
    Action: [_replace_action, _replace_action, _replace_action],
    Repeat: [_recount, _recount, _unwrap],
    If: _CONDITIONAL,
    IfElse: _CONDITIONAL,
    While: _CONDITIONAL,
}
