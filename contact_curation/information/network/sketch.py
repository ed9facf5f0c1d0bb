"""Gradients by a network's weights, a transition each, of which not a single one is formed (method.md 2.7).

A linear layer that sees streams a_r and whose outputs have slopes delta_r has, for one transition, the gradient
dW = sum_r delta_r a_r^T by its weights and db = sum of the primal delta_r by its biases. Their lengths are exact:

    |dW|^2 = sum_rs (delta_r . delta_s)(a_r . a_s)        |db|^2 = sum_rs (delta_r . delta_s) over primal r, s

which takes R^2 (D + H) operations instead of the D H numbers of dW (Goodfellow 2015, with streams in place of a sequence). A
sketch holds a gradient in a few hundred numbers, so that inner products are nearly those of the gradients.

Each layer's gradient sum_r delta_r a_r^T is projected from both sides, sum_r (P_o delta_r)(P_i a_r)^T, which never forms it
(LoGra, Choe et al. 2024). Random projections alone are too rough at this size, since what a Kronecker product of two of rank R
loses goes by 2 / R and not by 1 / R. But one network's streams and slopes lie near few directions. So the first rows of each P
are the leading directions of a reference, and only what is left is projected at random, which keeps inner products right on
average whatever the reference. `benchmarks.selection.network_information` measures what comes of it.

The reference follows from the model alone, poses of its body at random and slopes at random, so that the same theta has the
same sketch in every process.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.stream_network import LayerTrace
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.config import SketchConfig

REFERENCE_POSES = 256
REFERENCE_PERIOD = 1.0 / 150.0
"""From one pose to the next [s]; only how the body moves within it matters."""

SPREAD = 2.0
"""Of the reference's places on the board, in outer radii of the body (standard deviation)."""


def ghost_norms(trace: LayerTrace, deltas: Tensor) -> Tensor:
    """Squared lengths (B,) of the gradients by a layer's weights and biases, from slopes (B, S + R, H) by its outputs."""
    inputs = trace.inputs.detach()
    alike = inputs @ inputs.mT  # (B, S + R, S + R)
    alike[:, : trace.primal, : trace.primal] += 1.0  # the bias, as one more input that is 1 for primal streams
    return (alike * (deltas @ deltas.mT)).sum(dim=(1, 2))


def summed_gradient(tape: Sequence[LayerTrace], deltas: Sequence[Tensor], span: slice = slice(None)) -> Tensor:
    """(P,) the gradients of all layers summed over some transitions: weights and biases of each, in the order of the tape."""
    parts = []
    for trace, slopes in zip(tape, (each[span] for each in deltas), strict=True):
        parts.append((slopes.flatten(0, 1).mT @ trace.inputs.detach()[span].flatten(0, 1)).flatten())
        parts.append(slopes[:, : trace.primal].sum(dim=(0, 1)))
    return torch.cat(parts)


class LayerSketch(NamedTuple):
    """Projections P_o (H', H) of a layer's slopes and P_i (D', D + 1) of its inputs, the last column for the bias."""

    outputs: Tensor
    inputs: Tensor

    @property
    def columns(self) -> int:
        return len(self.outputs) * len(self.inputs)

    def rows(self, trace: LayerTrace, deltas: Tensor) -> Tensor:
        """Sketched gradients (B, H' D')."""
        inputs = trace.inputs.detach() @ self.inputs[:, :-1].mT  # (B, S + R, D')
        inputs[:, : trace.primal] += self.inputs[:, -1]
        return ((deltas @ self.outputs.mT).mT @ inputs).flatten(1)


