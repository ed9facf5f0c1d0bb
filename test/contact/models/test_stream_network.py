"""Networks on streams: values and derivatives of plain torch, gradients per transition from a tape, seeds, scaled inputs."""

import numpy as np
import pytest
import torch
from torch import Tensor

from contact_curation.contact.models.stream_network import Activation, InputScaling, LayerTrace, StreamNetwork
from contact_curation.errors import InvalidValueError

SIZES = (5, 16, 12, 3)
BOTH = pytest.mark.parametrize("activation", list(Activation))


def network(activation: Activation = Activation.TANH, seed: int = 0) -> StreamNetwork:
    return StreamNetwork(SIZES, activation).initialise(np.random.default_rng(seed))


def inputs(batch: int = 4, primal: int = 2, tangents: int = 6) -> tuple[Tensor, Tensor]:
    rng = np.random.default_rng(1)
    shapes = [(batch, primal, SIZES[0]), (batch, tangents, SIZES[0])]
    first, second = (torch.as_tensor(rng.standard_normal(shape)) for shape in shapes)
    return first, second


def plain(net: StreamNetwork, given: Tensor) -> Tensor:
    """The same network as torch writes it."""
    squash = {Activation.TANH: torch.nn.Tanh, Activation.RELU: torch.nn.ReLU}[net.activation]
    stages = [stage for layer in net.linear for stage in (layer, squash())]
    outputs: Tensor = torch.nn.Sequential(*stages[:-1])(given)
    return outputs


def derivatives(net: StreamNetwork, given: Tensor, along: Tensor) -> Tensor:
    """(B, R, O) of the plain network at (B, D) along (B, R, D)."""
    jacobians = torch.func.vmap(torch.func.jacrev(lambda each: plain(net, each)))(given)
    return torch.einsum("bod,brd->bro", jacobians, along)


def weighing(like: Tensor) -> Tensor:
    return torch.as_tensor(np.random.default_rng(2).standard_normal(tuple(like.shape)))


@BOTH
def test_streams_are_the_plain_network_and_its_directional_derivatives(activation: Activation) -> None:
    net, (primal, tangents) = network(activation), inputs()
    outputs, slopes = net(primal, tangents)
    assert torch.allclose(outputs, plain(net, primal), atol=1e-14)
    assert torch.allclose(slopes, derivatives(net, primal[:, 0], tangents), atol=1e-14)


@BOTH
@pytest.mark.parametrize("tangents", [0, 6])
def test_reverse_mode_runs_through_the_tangents(activation: Activation, tangents: int) -> None:
    net, (primal, along) = network(activation), inputs(tangents=tangents)
    values = (primal.requires_grad_(), along.requires_grad_(), *net.parameters())
    outputs, slopes = net(primal, along)
    found = torch.autograd.grad((outputs * weighing(outputs)).sum() + (slopes * weighing(slopes)).sum(), values)
    moved = derivatives(net, primal[:, 0], along)
    reference = (plain(net, primal) * weighing(outputs)).sum() + (moved * weighing(slopes)).sum()
    expected = torch.autograd.grad(reference, values, allow_unused=True, materialize_grads=True)
    for one, other in zip(found, expected):
        assert torch.allclose(one, other, atol=1e-13)


@BOTH
def test_a_tape_gives_the_gradient_of_each_transition(activation: Activation) -> None:
    net, (primal, along) = network(activation), inputs()
    tape: list[LayerTrace] = []
    outputs, slopes = net(primal, along, tape)
    each = (outputs * weighing(outputs)).sum(dim=(1, 2)) + (slopes * weighing(slopes)).sum(dim=(1, 2))
    delta = torch.autograd.grad(each.sum(), [trace.outputs for trace in tape], retain_graph=True)
    assert [trace.layer for trace in tape] == list(net.linear)
    for n in range(len(primal)):
        expected = torch.autograd.grad(each[n], list(net.parameters()), retain_graph=True)
        for depth, trace in enumerate(tape):
            assert torch.allclose(delta[depth][n].mT @ trace.inputs[n], expected[2 * depth], atol=1e-13)
            assert torch.allclose(delta[depth][n, : trace.primal].sum(dim=0), expected[2 * depth + 1], atol=1e-13)


def test_a_seed_gives_the_same_bytes_and_another_others() -> None:
    same, again, other = (b"".join(v.detach().numpy().tobytes() for v in network(seed=s).parameters()) for s in (3, 3, 4))
    assert same == again
    assert same != other


def test_the_initialisation_is_torchs_own() -> None:
    for layer in StreamNetwork((12, 256, 8)).initialise(np.random.default_rng(5)).linear:
        for value in (layer.weight, layer.bias):
            bound = layer.in_features**-0.5
            assert 0.8 * bound < float(value.detach().abs().max()) <= bound


@pytest.mark.parametrize("sizes", [(3,), (3, 0, 2)])
def test_sizes_that_are_no_network_are_refused(sizes: tuple[int, ...]) -> None:
    with pytest.raises(InvalidValueError, match="sizes"):
        StreamNetwork(sizes)
    assert StreamNetwork((1, 1)).linear[0].weight.shape == (1, 1)


def test_inputs_come_out_with_mean_zero_and_unbiased_deviation_one() -> None:
    data = np.random.default_rng(0).normal([1.0, -2.0], [3.0, 0.01], size=(5, 2))
    scaled = InputScaling(2).fit(data)(torch.as_tensor(data)).numpy()
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(scaled.std(axis=0, ddof=1), 1.0, rtol=1e-12)


def test_an_input_that_never_varied_is_zero_whatever_it_becomes() -> None:
    scaling = InputScaling(2).fit(np.array([[0.1, 1.0], [0.1, 2.0], [0.1, 4.0]]))
    assert scaling(torch.tensor([[7.0, 1.0]], dtype=torch.float64))[0, 0] == 0.0


def test_it_passes_inputs_as_they_are_until_it_is_fitted() -> None:
    values = torch.tensor([[1.5, -2.0]], dtype=torch.float64)
    assert torch.equal(InputScaling(2)(values), values)


def test_one_row_has_no_deviation() -> None:
    with pytest.raises(InvalidValueError, match="1 transitions, expected at least 2"):
        InputScaling(2).fit(np.ones((1, 2)))
