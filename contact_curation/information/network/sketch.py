"""A gradient by a network's weights in a few hundred numbers, so that inner products are nearly those of the gradients.

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
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import Rows
from contact_curation.contact.models.stream_network import LayerTrace
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.config import SketchConfig
from contact_curation.information.network.forward_pass import NetworkModel, said_of

REFERENCE_POSES = 256
REFERENCE_PERIOD = 1.0 / 150.0
"""From one pose to the next [s]; only how the body moves within it matters."""

SPREAD = 2.0
"""Of the reference's places on the board, in outer radii of the body (standard deviation)."""


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

    @property
    def columns(self) -> int:
        """C."""
        return sum(layer.columns for layer in self.layers)

    def rows(self, tape: Sequence[LayerTrace], deltas: Sequence[Tensor]) -> Tensor:
        """Sketched gradients (B, C)."""
        each = zip(self.layers, tape, deltas, strict=True)
        return torch.cat([layer.rows(trace, slopes) for layer, trace, slopes in each], dim=1)


def network_sketch(model: NetworkModel, config: SketchConfig) -> NetworkSketch:
    """The sketch of a model (`network_pass.frozen_copy`) at its theta."""
    rng = np.random.default_rng(config.seed)
    tape: list[LayerTrace] = []
    said = said_of(model, reference_rows(model.body, _place(model), rng), tape)
    slopes = [torch.as_tensor(rng.standard_normal(tuple(value.shape))) for value in said]
    deltas = torch.autograd.grad(said, [trace.outputs for trace in tape], slopes)
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


def _place(model: NetworkModel) -> Array:
    """The point (3,) of the board about which a model was trained, as far as it knows."""
    if isinstance(model, DeepModel):
        return model.polytope.geometry().pivot
    if isinstance(model, EndToEndModel):
        return np.array([*model.scaling.mean[:2].tolist(), 0.0])
    return np.zeros(3)


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
