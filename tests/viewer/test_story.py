from evaps.dsl import Program, run
from evaps.viewer.highlight import python_spans
from evaps.viewer.story import line_views, rounds, steps, telling_example


class Counter:
    """A robot whose view is the number of actions so far; it perceives things in every other view."""

    def __init__(self):
        self.time = 0

    def act(self, action):
        self.time += 1

    def perceive(self, perception):
        return self.time % 2 == 0

    def observe(self):
        return self.time


def traced(text):
    return run(Program.parse(text), Counter())


LOOP = """
def run():
    if is_there(Demon):
        attack()
    while not in_target(Demon):
        turn_left()
"""
BRANCHES = """
def run():
    if not is_there(Demon):
        attack()
    else:
        if not is_there(Demon):
            attack()
    for _ in range(2):
        move_left()
"""


def test_steps_name_actions_and_conditions():
    first, second, third = steps(traced(LOOP))
    assert [s.view for s in (first, second, third)] == [0, 1, 2]
    assert [s.action for s in (first, second, third)] == ["attack()", "turn_left()", None]
    assert [(c.text, c.value) for c in first.checks] == [("if is_there(Demon)", True)]
    assert [(c.text, c.value) for c in second.checks] == [("while not in_target(Demon)", True)]
    assert [(c.text, c.value) for c in third.checks] == [("while not in_target(Demon)", False)]


def test_line_views_are_those_around_the_segments():
    views = line_views(traced(LOOP))
    assert [(v.before, v.after) for v in views] == [(0, 2), (0, 1), (0, 1), (1, 2), (1, 2)]
    assert [v.note for v in views] == ["", "true", "", "true, false", ""]


def test_lines_that_never_ran_and_lines_without_an_action():
    views = {v.text.strip(): v for v in line_views(traced(BRANCHES))}
    assert not views["else:"].starts
    assert views["attack()"].before is None
    assert not views["if not is_there(Demon):"].changed
    assert views["move_left()"].note == "ran 2 times"
    assert views["for _ in range(2):"].changed


def test_changes_put_together_give_both_programs(repaired):
    for step in rounds(repaired.solution.candidates[0]):
        before = [c.kept or c.deleted for c in step.changes]
        after = [c.kept or c.inserted for c in step.changes]
        assert " ".join(filter(None, before)) == str(step.before.program)
        assert " ".join(filter(None, after)) == str(step.after.program)


def test_the_telling_example_is_a_failed_one(repaired, at_once):
    proposal = repaired.solution.candidates[0].attempts[0]
    assert not proposal.passed[telling_example(proposal)]
    assert telling_example(at_once.solution.candidates[0].final) in range(5)


def test_spans_keep_the_line_and_know_its_words():
    line = "    while not in_target(HellKnight):"
    assert "".join(piece for _, piece in python_spans(line)) == line
    assert [kind for kind, _ in python_spans(line)] == [
        "", "control", "", "control", "", "perception", "bracket", "constant", "bracket",
    ]  # fmt: skip
    assert [kind for kind, _ in python_spans("move_left()")] == ["action", "bracket"]
