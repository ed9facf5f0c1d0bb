"""Lengths and sums of gradients per transition, without forming a single one of them (METHOD 2.7).

A linear layer that sees streams a_r and whose outputs have slopes delta_r has, for one transition, the gradient
dW = sum_r delta_r a_r^T by its weights and db = sum of the primal delta_r by its biases. So

    |dW|^2 = sum_rs (delta_r . delta_s)(a_r . a_s)        |db|^2 = sum_rs (delta_r . delta_s) over primal r, s

which takes R^2 (D + H) operations instead of the D H numbers of dW (Goodfellow 2015, with streams in place of a sequence).
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from contact_curation.contact.models.stream_network import LayerTrace


def ghost_norms(trace: LayerTrace, deltas: Tensor) -> Tensor:
    """Squared lengths (B,) of the gradients by a layer's weights and biases, from slopes (B, S + R, H) by its outputs."""
    inputs = trace.inputs.detach()
    alike = inputs @ inputs.mT  # (B, S + R, S + R)
    alike[:, : trace.primal, : trace.primal] += 1.0  # the bias, as one more input that is 1 for primal streams
    return (alike * (deltas @ deltas.mT)).sum(dim=(1, 2))


def summed_gradient(tape: Sequence[LayerTrace], deltas: Sequence[Tensor]) -> Tensor:
    """(P,) the gradients of all layers summed over the transitions: weights and biases of each, in the order of the tape."""
    parts = []
    for trace, slopes in zip(tape, deltas, strict=True):
        parts.append((slopes.flatten(0, 1).mT @ trace.inputs.detach().flatten(0, 1)).flatten())
        parts.append(slopes[:, : trace.primal].sum(dim=(0, 1)))
    return torch.cat(parts)
