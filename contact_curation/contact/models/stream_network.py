"""A multilayer perceptron evaluated on streams: some inputs, and with the first of them its derivatives along directions.

A contact's Jacobian is a derivative of its gap along six twists, and the loss needs gaps at two poses, so that one transition
sends S + R inputs through each layer: S primal streams x_s and R tangents t_r of the first,

    z_s = W a_s + b,  a_s' = f(z_s)        z_r = W a_r,  a_r' = f'(z_0) a_r        (forward mode)

All of it is one matrix product per layer, and reverse mode by the weights runs through the tangents too. A tape keeps each
layer's streams, from which gradients per transition follow without any further pass: dW = sum_r (dL/dz_r) a_r^T
(method.md 2.7).

A pose enters as position and rotation matrix, [x, vec R], vec row by row. A twist (v in the board's frame, omega in the body's)
moves it along the chart x + v, R exp(hat omega), so that the inputs' directional derivatives are

    d[x, vec R] = [v, vec(R hat omega)]
"""

from enum import StrEnum
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

CONSTANT = 1e-9
"""An input with a standard deviation up to this never varies; it is fed as zero."""

_HATS = torch.zeros(3, 3, 3, dtype=torch.float64)
for _axis in range(3):
    _HATS[_axis, (_axis + 2) % 3, (_axis + 1) % 3] = 1.0
    _HATS[_axis, (_axis + 1) % 3, (_axis + 2) % 3] = -1.0


def pose_inputs(rotations: Tensor, positions: Tensor) -> Tensor:
    """Inputs (..., 12) of poses (..., 3, 3) and (..., 3)."""
    return torch.cat([positions, rotations.flatten(-2)], dim=-1)


def spin_tangents(rotations: Tensor) -> Tensor:
    """Derivatives (B, 3, 9) of vec R along turns about the body's three axes, at rotations (B, 3, 3)."""
    return torch.einsum("bij,cjk->bcik", rotations, _HATS.to(rotations)).flatten(-2)


def twist_tangents(rotations: Tensor) -> Tensor:
    """Derivatives (B, 6, 12) of the inputs along the six twists, at rotations (B, 3, 3)."""
    tangents = rotations.new_zeros(len(rotations), 6, 12)
    tangents[:, :3, :3] = torch.eye(3, dtype=rotations.dtype, device=rotations.device)
    tangents[:, 3:, 3:] = spin_tangents(rotations)
    return tangents


class InputScaling(torch.nn.Module):
    """(inputs - mean) * scale over the last axis of D numbers; it passes them as they are until it is fitted or loaded."""

    mean: Tensor
    scale: Tensor

    def __init__(self, width: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(width, dtype=torch.float64))
        self.register_buffer("scale", torch.ones(width, dtype=torch.float64))

    def fit(self, inputs: Array) -> "InputScaling":
        """To the N >= 2 rows of `inputs` (N, D), by their mean and unbiased standard deviation.

        Raises:
            InvalidValueError: fewer rows.
        """
        if len(inputs) < 2:
            raise InvalidValueError("data", f"{len(inputs)} transitions", "at least 2 to normalise a network's inputs by")
        deviation = inputs.std(axis=0, ddof=1)
        varies = deviation > CONSTANT
        self.mean.copy_(torch.as_tensor(inputs.mean(axis=0)))
        self.scale.copy_(torch.as_tensor(np.where(varies, 1.0 / np.where(varies, deviation, 1.0), 0.0)))
        return self

    def forward(self, inputs: Tensor) -> Tensor:
        return (inputs - self.mean) * self.scale


class Activation(StrEnum):
    """What stands between two layers."""

    TANH = "tanh"
    RELU = "relu"


class LayerTrace(NamedTuple):
    """What one linear layer saw.

    Attributes:
        layer: it.
        inputs: (B, S + R, D).
        outputs: (B, S + R, H) before the activation, part of the autograd graph.
        primal: S; only the first S streams carry the bias.
    """

    layer: torch.nn.Linear
    inputs: Tensor
    outputs: Tensor
    primal: int


