"""A multilayer perceptron evaluated on streams: some inputs, and with the first of them its derivatives along directions.

A contact's Jacobian is a derivative of its gap along six twists, and the loss needs gaps at two poses, so that one transition
sends S + R inputs through each layer: S primal streams x_s and R tangents t_r of the first,

    z_s = W a_s + b,  a_s' = f(z_s)        z_r = W a_r,  a_r' = f'(z_0) a_r        (forward mode)

All of it is one matrix product per layer, and reverse mode by the weights runs through the tangents too. A tape keeps each
layer's streams, from which gradients per transition follow without any further pass: dW = sum_r (dL/dz_r) a_r^T (METHOD 2.7).
"""

from enum import StrEnum
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from contact_curation.errors import InvalidValueError


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
