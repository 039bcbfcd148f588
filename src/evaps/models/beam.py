"""Beam search: over programs token by token, and over whatever else grows by choices and has a mask."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Int
from numpy.typing import NDArray
from torch import Tensor

from evaps.dsl import GrammarState, Program
from evaps.dsl.sampler import MAX_TOKENS
from evaps.models.base import Synthesizer


@runtime_checkable
class Partial(Protocol):
    """The left part of what is searched for. Immutable."""

    @property
    def finished(self) -> bool:
        """Whether nothing more is to be chosen."""

    def allowed(self) -> NDArray[np.bool_]:
        """Which choices come next, bool ``[choice]``; at least one, unless it is finished."""

    def advance(self, choice: int) -> Any:
        """One of the same kind, with one more choice."""


P = TypeVar("P", bound=Partial)


@dataclass(frozen=True)
class Hypothesis(Generic[P]):
    """A partial result and the logarithm of its probability."""

    partial: P
    score: float


Chosen = tuple[Int[Tensor, " row"], Int[Tensor, " row"]]
"""For each live hypothesis: the row of the last step that it goes on from, and what was chosen there."""
Step = Callable[[Sequence[P], Chosen | None], Float[Tensor, "row choice"]]
"""Logits of the next choice for all live hypotheses; at the first step nothing was chosen yet."""


@torch.inference_mode()
def search(starts: Sequence[P], step: Step[P], beam: int, steps: int) -> list[list[Hypothesis[P]]]:
    """For each start the most probable finished results, best first, by the sum of log-probabilities.

    Args:
        starts: one for each search; all are done together.
        step: the model.
        beam: how many hypotheses a search keeps, and at most how many results it has.
        steps: choices at most.
    """
    live = [[Hypothesis(start, 0.0)] for start in starts]
    done: list[list[Hypothesis[P]]] = [[] for _ in starts]
    chosen: Chosen | None = None
    for _ in range(steps):
        hypotheses = [h for group in live for h in group]
        logits = step([h.partial for h in hypotheses], chosen)
        live, picked = _extend(live, done, _scores(logits, hypotheses), beam)
        if not picked:
            break
        rows, choices = torch.tensor(picked, device=logits.device).unbind(1)
        chosen = rows, choices
    return [group[:beam] for group in done]


def _scores(logits: Tensor, hypotheses: Sequence[Hypothesis[Any]]) -> NDArray[np.float64]:
    masks = torch.from_numpy(np.stack([h.partial.allowed() for h in hypotheses]))
    logits = logits.float().masked_fill(~masks.to(logits.device), -torch.inf)
    before = np.array([h.score for h in hypotheses])[:, None]
    scores: NDArray[np.float64] = before + logits.log_softmax(-1).double().cpu().numpy()
    return scores


def _extend(
    live: list[list[Hypothesis[P]]],
    done: list[list[Hypothesis[P]]],
    scores: NDArray[np.float64],
    beam: int,
) -> tuple[list[list[Hypothesis[P]]], list[tuple[int, int]]]:
    """The best extensions of every search; finished ones move to ``done``."""
    extended: list[list[Hypothesis[P]]] = []
    picked: list[tuple[int, int]] = []
    row = 0
    for group, finished in zip(live, done, strict=True):
        block = scores[row : row + len(group)]
        worst = finished[beam - 1].score if len(finished) >= beam else -np.inf
        extended.append([])
        for flat in _best(block.ravel(), beam):
            parent, choice = divmod(int(flat), scores.shape[1])
            if not block[parent, choice] > worst:
                break
            new = Hypothesis(group[parent].partial.advance(choice), float(block[parent, choice]))
            if new.partial.finished:
                finished.append(new)
            else:
                extended[-1].append(new)
                picked.append((row + parent, choice))
        finished.sort(key=lambda h: -h.score)
        row += len(group)
    return extended, picked


def _best(scores: NDArray[np.float64], beam: int) -> NDArray[np.int64]:
    best = np.argpartition(-scores, beam)[:beam] if scores.size > beam else np.arange(scores.size)
    return best[np.argsort(-scores[best], kind="stable")]


@dataclass(frozen=True)
class Prefix:
    """The first tokens of a program that has at most ``max_tokens``."""

    tokens: tuple[int, ...]
    grammar: GrammarState
    max_tokens: int

    @property
    def finished(self) -> bool:
        """Whether it is a whole program."""
        return self.grammar.finished

    def allowed(self) -> NDArray[np.bool_]:
        """The tokens after which the program can still be completed."""
        return self.grammar.allowed_within(self.max_tokens - len(self.tokens))

    def advance(self, choice: int) -> Prefix:
        """With one more token."""
        return Prefix((*self.tokens, choice), self.grammar.advance(choice), self.max_tokens)


@dataclass(frozen=True)
class Proposal:
    """A program and the logarithm of its probability under the synthesizer."""

    program: Program
    log_probability: float


@torch.inference_mode()
def beam_search(
    model: Synthesizer, features: Any, beam: int, max_tokens: int = MAX_TOKENS
) -> list[list[Proposal]]:
    """For each task its most probable programs, best first.

    Args:
        model: the synthesizer, in evaluation mode.
        features: what it is told of the tasks: see `Synthesizer.start`.
        beam: how many hypotheses are kept, and at most how many programs come out.
        max_tokens: the longest program.
    """
    state = model.start(features)

    def step(_: Sequence[Prefix], chosen: Chosen | None) -> Tensor:
        nonlocal state
        rows, tokens = chosen or (None, None)
        logits, state = model.step(state, tokens, rows)
        return logits

    starts = [Prefix((), GrammarState.start(), max_tokens)] * len(features)
    found = search(starts, step, beam, max_tokens)
    return [[Proposal(Program.from_ids(h.partial.tokens), h.score) for h in group] for group in found]