@dataclass(frozen=True, eq=False)
class NetworkSketch:
    """The projections of all layers, in the order of a tape."""

    layers: tuple[LayerSketch, ...]

    def to(self, device: torch.device) -> "NetworkSketch":
        """The same projections, bit for bit, on a device."""
        return NetworkSketch(tuple(LayerSketch(*(matrix.to(device) for matrix in layer)) for layer in self.layers))

    @property
    def columns(self) -> int:
        """C."""
        return sum(layer.columns for layer in self.layers)

    def rows(self, tape: Sequence[LayerTrace], deltas: Sequence[Tensor]) -> Tensor:
        """Sketched gradients (B, C)."""
        each = zip(self.layers, tape, deltas, strict=True)
        return torch.cat([layer.rows(trace, slopes) for layer, trace, slopes in each], dim=1)


def network_sketch(model: Model, config: SketchConfig) -> NetworkSketch:
    """The sketch of a model (`forward_pass.frozen_copy`) at its theta."""
    rng = np.random.default_rng(config.seed)
    tape: list[LayerTrace] = []
    outputs = model.outputs(reference_rows(model.body, model.place(), rng), tape)
    slopes = [torch.as_tensor(rng.standard_normal(tuple(value.shape))) for value in outputs]
    deltas = torch.autograd.grad(outputs, [trace.outputs for trace in tape], slopes)
    return NetworkSketch(tuple(_layer_sketch(*pair, config, rng) for pair in zip(tape, deltas, strict=True)))


def reference_rows(body: Body, place: Array, rng: np.random.Generator) -> Rows:
    """A body anywhere about a place (3,), at any attitude, up to its own size above the board, as fast as if it fell there."""
    count, radius = REFERENCE_POSES, float(np.linalg.norm(body.scaled_vertices, axis=1).max())
    speed = float(np.sqrt(2.0 * body.scaled_gravity * radius))
    before = np.zeros((count, 13))
    before[:, :2] = place[:2] + SPREAD * radius * rng.standard_normal((count, 2))
    before[:, 2] = place[2] + radius * rng.uniform(0.5, 2.0, count)
    before[:, 3:7] = quaternions.normalized(rng.standard_normal((count, 4)))
    before[:, 7:10] = speed * rng.standard_normal((count, 3))
    before[:, 10:] = speed / radius * rng.standard_normal((count, 3))
    after = before.copy()
    after[:, :3] += REFERENCE_PERIOD * before[:, 7:10]
    after[:, 3:7] = quaternions.multiply(before[:, 3:7], quaternions.exp(REFERENCE_PERIOD * before[:, 10:]))
    return Rows(before, after, np.full(count, REFERENCE_PERIOD))


def _layer_sketch(trace: LayerTrace, deltas: Tensor, config: SketchConfig, rng: np.random.Generator) -> LayerSketch:
    inputs = torch.nn.functional.pad(trace.inputs.detach(), (0, 1))  # (B, S + R, D + 1)
    inputs[:, : trace.primal, -1] = 1.0
    outputs = _projection(deltas.flatten(0, 1).numpy(), config, rng)
    return LayerSketch(outputs, _projection(inputs.flatten(0, 1).numpy(), config, rng))


def _projection(reference: Array, config: SketchConfig, rng: np.random.Generator) -> Tensor:
    """Leading directions of vectors (N, D), and random ones across them; the identity where there are no more than these."""
    size = reference.shape[1]
    if size <= config.size:
        return torch.eye(size, dtype=torch.float64)
    leading = _leading(reference, config.leading)
    random = rng.standard_normal((config.random, size)) / np.sqrt(max(config.random, 1))
    return torch.as_tensor(np.concatenate([leading, random - (random @ leading.T) @ leading]))


def _leading(reference: Array, count: int) -> Array:
    """Orthonormal rows (count, D) that hold the most of vectors (N, D)."""
    size = reference.shape[1]
    if count == 0:
        return np.zeros((0, size))
    _, vectors = scipy.linalg.eigh(reference.T @ reference, subset_by_index=(size - count, size - 1))
    strongest = vectors[np.abs(vectors).argmax(axis=0), np.arange(count)]
    return np.asarray((vectors * np.sign(strongest)).T)  # LAPACK may return either sign
