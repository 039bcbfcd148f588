"""What synthesis gives back: candidates, how each was repaired, and what happened when they ran."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from evaps.dsl import Program, Trace, run
from evaps.robots.base import Robot, Scene
from evaps.robots.frames import Observation
from evaps.robots.memo import MemoRobot
from evaps.robots.noise import goal_match
from evaps.robots.together import run_together
from evaps.tasks.task import Task


@dataclass(frozen=True)
class Attempt:
    """A program that was run on the specification scenes.

    Attributes:
        program: what was run.
        traces: what happened, a trace for each example.
        passed: for each example, whether the run halted and its last view equals the goal (frame match; of a
            noisy goal on valid pixels).
    """

    program: Program
    traces: tuple[Trace[Observation], ...]
    passed: tuple[bool, ...]

    @property
    def pairs_passed(self) -> int:
        """How many of the examples it passes."""
        return sum(self.passed)

    @property
    def solved(self) -> bool:
        """Whether it passes them all."""
        return all(self.passed)


@dataclass(frozen=True)
class Candidate:
    """A synthesizer's proposal and its repairs.

    Attributes:
        attempts: first the proposal, then one attempt for each round of repair.
        rank: the proposal's place in the synthesizer's order, from 0.
        origin: who made it: the synthesizer's name, with ``+ repairer`` if it was repaired.
    """

    attempts: tuple[Attempt, ...]
    rank: int
    origin: str

    @property
    def final(self) -> Attempt:
        """The last attempt: the candidate as it is handed out."""
        return self.attempts[-1]

    @property
    def program(self) -> Program:
        """The program of the last attempt."""
        return self.final.program


@dataclass(frozen=True)
class Solution:
    """The answer to a task.

    Attributes:
        task: the task's name.
        candidates: best first: by pairs passed, then in the synthesizer's order; each program once, and each
            only as far as the attempt that passed most pairs.
        simulated_actions: how many actions the robot executed to find it.
        seconds: how long it took.
        all_candidates: one for each proposal, in the synthesizer's order, with all attempts: what was tried
            last is what the paper's evaluation judges.
        confidence: of a verified search: how far other programs that pass all examples agree with the answer
            on further scenes, from 0 to 1.
        doubt: a scene on which another program that passes all examples ends otherwise than the answer, and
            that program: what the user might be asked about.
    """

    task: str
    candidates: tuple[Candidate, ...]
    simulated_actions: int
    seconds: float
    all_candidates: tuple[Candidate, ...] = ()
    confidence: float | None = None
    doubt: tuple[Scene, Program] | None = None

    @property
    def program(self) -> Program:
        """The best candidate's program."""
        return self.candidates[0].program

    @property
    def solved(self) -> bool:
        """Whether the best candidate passes all examples."""
        return self.candidates[0].final.solved

    def to_json(self) -> dict[str, Any]:
        """The object that ``evaps synthesize --json`` prints."""
        candidates = [
            {"program": str(c.program), "pairs_passed": c.final.pairs_passed, "origin": c.origin}
            for c in self.candidates
        ]
        confidence: dict[str, Any] = {}
        if self.confidence is not None:
            confidence["confidence"] = round(self.confidence, 3)
        if self.doubt is not None:
            confidence["doubt"] = {"scene": self.doubt[0].to_json(), "program": str(self.doubt[1])}
        return {
            "task": self.task,
            "candidates": candidates,
            "solved": self.solved,
            **confidence,
            "simulated_actions": self.simulated_actions,
            "seconds": round(self.seconds, 3),
        }


def attempt(program: Program, task: Task, robot: Robot) -> Attempt:
    """Run a program on the task's scenes and compare where it ends with the goals."""
    traces = []
    for example in task.examples:
        robot.reset(example.scene)
        traces.append(run(program, robot))
    return _attempt(program, task, traces)


def attempt_all(programs: Sequence[Program], task: Task, robot: MemoRobot) -> list[Attempt]:
    """The same as `attempt` for each of several programs, with fewer actions."""
    by_scene = [run_together(programs, example.scene, robot) for example in task.examples]
    return [_attempt(p, task, traces) for p, *traces in zip(programs, *by_scene, strict=True)]


def _attempt(program: Program, task: Task, traces: Sequence[Trace[Observation]]) -> Attempt:
    goals = [example.goal for example in task.examples]
    passed = tuple(t.halted and goal_match(t.observations[-1], g) for t, g in zip(traces, goals, strict=True))
    return Attempt(program, tuple(traces), passed)


def best_first(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """By pairs passed, then in the synthesizer's order; equal programs once."""
    first: dict[Program, Candidate] = {}
    for candidate in sorted(candidates, key=lambda c: (-c.final.pairs_passed, c.rank)):
        first.setdefault(candidate.program, candidate)
    return tuple(first.values())
