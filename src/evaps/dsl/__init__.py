"""The language: programs, their vocabulary and grammar, and the interpreter. It knows no robot or tensor."""

from evaps.dsl.errors import UserError
from evaps.dsl.interpreter import (
    ActionEvent,
    ConditionEvent,
    Limits,
    Robot,
    Trace,
    covered,
    run,
)
from evaps.dsl.program import (
    Action,
    Body,
    Condition,
    If,
    IfElse,
    Not,
    Perception,
    Program,
    ProgramError,
    Repeat,
    Segment,
    Statement,
    While,
)
from evaps.dsl.vocab import TOKEN_TYPES, VOCAB, GrammarState, Vocab, token_type

__all__ = [
    "TOKEN_TYPES",
    "VOCAB",
    "Action",
    "ActionEvent",
    "Body",
    "Condition",
    "ConditionEvent",
    "GrammarState",
    "If",
    "IfElse",
    "Limits",
    "Not",
    "Perception",
    "Program",
    "ProgramError",
    "Repeat",
    "Robot",
    "Segment",
    "Statement",
    "Trace",
    "UserError",
    "Vocab",
    "While",
    "covered",
    "run",
    "token_type",
]
