"""The two roles of a method: a synthesizer proposes programs, a repairer mends them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.dsl import Program

Features = Float[Tensor, "batch pair 2 feature"]
"""For every pair of every task, the embeddings of the first observation and of the goal."""


class Synthesizer(nn.Module, ABC):
    """Proposes programs for tasks, token by token. Bring your own: two methods for decoding, one to learn."""

    acts: ClassVar[bool] = False
    """Whether it goes ways on the scenes first: then it is told Ways (`evaps.models.inferred_trace`)."""
    retrains: ClassVar[bool] = False
    """Whether it is trained for a second round, on programs of its own that reach all outputs."""
    name: str
    Config: ClassVar[type]
    config: Any

    @abstractmethod
    def start(self, features: Any) -> Any:
        """The decoder's state before the first token.

        Args:
            features: what is told of the tasks: Features, or Ways if it acts. The same in the other methods.
        """

    @abstractmethod
    def step(
        self, state: Any, tokens: Int[Tensor, " batch"] | None, rows: Int[Tensor, " batch"] | None
    ) -> tuple[Float[Tensor, "batch vocab"], Any]:
        """Logits of the next token, and the state for the next step.

        Args:
            state: of the previous step.
            tokens: what was chosen last; None at the first step.
            rows: which row of the previous step each hypothesis goes on from; None for the same.
        """

    @abstractmethod
    def logits(self, features: Any, tokens: Int[Tensor, "batch time"]) -> Float[Tensor, "batch time vocab"]:
        """Logits of each token of programs, knowing those before it."""

    def loss(
        self, features: Any, tokens: Int[Tensor, "batch time"], masks: Bool[Tensor, "batch time vocab"]
    ) -> Float[Tensor, ""]:
        """What is minimised: negative log-likelihood under the grammar's mask, a mean over tokens."""
        return masked_likelihood(self.logits(features, tokens), tokens, masks).sum() / (tokens > 0).sum()

    def log_probabilities(
        self, features: Any, tokens: Int[Tensor, "batch time"], masks: Bool[Tensor, "batch time vocab"]
    ) -> Float[Tensor, " batch"]:
        """The logarithm of each program's probability under the grammar's mask."""
        return -masked_likelihood(self.logits(features, tokens), tokens, masks).sum(1)


@dataclass(frozen=True)
class Execution:
    """A program with what the robot saw when it ran it on every pair, as rows of a table of embeddings.

    Attributes:
        program: the candidate.
        before: for each pair and segment, the row of O_pre; -1 where the segment was never executed.
        after: the same for O_post.
        first: for each pair, the row of the first observation.
        final: for each pair, the row of the observation at which the program ended.
        goal: for each pair, the row of the goal.
        events: of every action and condition that was executed its pair, its segment, and the row of what was
            seen before it.
    """

    program: Program
    before: Int[np.ndarray, "pair segment"]
    after: Int[np.ndarray, "pair segment"]
    first: Int[np.ndarray, " pair"]
    final: Int[np.ndarray, " pair"]
    goal: Int[np.ndarray, " pair"]
    events: Int[np.ndarray, "event 3"] = field(default_factory=lambda: np.zeros((0, 3), np.int64))

    def rows(self) -> tuple[Int[np.ndarray, ...], ...]:
        """All arrays of rows, in the order of the fields."""
        return self.before, self.after, self.first, self.final, self.goal, self.events[:, 2]

    def renumbered(self, used: Int[np.ndarray, " row"]) -> Execution:
        """The same for a table that has only the rows ``used``, which are sorted."""
        *rows, seen = (np.where(r < 0, -1, np.searchsorted(used, r)) for r in self.rows())
        return replace(Execution(self.program, *rows), events=np.column_stack([self.events[:, :2], seen]))


class Repairer(nn.Module, ABC):
    """Turns wrong programs and what happened when they ran into better ones."""

    name: str
    Config: ClassVar[type]
    config: Any

    @abstractmethod
    def repairs(
        self, executions: Sequence[Execution], table: Float[Tensor, "row feature"], beam: int
    ) -> list[Iterator[Program]]:
        """For each execution what its program may become, at most ``beam``, most probable first.

        A program is parsed when it is asked for: most often the first one that was not tried yet is enough.
        """

    def repair(
        self,
        executions: Sequence[Execution],
        table: Float[Tensor, "row feature"],
        tried: Sequence[set[Program]],
    ) -> list[Program | None]:
        """For each execution the best program that is not among those tried; None if there is none."""
        found = self.repairs(executions, table, self.config.beam)
        return [
            next((program for program in programs if program not in old), None)
            for programs, old in zip(found, tried, strict=True)
        ]

    @abstractmethod
    def batch(self, executions: Sequence[Execution], targets: Sequence[Program], device: torch.device) -> Any:
        """Executions, and the edits that lead to the targets, as tensors for `batch_loss`."""

    @abstractmethod
    def batch_loss(self, batch: Any, table: Float[Tensor, "row feature"]) -> Float[Tensor, ""]:
        """How far the predicted edits are from those that lead to the targets."""

    def loss(
        self,
        executions: Sequence[Execution],
        targets: Sequence[Program],
        table: Float[Tensor, "row feature"],
    ) -> Float[Tensor, ""]:
        """The same from executions and targets."""
        return self.batch_loss(self.batch(executions, targets, table.device), table)


def masked_likelihood(
    logits: Float[Tensor, "batch time vocab"],
    tokens: Int[Tensor, "batch time"],
    masks: Bool[Tensor, "batch time vocab"],
) -> Float[Tensor, "batch time"]:
    """Negative log-likelihood of each token under a mask; of padding (0) it is 0."""
    logits = logits.float().masked_fill(~masks, -torch.inf)
    logits = torch.where((tokens == 0)[..., None], 0.0, logits)  # padding: no mask, no loss
    return F.cross_entropy(logits.transpose(1, 2), tokens, ignore_index=0, reduction="none")


def pad(rows: Sequence[Sequence[int] | Int[np.ndarray, " _"]], value: int = 0) -> Int[Tensor, "row longest"]:
    """Integer rows of different lengths as one tensor."""
    out = np.full((len(rows), max(map(len, rows))), value, np.int64)
    for i, row in enumerate(rows):
        out[i, : len(row)] = row
    return torch.from_numpy(out)


class Joined(NamedTuple):
    """Programs of a batch; their segments are counted through, from the first program to the last."""

    tokens: Int[Tensor, "batch time"]
    segments: Int[Tensor, "batch time"]
    owner: Int[Tensor, " segment"]
    starts: list[int]
    """The number of each program's segment 0."""

    @classmethod
    def of(cls, programs: Sequence[Program], device: torch.device) -> Joined:
        """Pad programs to the longest, and number their segments."""
        counts = [len(p.segments) for p in programs]
        starts = np.cumsum([0, *counts[:-1]]).tolist()
        each = zip(programs, starts, strict=True)
        segments = pad([np.add(p.token_segments, start) for p, start in each])
        owner = torch.from_numpy(np.repeat(np.arange(len(programs)), counts))
        tokens = pad([p.token_ids for p in programs])
        return cls(tokens.to(device), segments.to(device), owner.to(device), starts)
