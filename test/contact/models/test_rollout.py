"""Rollouts of every model: against the polytope's kernel, against plain loops, alone and in company."""

import functools
from collections.abc import Callable

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import BatchLoss, ContactModel, Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.rollout import BLOCK
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import rollout
from contact_curation.contact.time_step import StepStatus, SweepLimits
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from test.contact.model_cases import tossed_rows
from test.contact.test_rollout import WRONG_LENGTHS, thrown_states
from test.contact.test_time_step import EXACT, touching_states
from test.contact.time_step_oracle import falling_twist, mass_matrix, moved, oracle_step_at

CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)
DT = 1.0 / 148.0


@functools.cache
def deep() -> DeepModel:
    return DeepModel(CUBE, CONTACTNETS_CUBE, Form.CONTACTNETS).initialise(np.random.default_rng(1))


@functools.cache
def deepvertex() -> DeepvertexModel:
    return DeepvertexModel(CUBE.vertices_normal, CONTACTNETS_CUBE).initialise(tossed_rows(), np.random.default_rng(2))


@functools.cache
def end_to_end() -> EndToEndModel:
    return EndToEndModel(CONTACTNETS_CUBE).initialise(tossed_rows(), np.random.default_rng(3))


NETWORKS: list[Callable[[], Model]] = [deep, deepvertex, end_to_end]
every_network = pytest.mark.parametrize("network", NETWORKS, ids=lambda network: str(network.__name__))


@pytest.mark.parametrize("form", list(Form))
def test_a_polytope_takes_its_own_kernel(form: Form) -> None:
    model = PolytopeModel(CUBE, CONTACTNETS_CUBE, form)
    initial, limits = thrown_states(7, seed=1), SweepLimits(1e-8)
    found = model.roll_out(initial, 90, DT, limits, threads=2)
    expected = rollout(model.geometry(), CONTACTNETS_CUBE, initial, 90, DT, limits)
    np.testing.assert_array_equal(found.states, expected.states)


