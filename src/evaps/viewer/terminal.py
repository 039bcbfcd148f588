"""The answer to a task in the terminal: the page's story in short."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from evaps.dsl import Program
from evaps.viewer.highlight import python_spans
from evaps.viewer.story import Change, TaskReport, rounds

if TYPE_CHECKING:  # else the terminal would wait for torch
    from evaps.synthesis.solution import Attempt

STYLES = {
    "action": "cyan",
    "perception": "magenta",
    "constant": "yellow",
    "control": "bold",
    "bracket": "dim",
    "": "",
}


def show_solution(console: Console, report: TaskReport) -> None:
    """Print what came of a task: the verdict, each round of repair, the program, the other candidates.

    Where the console has no colours, edits are marked in letters: ``[-deleted-]`` and ``{+inserted+}``.
    """
    best, colours = report.solution.candidates[0], console.color_system is not None
    console.rule(Text(report.task.name, "bold"), align="left", style="dim")
    console.print(_verdict(report))
    for step in rounds(best):
        text = f"round {step.number}: {_pairs(step.before)} -> {_pairs(step.after)} pairs"
        console.print(Text(text, "dim"))
        console.print(Padding(changes_text(step.changes, colours), (0, 0, 0, 2), expand=False))
    console.print()
    for line in program_text(best.program).split("\n"):
        console.print(Text("  ") + line, soft_wrap=True)  # as it is, so that it can be copied
    if len(report.solution.candidates) > 1:
        console.print(_others(report))


def _verdict(report: TaskReport) -> Text:
    solution = report.solution
    best = solution.candidates[0]
    verdict = ("solved", "bold green") if solution.solved else ("not solved", "bold red")
    text = Text.assemble(verdict)
    text.append(f"  {_pairs(best.final)} pairs")
    facts = f"  {best.origin}, {solution.seconds:.1f} s, {solution.simulated_actions} simulated actions"
    if solution.confidence is not None and solution.solved:
        facts += f", confidence {solution.confidence:.2f}"
    return text.append(facts, "dim")


def _pairs(attempt: Attempt) -> str:
    return f"{attempt.pairs_passed}/{len(attempt.passed)}"


def changes_text(changes: Iterable[Change], colours: bool) -> Text:
    """The tokens of two programs as one text: deleted ones struck through, inserted ones green."""
    words: list[Text] = []
    for change in changes:
        if change.kept:
            words.append(Text(change.kept, "dim" if colours else ""))
        if change.deleted:
            words.append(Text(change.deleted, "strike red") if colours else Text(f"[-{change.deleted}-]"))
        if change.inserted:
            words.append(Text(change.inserted, "bold green") if colours else Text(f"{{+{change.inserted}+}}"))
    return Text(" ").join(words)


def program_text(program: Program) -> Text:
    """The Python form in colours."""
    lines = [
        Text.assemble(*((piece, STYLES[kind]) for kind, piece in python_spans(line)))
        for _, line in program.python_lines
    ]
    return Text("\n").join(lines)


def _others(report: TaskReport) -> Table:
    table = Table(title="other candidates", title_justify="left", title_style="dim", box=None, pad_edge=False)
    table.add_column("pairs", justify="right")
    table.add_column("origin")
    table.add_column("program", overflow="fold")
    for candidate in report.solution.candidates[1:]:
        table.add_row(_pairs(candidate.final), Text(candidate.origin), Text(str(candidate.program), "dim"))
    return table