class StreamNetwork(torch.nn.Module):
    """Linear layers with an activation between each two; zero until they are initialised or loaded.

    Args:
        sizes: of the input, the hidden layers and the output.
        activation: between the layers.

    Raises:
        InvalidValueError: fewer than two sizes, or one that is not positive.
    """

    def __init__(self, sizes: tuple[int, ...], activation: Activation = Activation.TANH) -> None:
        super().__init__()
        if len(sizes) < 2 or min(sizes) < 1:
            raise InvalidValueError("sizes", sizes, "at least two positive numbers")
        self.activation = activation
        self.layers = torch.nn.ModuleList(_zero_layer(*pair) for pair in pairwise(sizes))

    def initialise(self, rng: np.random.Generator) -> "StreamNetwork":
        """Torch's own default, uniform within 1 / sqrt(inputs) for weights and biases, as ContactNets has it; from `rng`."""
        with torch.no_grad():
            for layer in self.linear:
                bound = layer.in_features**-0.5
                for value in (layer.weight, layer.bias):
                    value.copy_(torch.as_tensor(rng.uniform(-bound, bound, tuple(value.shape))))
        return self

    @property
    def linear(self) -> tuple[torch.nn.Linear, ...]:
        """The layers in order."""
        return tuple(layer for layer in self.layers if isinstance(layer, torch.nn.Linear))

    def forward(self, primal: Tensor, tangents: Tensor, tape: list[LayerTrace] | None = None) -> tuple[Tensor, Tensor]:
        """Outputs at inputs, and their derivatives at the first.

        Args:
            primal: (B, S, D) inputs, S >= 1.
            tangents: (B, R, D) directions at the first input.
            tape: takes a `LayerTrace` per layer, in their order.

        Returns:
            Outputs (B, S, O) and their derivatives (B, R, O).
        """
        count, last = primal.shape[1], len(self.layers) - 1
        streams = torch.cat([primal, tangents], dim=1)  # (B, S + R, D)
        for depth, layer in enumerate(self.linear):
            before = streams
            streams = _StreamedLinear.apply(before, layer.weight, layer.bias, count)
            if tape is not None:
                tape.append(LayerTrace(layer, before, streams, count))
            if depth < last:
                streams = _StreamedActivation.apply(streams, self.activation, count)
        return streams[:, :count], streams[:, count:]


def _zero_layer(inputs: int, outputs: int) -> torch.nn.Linear:
    """Torch's own initialisation would draw from its global generator."""
    layer: torch.nn.Linear = torch.nn.utils.skip_init(torch.nn.Linear, inputs, outputs, dtype=torch.float64)  # type: ignore[no-untyped-call]
    for value in layer.parameters():
        torch.nn.init.zeros_(value)
    return layer


class _StreamedLinear(torch.autograd.Function):
    """W a for all streams and + b for the first S: one product, without the copies that slices and sums would make."""

    @staticmethod
    def forward(ctx: Any, streams: Tensor, weight: Tensor, bias: Tensor, primal: int) -> Tensor:
        ctx.save_for_backward(streams, weight)
        ctx.primal = primal
        outputs = streams @ weight.mT
        outputs[:, :primal] += bias
        return outputs

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, slopes: Tensor) -> tuple[Tensor | None, ...]:
        streams, weight = ctx.saved_tensors
        flat = slopes.flatten(0, 1)
        by_streams = slopes @ weight if ctx.needs_input_grad[0] else None
        by_weight = flat.mT @ streams.flatten(0, 1) if ctx.needs_input_grad[1] else None
        by_bias = slopes[:, : ctx.primal].sum(dim=(0, 1)) if ctx.needs_input_grad[2] else None
        return by_streams, by_weight, by_bias, None


class _StreamedActivation(torch.autograd.Function):
    """f of the first S streams, and f' at the first of them times the others."""

    @staticmethod
    def forward(ctx: Any, streams: Tensor, activation: Activation, primal: int) -> Tensor:
        slope: Tensor
        outputs = torch.empty_like(streams)
        if activation is Activation.TANH:
            torch.tanh(streams[:, :primal], out=outputs[:, :primal])
            slope = 1.0 - outputs[:, :1].square()
        else:
            torch.clamp(streams[:, :primal], min=0.0, out=outputs[:, :primal])
            slope = (streams[:, :1] > 0.0).to(streams)
        torch.mul(streams[:, primal:], slope, out=outputs[:, primal:])
        ctx.save_for_backward(outputs, slope)
        ctx.activation, ctx.primal = activation, primal
        return outputs

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, slopes: Tensor) -> tuple[Tensor | None, ...]:
        outputs, slope = ctx.saved_tensors
        primal = ctx.primal
        inward = torch.empty_like(slopes)
        torch.mul(slopes[:, primal:], slope, out=inward[:, primal:])
        if ctx.activation is Activation.RELU:
            torch.mul(slopes[:, :primal], outputs[:, :primal] > 0.0, out=inward[:, :primal])
            return inward, None, None
        torch.mul(slopes[:, :primal], 1.0 - outputs[:, :primal].square(), out=inward[:, :primal])
        # f'' = -2 tanh f', and a tangent's output is f' z_r already: the slopes of all tangents meet in the first stream.
        curvature = (slopes[:, primal:] * outputs[:, primal:]).sum(dim=1)
        inward[:, 0] -= 2.0 * outputs[:, 0] * curvature
        return inward, None, None