@pytest.mark.parametrize("sweeps", [400, 2])
def test_deep_without_its_networks_is_its_polytope_with_the_same_warm_starts(sweeps: int) -> None:
    initial, limits = thrown_states(BLOCK + 3, seed=2), SweepLimits(max_sweeps=sweeps)
    lengths = np.random.default_rng(3).integers(1, 120, len(initial))
    found = DeepModel(CUBE, CONTACTNETS_CUBE, Form.PHYSICAL).roll_out(initial, lengths, DT, limits)
    expected = rollout(CUBE, CONTACTNETS_CUBE, initial, lengths, DT, limits)
    np.testing.assert_allclose(found.states, expected.states, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.residual, expected.residual, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(found.status, expected.status)
    np.testing.assert_array_equal(found.starts, expected.starts)
    assert found.impulses is None
    assert (found.status == StepStatus.SWEEPS_EXHAUSTED).any() == (sweeps == 2)


@pytest.mark.parametrize("network", [deep, deepvertex], ids=["deep", "deepvertex"])
@pytest.mark.parametrize("count", [1, 7])
def test_a_network_of_contacts_rolls_out_as_in_plain_loops(network: Callable[[], ContactModel], count: int) -> None:
    model, frames = network(), 6
    initial = touching_states(CUBE, 7, seed=4)[:count]
    initial[:, 7:] *= 0.3
    found = model.roll_out(initial, frames, DT, EXACT)
    touched = 0
    for index in range(count):
        state = initial[index]
        for frame in range(1, frames):
            gaps, jacobians = contacts_alone(model, state)
            state, impulses = oracle_step_at(jacobians, gaps, model.body, state, DT)
            touched += int((impulses[:, 0] > 0.0).any())
            np.testing.assert_allclose(found.trajectory(index)[frame], state, atol=1e-7)
    assert touched >= count
    assert (found.status == StepStatus.CONVERGED).all()


def contacts_alone(model: ContactModel, state: Array) -> tuple[Array, Array]:
    rotation = torch.as_tensor(quaternions.to_matrix(state[None, 3:7]))
    with torch.no_grad():
        gaps, jacobians = model.contacts_at(rotation, torch.as_tensor(state[None, :3]))
    return gaps[0].numpy(), jacobians[0].numpy()


@pytest.mark.parametrize("count", [1, 7])
def test_end_to_end_integrates_its_own_impulses_as_in_plain_loops(count: int) -> None:
    initial = thrown_states(7, seed=5)[:count]
    lengths, periods = np.arange(40, 40 - count, -1), np.linspace(0.005, 0.008, 7)[:count]
    found = end_to_end().roll_out(initial, lengths, periods)
    for index in range(count):
        state, dt = initial[index], periods[index]
        for frame in range(1, lengths[index]):
            push = np.linalg.inv(mass_matrix(CONTACTNETS_CUBE)) @ net_impulse(end_to_end(), state)
            state = moved(state, falling_twist(CONTACTNETS_CUBE, state, dt) + push, dt)
            np.testing.assert_allclose(found.trajectory(index)[frame], state, rtol=1e-9, atol=1e-9)
    assert np.abs(found.states[:, 7:]).max() > 1.0
    assert not found.residual.any()
    assert (found.status == StepStatus.CONVERGED).all()


def net_impulse(model: EndToEndModel, state: Array) -> Array:
    """The published network by hand: [x, vec R, v, omega, u], normalised, four hidden layers of ReLU."""
    tensors = {name: value.numpy() for name, value in model.state_dict().items()}
    inputs = np.concatenate([state[:3], quaternions.to_matrix(state[3:7]).ravel(), state[7:], np.zeros(6)])
    values = (inputs - tensors["scaling.mean"]) * tensors["scaling.scale"]
    for depth in range(5):
        values = tensors[f"network.layers.{depth}.weight"] @ values + tensors[f"network.layers.{depth}.bias"]
        values = np.maximum(values, 0.0) if depth < 4 else values
    return np.asarray(values)


@every_network
def test_company_order_and_threads_change_no_digit(network: Callable[[], Model]) -> None:
    count = 2 * BLOCK + 5
    initial, rng = thrown_states(count, seed=6), np.random.default_rng(7)
    lengths, periods = rng.integers(1, 60, count), rng.uniform(0.006, 0.007, count)
    together = network().roll_out(initial, lengths, periods)
    shuffled = rng.permutation(count)
    other = network().roll_out(initial[shuffled], lengths[shuffled], periods[shuffled], threads=3)
    for place, index in enumerate(shuffled):
        np.testing.assert_array_equal(other.trajectory(place), together.trajectory(index))
    for index in range(0, count, 9):
        alone = network().roll_out(initial[index : index + 1], lengths[index], periods[index])
        np.testing.assert_array_equal(alone.states, together.trajectory(index))


@every_network
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_state_ends_its_own_trajectory_only(network: Callable[[], Model], bad: float) -> None:
    initial = thrown_states(7, seed=8)
    clean = network().roll_out(initial, 30, DT)
    initial[2, 8] = bad
    mixed = network().roll_out(initial, 30, DT)
    assert mixed.finite.tolist() == [True, True, False, True, True, True, True]
    assert np.isnan(mixed.trajectory(2)).all()
    assert (mixed.status[60:90] == StepStatus.NOT_FINITE).all()
    assert np.isnan(mixed.residual[60:90]).all()
    for index in (0, 1, 3, 4, 5, 6):
        np.testing.assert_array_equal(mixed.trajectory(index), clean.trajectory(index))


@every_network
def test_a_network_that_is_not_finite_gives_no_motion_beyond_the_first_frame(network: Callable[[], Model]) -> None:
    model = network.__wrapped__()  # type: ignore[attr-defined]
    with torch.no_grad():
        next(model.parameters()).fill_(torch.nan)
    rolled = model.roll_out(thrown_states(3, seed=9), 5, DT)
    assert np.isfinite(rolled.states[[0, 5, 10]]).all()
    assert np.isnan(np.delete(rolled.states, [0, 5, 10], axis=0)).all()
    assert not rolled.finite.any()


def test_a_motion_that_runs_away_keeps_its_finite_rows() -> None:
    model = end_to_end.__wrapped__()
    with torch.no_grad():
        for value in model.parameters():
            value.mul_(1e12)
    rolled = model.roll_out(thrown_states(2, seed=10), 40, DT)
    for index in range(2):
        failed = np.isnan(rolled.trajectory(index)).any(axis=1)
        first = int(np.argmax(failed))
        assert first >= 2
        assert failed[first:].all()
        status = rolled.status[rolled.starts[index] : rolled.starts[index + 1]]
        np.testing.assert_array_equal(status == StepStatus.NOT_FINITE, failed)


def test_the_first_row_is_the_initial_state_and_lengths_may_differ() -> None:
    initial = thrown_states(7, seed=11)
    rolled = deep().roll_out(initial, [5, 1, 9, 2, 4, 3, 6], np.linspace(0.004, 0.01, 7))
    assert rolled.starts.tolist() == [0, 5, 6, 15, 17, 21, 24, 30]
    np.testing.assert_array_equal(rolled.states[rolled.starts[:-1]], initial)
    assert np.isfinite(rolled.states).all()


def test_nothing_to_roll_out_gives_nothing() -> None:
    rolled = deep().roll_out(np.empty((0, 13)), 5, DT)
    assert rolled.states.shape == (0, 13)
    assert rolled.starts.tolist() == [0]


@pytest.mark.parametrize(("lengths", "threads", "message"), WRONG_LENGTHS)
def test_wrong_lengths_and_threads_are_refused(lengths: float | list[int], threads: int, message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        deep().roll_out(thrown_states(3, seed=12), lengths, DT, threads=threads)
    assert str(refused.value) == message


def test_a_model_that_gives_neither_contacts_nor_steps_is_refused() -> None:
    class Silent(Model):
        @classmethod
        def initial(cls, *_: object) -> "Silent":
            raise NotImplementedError

        @classmethod
        def blank(cls, *_: object) -> "Silent":
            raise NotImplementedError

        def batch_loss(self, rows: Rows, config: object) -> BatchLoss:
            raise NotImplementedError

        def outputs(self, rows: Rows, tape: object = None) -> tuple[torch.Tensor, ...]:
            raise NotImplementedError

    with pytest.raises(TypeError, match=r"Silent.*steps"):
        Silent(CONTACTNETS_CUBE)  # type: ignore[abstract]
