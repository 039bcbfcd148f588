"""A search in the background: what it has to say as it goes on, and its answer."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from threading import Event, Lock, Thread
from typing import Any
from uuid import uuid4

import torch

from evaps.dsl import UserError
from evaps.models import Model
from evaps.robots.base import EngineError, Robot
from evaps.synthesis import Budget, News, Solution, Watch, memo_of, solve, team_of_robots
from evaps.tasks.task import Task
from evaps.viewer import TaskReport
from evaps.viewer.page import render_page

PAGES_KEPT = 5
PATIENCE = 5.0  # seconds for a search that was asked to end
HEARTBEAT = 0.5  # seconds between two signs of life
DEAF = 10.0  # seconds without anybody asking for a line, after which nobody does any longer


@dataclass
class Job:
    """A search that is under way.

    Attributes:
        id: what it is called.
        lines: what is to be sent, JSON values; None is the end.
        stopped: set it, and the search comes back with the best that it has.
        heard: when somebody last asked for a line, in seconds of the monotonic clock.
    """

    id: str = field(default_factory=lambda: uuid4().hex)
    lines: SimpleQueue[dict[str, Any] | None] = field(default_factory=SimpleQueue)
    stopped: Event = field(default_factory=Event)
    heard: float = field(default_factory=time.monotonic)

    def wanted(self) -> bool:
        """Whether somebody still waits for it; who left before the first line is noticed by this alone."""
        return not self.stopped.is_set() and time.monotonic() - self.heard < DEAF


class Searches:
    """Runs one search at a time, on engines of its own, and keeps the pages of the last ones."""

    def __init__(self) -> None:
        self.pages: dict[str, str] = {}
        self._job: Job | None = None
        self._busy = Lock()
        self._robots: list[Robot] = []

    @property
    def replaced(self) -> int:
        """How many of its engines have died, or hung, and were replaced."""
        return sum(robot.replaced for robot in self._robots)

    def begin(self, model: Model, task: Task, budget: Budget) -> Job:
        """Start a search.

        Raises:
            EngineError: there is one already, or the machine has no room for it.
        """
        if not self._busy.acquire(timeout=2 * HEARTBEAT) and not self._ends_soon():
            raise EngineError("another search is under way; stop it first, or wait until it ends")
        self._job = job = Job()
        try:
            Thread(target=self._work, args=(job, model, task, budget), daemon=True).start()
        except RuntimeError as error:
            self._job = None
            self._busy.release()
            raise EngineError(f"the search cannot be started: {error}") from error
        return job

    def _ends_soon(self) -> bool:
        """Whether a search that was asked to end, or whose page was left, does so."""
        current = self._job
        return current is not None and current.stopped.is_set() and self._busy.acquire(timeout=PATIENCE)

    def stop(self, job: str) -> bool:
        """Ask a search to end; whether it was under way."""
        current = self._job
        if current is None or current.id != job:
            return False
        current.stopped.set()
        return True

    def interrupt(self) -> None:
        """Ask whatever is under way to end."""
        if (current := self._job) is not None:
            current.stopped.set()

    def close(self) -> None:
        """Stop what is under way, and end the engines, even under a search that does not come to its end."""
        self.interrupt()
        self._busy.acquire(timeout=PATIENCE)
        for robot in self._robots:
            robot.close()

    def _work(self, job: Job, model: Model, task: Task, budget: Budget) -> None:
        try:
            self._search(job, model, task, budget)
        except (UserError, EngineError) as error:
            job.lines.put({"error": str(error)})
        except Exception as error:  # whatever it was, whoever waits has to know
            job.lines.put({"error": f"unexpected {type(error).__name__}: {error}"})
        finally:
            self._job = None
            self._busy.release()
            job.lines.put(None)

    def _search(self, job: Job, model: Model, task: Task, budget: Budget) -> None:
        torch.set_num_threads(1)
        if not self._robots:
            self._robots = team_of_robots()
            with ThreadPoolExecutor() as pool:  # engines take a second to start, which is no search's fault
                list(pool.map(lambda robot: robot.reset(task.examples[0].scene), self._robots))
        memo = memo_of(self._robots)
        watch = Watch(lambda news: job.lines.put(news_json(news)), lambda: not job.wanted())
        try:
            solution = solve(model, task, memo, budget=budget, watch=watch)
            self.pages[job.id] = render_page([TaskReport(task, solution)])  # while the views are there
        finally:
            memo.leave()
        while len(self.pages) > PAGES_KEPT:
            del self.pages[next(iter(self.pages))]
        job.lines.put(answer_json(solution, job.stopped.is_set()))


def lines_of(job: Job) -> Iterator[dict[str, Any]]:
    """What a search says, until it ends; an empty object now and then, if it says nothing for long."""
    while True:
        job.heard = time.monotonic()
        try:
            line = job.lines.get(timeout=HEARTBEAT)
        except Empty:
            yield {}
            continue
        if line is None:
            return
        yield line


def news_json(news: News) -> dict[str, Any]:
    """``{"news", "passed", "python", "actions", "seconds"}``."""
    return {
        "news": news.text,
        "passed": list(news.passed),
        "python": news.program.to_python() if news.program else None,
        "actions": news.actions,
        "seconds": round(news.seconds, 2),
    }


def answer_json(solution: Solution, stopped: bool) -> dict[str, Any]:
    """The answer, and the candidates with what each passes and, if it was repaired, what it was before."""
    return {
        "solved": solution.solved,
        "stopped": stopped,
        "confidence": solution.confidence,
        "actions": solution.simulated_actions,
        "seconds": round(solution.seconds, 2),
        "candidates": [
            {
                "python": candidate.program.to_python(),
                "passed": list(candidate.final.passed),
                "origin": candidate.origin,
                "before": [a.program.to_python() for a in candidate.attempts[:-1]],
            }
            for candidate in solution.candidates
        ],
    }
