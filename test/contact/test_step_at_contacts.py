"""The time step at given contacts: the polytope's own give the polytope's step, any others what plain loops give."""

from collections.abc import Callable

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.time_step import StepStatus, SweepLimits, step, step_at_contacts
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from test.contact.test_time_step import EXACT, FLAT_AT_REST, lopsided_body, random_geometry, touching_states
from test.contact.time_step_oracle import contact_rows, oracle_step_at

CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)
DT = 1.0 / 148.0


def contacts_of(geometry: ContactGeometry, states: Array) -> tuple[Array, Array]:
    """Gaps (N, V) and Jacobians (N, V, 3, 6), state by state."""
    found = [contact_rows(geometry, state) for state in states]
    return np.array([gaps for _, gaps in found]), np.array([rows for rows, _ in found])


@pytest.mark.parametrize("vertices", [1, 4, 8, 32])
@pytest.mark.parametrize("count", [1, 7])
def test_the_contacts_of_a_polytope_give_its_own_step(vertices: int, count: int) -> None:
    geometry, body = random_geometry(vertices, vertices), lopsided_body(vertices)
    states = touching_states(geometry, count, seed=vertices)
    guesses = np.abs(np.random.default_rng(vertices).standard_normal((count, vertices, 3)))
    periods = np.linspace(0.5, 1.0, count) * DT
    expected = step(geometry, body, states, periods, guesses)
    found = step_at_contacts(body, states, periods, *contacts_of(geometry, states), guesses)
    np.testing.assert_allclose(found.states, expected.states, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.impulses, expected.impulses, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(found.status, expected.status)
    np.testing.assert_allclose(found.residual, expected.residual, rtol=0.0, atol=1e-12)


def test_contacts_of_no_polytope_give_what_plain_loops_give() -> None:
    body, rng = lopsided_body(seed=2), np.random.default_rng(3)
    states = touching_states(CUBE, 12, seed=4)
    gaps, jacobians = contacts_of(CUBE, states)
    gaps, jacobians = gaps + 0.02 * rng.standard_normal(gaps.shape), jacobians + 0.2 * rng.standard_normal(jacobians.shape)
    found = step_at_contacts(body, states, DT, gaps, jacobians, limits=EXACT)
    assert (found.impulses[..., 0] > 0.0).any(axis=1).sum() >= 5
    for index, state in enumerate(states):
        expected, _ = oracle_step_at(jacobians[index], gaps[index], body, state, DT)
        np.testing.assert_allclose(found.states[index], expected, atol=1e-8)


def test_a_good_guess_saves_sweeps_and_is_left_as_it_was() -> None:
    state, once = FLAT_AT_REST[None], SweepLimits(tolerance=1e-9, max_sweeps=1)
    contacts = contacts_of(CUBE, state)
    solved = step_at_contacts(CONTACTNETS_CUBE, state, DT, *contacts, limits=EXACT)
    guess = solved.impulses.copy()
    assert step_at_contacts(CONTACTNETS_CUBE, state, DT, *contacts, limits=once).status[0] == StepStatus.SWEEPS_EXHAUSTED
    warm = step_at_contacts(CONTACTNETS_CUBE, state, 0.5 * DT, *contacts, guess)
    assert (warm.impulses != guess).any()
    np.testing.assert_array_equal(guess, solved.impulses)
    assert step_at_contacts(CONTACTNETS_CUBE, state, DT, *contacts, guess, once).status[0] == StepStatus.CONVERGED


@pytest.mark.parametrize("given", [np.float32, np.int64, np.asfortranarray])
def test_numbers_may_be_of_any_type_and_order(given: Callable[[Array], Array]) -> None:
    states, dt, once = np.zeros((3, 13)), np.array([1.0, 2.0, 3.0]), SweepLimits(max_sweeps=1)
    states[:, 2], states[:, 3] = [1.0, 2.0, 3.0], 1.0
    rng = np.random.default_rng(7)
    guesses, gaps, jacobians = (rng.integers(-2, 3, (3, 8, *rest)).astype(float) for rest in ((3,), (), (3, 6)))
    known, found = (
        (
            step(CUBE, CONTACTNETS_CUBE, of(states), of(dt), of(guesses), once),
            step_at_contacts(CONTACTNETS_CUBE, of(states), of(dt), of(gaps), of(jacobians), of(guesses), once),
        )
        for of in (np.array, given)
    )
    for one, other in zip(known, found, strict=True):
        np.testing.assert_array_equal(other.states, one.states)
        np.testing.assert_array_equal(other.impulses, one.impulses)


def test_without_contacts_a_body_falls() -> None:
    states = touching_states(CUBE, 3, seed=5)
    found = step_at_contacts(CONTACTNETS_CUBE, states, DT, np.empty((3, 0)), np.empty((3, 0, 3, 6)))
    np.testing.assert_allclose(found.states[:, 9], states[:, 9] - CONTACTNETS_CUBE.scaled_gravity * DT)
    np.testing.assert_array_equal(found.states[:, 10:], states[:, 10:])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["gaps", "jacobians", "states"])
def test_what_is_not_finite_gets_a_status_and_leaves_the_others_alone(bad: float, where: str) -> None:
    states = touching_states(CUBE, 7, seed=6)
    gaps, jacobians = contacts_of(CUBE, states)
    clean = step_at_contacts(CONTACTNETS_CUBE, states, DT, gaps, jacobians)
    {"gaps": gaps, "jacobians": jacobians, "states": states}[where].reshape(7, -1)[3, 2] = bad
    mixed = step_at_contacts(CONTACTNETS_CUBE, states, DT, gaps, jacobians)
    others = np.arange(7) != 3
    np.testing.assert_array_equal(mixed.states[others], clean.states[others])
    assert mixed.status[3] == StepStatus.NOT_FINITE
    assert np.isnan(mixed.states[3]).all()
    assert np.isnan(mixed.residual[3])


@pytest.mark.parametrize(
    ("message", "shapes"),
    [
        ("gaps: found shape (8,), expected (2, K)", [(8,), (2, 8, 3, 6), (2, 8, 3)]),
        ("gaps: found shape (3, 8), expected (2, K)", [(3, 8), (2, 8, 3, 6), (2, 8, 3)]),
        ("jacobians: found shape (2, 7, 3, 6), expected (2, 8, 3, 6)", [(2, 8), (2, 7, 3, 6), (2, 8, 3)]),
        ("jacobians: found shape (2, 8, 18), expected (2, 8, 3, 6)", [(2, 8), (2, 8, 18), (2, 8, 3)]),
        ("guesses: found shape (2, 8), expected (2, 8, 3)", [(2, 8), (2, 8, 3, 6), (2, 8)]),
    ],
)
def test_wrong_shapes_are_refused_by_name(message: str, shapes: list[tuple[int, ...]]) -> None:
    gaps, jacobians, guesses = (np.zeros(shape) for shape in shapes)
    with pytest.raises(InvalidValueError) as refused:
        step_at_contacts(CONTACTNETS_CUBE, np.tile(FLAT_AT_REST, (2, 1)), DT, gaps, jacobians, guesses)
    assert str(refused.value) == message
