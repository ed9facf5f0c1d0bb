"""Rollouts: layout and statuses, rest and energy; the floor on real tosses is in test/real/test_rollout_floor.py."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.contact.time_step import StepStatus, SweepLimits, step
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from test.contact.time_step_oracle import energies

CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)
DT = 1.0 / 148.0
FLAT_AT_REST = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def thrown_states(count: int, seed: int) -> Array:
    """Releases like the real ones, roughly: tumbling forward, a hand's breadth over the plane."""
    rng = np.random.default_rng(seed)
    states = np.empty((count, 13))
    states[:, :3] = np.array([0.0, 0.0, 2.7]) + 0.2 * rng.standard_normal((count, 3))
    states[:, 3:7] = quaternions.normalized(rng.standard_normal((count, 4)))
    states[:, 7:] = np.array([20.0, 0.0, -1.0, 0.0, 3.0, 0.0]) + rng.standard_normal((count, 6))
    return states


def test_a_trajectory_is_its_initial_state_and_then_step_after_step() -> None:
    initial = thrown_states(1, seed=1)
    rolled = rollout(CUBE, CONTACTNETS_CUBE, initial, 60, DT, keep_impulses=True)
    assert rolled.impulses is not None
    np.testing.assert_array_equal(rolled.states[0], initial[0])
    assert not rolled.impulses[0].any()
    for frame in range(1, 60):
        before, guess = rolled.states[frame - 1 : frame], rolled.impulses[frame - 1 : frame]
        np.testing.assert_array_equal(step(CUBE, CONTACTNETS_CUBE, before, DT, guess).states[0], rolled.states[frame])


def test_every_trajectory_has_its_own_length_and_time_step() -> None:
    initial, lengths, periods = thrown_states(7, seed=2), [5, 1, 90, 2, 40, 3, 60], np.linspace(0.004, 0.01, 7)
    batch = rollout(CUBE, CONTACTNETS_CUBE, initial, lengths, periods)
    assert batch.starts.tolist() == [0, 5, 6, 96, 98, 138, 141, 201]
    for index in range(7):
        alone = rollout(CUBE, CONTACTNETS_CUBE, initial[index : index + 1], lengths[index], periods[index])
        np.testing.assert_array_equal(batch.trajectory(index), alone.states)


def test_threads_change_nothing_bit_for_bit() -> None:
    initial = thrown_states(23, seed=3)
    alone = rollout(CUBE, CONTACTNETS_CUBE, initial, 120, DT, keep_impulses=True)
    many = rollout(CUBE, CONTACTNETS_CUBE, initial, 120, DT, threads=8, keep_impulses=True)
    for name in ("states", "status", "residual", "impulses"):
        np.testing.assert_array_equal(getattr(many, name), getattr(alone, name))


def test_a_bad_state_ends_its_own_trajectory_only() -> None:
    initial = thrown_states(7, seed=4)
    clean = rollout(CUBE, CONTACTNETS_CUBE, initial, 30, DT, keep_impulses=True)
    initial[2, 8] = np.nan
    mixed = rollout(CUBE, CONTACTNETS_CUBE, initial, 30, DT, keep_impulses=True)
    assert mixed.finite.tolist() == [True, True, False, True, True, True, True]
    assert np.isnan(mixed.trajectory(2)).all()
    assert (mixed.status[60:90] == StepStatus.NOT_FINITE).all()
    for index in (0, 1, 3, 4, 5, 6):
        np.testing.assert_array_equal(mixed.trajectory(index), clean.trajectory(index))


def test_a_motion_that_overflows_on_the_way_keeps_its_finite_rows() -> None:
    initial = FLAT_AT_REST + np.array([0, 0, 0, 0, 0, 0, 0, 1e308, 0, 0, 0, 0, 0])
    free = replace(CUBE, height=-np.finfo(float).max)
    rolled = rollout(free, CONTACTNETS_CUBE, initial[None], 10, 1.0)
    last = int(np.argmax(rolled.status == StepStatus.NOT_FINITE))
    assert last == 2
    assert np.isfinite(rolled.states[:last]).all()
    assert np.isnan(rolled.states[last:]).all()
    assert (rolled.status[last:] == StepStatus.NOT_FINITE).all()


def test_steps_that_run_out_of_sweeps_say_so() -> None:
    rolled = rollout(CUBE, CONTACTNETS_CUBE, thrown_states(5, seed=5), 100, DT, SweepLimits(tolerance=1e-9, max_sweeps=2))
    exhausted = rolled.status == StepStatus.SWEEPS_EXHAUSTED
    assert exhausted.any()
    assert (rolled.residual[exhausted] > 1e-9).all()
    assert (rolled.residual[~exhausted] <= 1e-9).all()


def test_a_cube_at_rest_stays_where_it_is() -> None:
    rolled = rollout(CUBE, CONTACTNETS_CUBE, FLAT_AT_REST[None], 5000, DT)
    np.testing.assert_allclose(rolled.states - FLAT_AT_REST, 0.0, atol=1e-6)
    assert (rolled.status == StepStatus.CONVERGED).all()


def test_thrown_cubes_come_to_rest_on_a_face_and_stay() -> None:
    rolled = rollout(CUBE, CONTACTNETS_CUBE, thrown_states(40, seed=6), 400, DT)
    for index in range(40):
        states = rolled.trajectory(index)
        third_row = quaternions.to_matrix(states[-1, 3:7])[2]
        assert np.abs(third_row).max() == pytest.approx(1.0, abs=1e-6)
        assert states[-1, 2] == pytest.approx(1.0, abs=1e-4)
        np.testing.assert_allclose(states[-50:, :3], np.broadcast_to(states[-1, :3], (50, 3)), atol=1e-6)


def test_a_free_flight_loses_only_what_the_semi_implicit_step_takes() -> None:
    free = replace(CUBE, height=-1e6)
    rolled = rollout(free, CONTACTNETS_CUBE, thrown_states(3, seed=7), 500, DT)
    fall = 0.5 * CONTACTNETS_CUBE.mass * (CONTACTNETS_CUBE.scaled_gravity * DT) ** 2
    for index in range(3):
        energy = energies(CONTACTNETS_CUBE, rolled.trajectory(index))
        np.testing.assert_allclose(np.diff(energy), -fall, atol=1e-9)


def test_energy_never_grows_in_a_toss() -> None:
    rolled = rollout(CUBE, CONTACTNETS_CUBE, thrown_states(40, seed=8), 200, DT)
    for index in range(40):
        energy = energies(CONTACTNETS_CUBE, rolled.trajectory(index))
        assert np.diff(energy).max() < 1e-8 * energy[0]


WRONG_LENGTHS = [
    (0, 1, "lengths: found 0, expected at least 1 frame"),
    (2.5, 1, "lengths: found float64 of shape (), expected one integer or (3,) integers"),
    ([3, 3], 1, "lengths: found int64 of shape (2,), expected one integer or (3,) integers"),
    ([3, -1, 3], 1, "lengths: found -1, expected at least 1 frame"),
    (3, 0, "threads: found 0, expected at least 1"),
]


@pytest.mark.parametrize(("lengths", "threads", "message"), WRONG_LENGTHS)
def test_wrong_lengths_and_threads_are_refused(lengths: float | list[int], threads: int, message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        rollout(CUBE, CONTACTNETS_CUBE, thrown_states(3, seed=9), lengths, DT, threads=threads)
    assert str(refused.value) == message
