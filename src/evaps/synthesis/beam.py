"""Beam search over programs: only what the grammar allows and what still fits the longest program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from evaps.dsl import VOCAB, GrammarState, Program
from evaps.models.base import Features, Synthesizer

MAX_TOKENS = 32


@dataclass(frozen=True)
class Proposal:
    """A program and the logarithm of its probability under the synthesizer."""

    program: Program
    log_probability: float


@dataclass(frozen=True)
class _Hypothesis:
    tokens: tuple[int, ...]
    score: float
    grammar: GrammarState


@torch.inference_mode()
def beam_search(
    model: Synthesizer, features: Features, beam: int, max_tokens: int = MAX_TOKENS
) -> list[list[Proposal]]:
    """For each task its most probable programs, best first, by the sum of log-probabilities.

    Args:
        model: the synthesizer, in evaluation mode.
        features: of the tasks' pairs.
        beam: how many hypotheses are kept, and at most how many programs come out.
        max_tokens: the longest program.
    """
    tasks = features.shape[0]
    live = [[_Hypothesis((), 0.0, GrammarState.start())] for _ in range(tasks)]
    done: list[list[_Hypothesis]] = [[] for _ in range(tasks)]
    state = model.start(features)
    tokens: Tensor | None = None
    rows: Tensor | None = None
    for length in range(max_tokens):
        logits, state = model.step(state, tokens, rows)
        scores = _scores(logits, [h for group in live for h in group], max_tokens - length)
        live, chosen = _extend(live, done, scores, beam)
        if not chosen:
            break
        rows = torch.tensor([row for row, _ in chosen], device=features.device)
        tokens = torch.tensor([token for _, token in chosen], device=features.device)
    return [_proposals(group, beam) for group in done]


def _scores(
    logits: Tensor, hypotheses: list[_Hypothesis], remaining: int
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    masks = torch.from_numpy(np.stack([h.grammar.allowed_within(remaining) for h in hypotheses]))
    logits = logits.float().masked_fill(~masks.to(logits.device), -torch.inf)
    before = np.array([h.score for h in hypotheses])[:, None]
    return before + logits.log_softmax(-1).double().cpu().numpy()


def _extend(
    live: list[list[_Hypothesis]], done: list[list[_Hypothesis]], scores: np.ndarray, beam: int
) -> tuple[list[list[_Hypothesis]], list[tuple[int, int]]]:
    """The best extensions of every task; finished ones move to ``done``."""
    extended: list[list[_Hypothesis]] = []
    chosen: list[tuple[int, int]] = []
    row = 0
    for task, group in enumerate(live):
        block = scores[row : row + len(group)].ravel()
        worst = done[task][beam - 1].score if len(done[task]) >= beam else -np.inf
        best = np.argpartition(-block, beam)[:beam] if block.size > beam else np.arange(block.size)
        extended.append([])
        for flat in best[np.argsort(-block[best], kind="stable")]:
            if not block[flat] > worst:
                break
            parent, token = divmod(int(flat), len(VOCAB))
            old = group[parent]
            new = _Hypothesis((*old.tokens, token), float(block[flat]), old.grammar.advance(token))
            if new.grammar.finished:
                done[task].append(new)
            else:
                extended[-1].append(new)
                chosen.append((row + parent, token))
        done[task].sort(key=lambda h: -h.score)
        row += len(group)
    return extended, chosen


def _proposals(group: list[_Hypothesis], beam: int) -> list[Proposal]:
    return [Proposal(Program.from_tokens(VOCAB.decode(h.tokens)), h.score) for h in group[:beam]]
