"""The edit decoder a step at a time: what does not depend on the edits is computed once, before the first.

A beam asks for one edit after the other, and most of what goes into the LSTM comes again and again: the token
at the pointer, for each pair; the edit before, for all pairs. So both are multiplied with the LSTM's weights
beforehand, and a step only looks them up: half of the arithmetic, and the same numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional as F

from evaps.models.recurrent import next_state

if TYPE_CHECKING:
    from evaps.models.sequential_edits import SequentialEdits

Memory = Float[Tensor, "batch pair time memory"]


class LayerState(NamedTuple):
    """One layer of the LSTM, a row for each hypothesis, with all its pairs."""

    hidden: Float[Tensor, "row pair hidden"]
    cell: Float[Tensor, "row pair hidden"]


class Weights(NamedTuple):
    """Of one layer of an LSTM, the two biases added up."""

    into: Float[Tensor, "gate input"]
    onwards: Float[Tensor, "gate hidden"]
    bias: Float[Tensor, " gate"]

    @classmethod
    def of(cls, lstm: nn.LSTM, layer: int) -> Weights:
        """The weights of a layer, from 0."""
        into, onwards, *biases = lstm.all_weights[layer]
        return cls(into, onwards, biases[0] + biases[1])


class EditSteps:
    """The decoder for some programs, in evaluation mode.

    Args:
        edits: the decoder.
        memory: representations of the programs' tokens.
    """

    def __init__(self, edits: SequentialEdits, memory: Memory) -> None:
        self.output = edits.output
        self.layers = [Weights.of(edits.lstm, number) for number in range(edits.lstm.num_layers)]
        size, (into, _, bias) = edits.lstm.hidden_size, self.layers[0]
        tokens = edits.norm(memory)
        self.edit = F.linear(edits.edit.weight, into[:, :size], bias)
        self.written: Tensor | None = None
        if edits.written is not None:
            self.written = F.linear(edits.written.weight, into[:, size : 2 * size])
        self.token = F.linear(tokens, into[:, -memory.shape[-1] :]).transpose(1, 2)
        self.seen = F.linear(tokens.amax(1), self.output.weight[:, size:], self.output.bias)
        zeros = memory.new_zeros(len(memory), memory.shape[1], size)
        self.owner = torch.arange(len(memory), device=memory.device)
        self.states = [LayerState(zeros, zeros)] * len(self.layers)

    def select(self, rows: Int[Tensor, " row"]) -> None:
        """Go on from these rows of the last step."""
        self.owner = self.owner[rows]
        self.states = [LayerState(state.hidden[rows], state.cell[rows]) for state in self.states]

    def step(
        self, last: Int[Tensor, " row"], written: Int[Tensor, " row"], pointers: Int[Tensor, " row"]
    ) -> Float[Tensor, "row choice"]:
        """Logits of the next edit: the same as the decoder's, which is told all of them at once."""
        told = self.edit[last] if self.written is None else self.edit[last] + self.written[written]
        gates = told[:, None] + self.token[self.owner, pointers]
        for number, (weights, state) in enumerate(zip(self.layers, self.states, strict=True)):
            if number:
                gates = F.linear(self.states[number - 1].hidden, weights.into, weights.bias)
            gates = gates + F.linear(state.hidden, weights.onwards)
            self.states[number] = LayerState(*next_state(gates, state.cell))
        pooled = self.states[-1].hidden.amax(1)
        return F.linear(pooled, self.output.weight[:, : pooled.shape[-1]]) + self.seen[self.owner, pointers]
