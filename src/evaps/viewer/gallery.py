"""The gallery: one HTML file of tasks whose answers are known, and what several methods made of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from evaps.files import write_atomically
from evaps.robots.frames import Observation
from evaps.viewer.explain import Explanation, explain
from evaps.viewer.render import render

if TYPE_CHECKING:  # else a page would load torch
    from evaps.synthesis.solution import Attempt, Candidate


@dataclass(frozen=True)
class Answer:
    """What a method has answered.

    Attributes:
        method: what it is called.
        candidate: its answer with the repairs that led to it, on all scenes of the task.
        right: whether it leads to the states that were meant, in all scenes.
    """

    method: str
    candidate: Candidate
    right: bool


@dataclass(frozen=True)
class Exhibit:
    """A task and the answers to it.

    Attributes:
        name: the task's.
        goals: what the robot should see at the end, scene by scene; the last scene was kept back.
        meant: the hidden program on these scenes.
        answers: in the order in which they are shown.
    """

    name: str
    goals: tuple[Observation, ...]
    meant: Attempt
    answers: tuple[Answer, ...]

    @property
    def scenes(self) -> list[str]:
        """What the scenes are called in a sentence."""
        return [*(f"example {i}" for i in range(1, len(self.goals))), "the scene kept back"]

    def explained(self, answer: Answer) -> Explanation:
        """Where an answer's run parts from the hidden program's."""
        return explain(answer.candidate.final, self.meant, self.scenes)


def write_gallery(path: Path, exhibits: Sequence[Exhibit], lead: Sequence[str]) -> None:
    """Write the page, with everything that it shows inside; the file is whole or not there.

    Args:
        path: the HTML file.
        exhibits: in the order in which they are shown, each with answers of the same methods.
        lead: paragraphs below the heading.
    """
    goals = [goal for exhibit in exhibits for goal in exhibit.goals]
    page = render(
        "gallery.html",
        goals,
        lossy=True,
        title="Gallery",
        exhibits=exhibits,
        lead=lead,
        code_spans=code_spans,
    )
    write_atomically(path, page.encode())


def code_spans(sentence: str) -> Iterator[tuple[bool, str]]:
    """The pieces of a sentence, and whether each is code: what stands between backticks."""
    for i, piece in enumerate(sentence.split("`")):
        yield bool(i % 2), piece
