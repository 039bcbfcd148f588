"""Random programs for hypothesis, spelt out by hand: nothing here is read off the grammar."""

from __future__ import annotations

from hypothesis import strategies as st

from evaps.dsl import Action, If, IfElse, Not, Perception, Program, Repeat, While

NAMES = ["MOVE_FORWARD", "MOVE_BACKWARD", "MOVE_LEFT", "MOVE_RIGHT", "TURN_LEFT", "TURN_RIGHT", "ATTACK"]
actions = st.builds(Action, st.sampled_from(NAMES))
perceptions = st.builds(
    Perception, st.sampled_from(["ISTHERE", "INTARGET"]), st.sampled_from(["Demon", "HellKnight", "Revenant"])
)
conditions = st.recursive(perceptions, lambda inner: st.builds(Not, inner), max_leaves=3)


def bodies(statements):
    return st.lists(statements, min_size=1, max_size=3).map(tuple)


def compound(statements):
    body = bodies(statements)
    return st.one_of(
        st.builds(If, conditions, body),
        st.builds(IfElse, conditions, body, body),
        st.builds(While, conditions, body),
        st.builds(Repeat, st.integers(2, 6), body),
    )


programs = st.builds(Program, bodies(st.recursive(actions, compound, max_leaves=8)))
