"""The compiled time step against hand cases, the complementarity conditions and a plain-loop oracle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.time_step import StepStatus, SweepLimits, step
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from test.contact.time_step_oracle import contact_rows, energies, oracle_step, violation

CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)
GRAVITY = CONTACTNETS_CUBE.scaled_gravity
DT = 1.0 / 148.0
EXACT = SweepLimits(tolerance=1e-13, max_sweeps=20_000)
FLAT_AT_REST = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def lopsided_body(seed: int) -> Body:
    """Full inertia matrix, odd mass."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((3, 3))
    spread = root @ root.T / 3.0 + np.eye(3)  # of the mass, second moments
    inertia = 4e-4 * (np.trace(spread) * np.eye(3) - spread)
    return Body("lopsided", CONTACTNETS_CUBE.vertices, 0.25, inertia, 0.3, 0.0524)


def random_geometry(seed: int, vertices: int) -> ContactGeometry:
    """Learned-like: tilted plane, offsets, friction that differs by direction, tangent points of their own."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((vertices, 3))
    return ContactGeometry(
        vertices_normal=points,
        normal=np.array([0.0, 0.0, 1.0]) + 0.1 * rng.standard_normal(3),
        vertices_tangent=points + 0.1 * rng.standard_normal((vertices, 3)),
        tangents=0.2 * (np.eye(2, 3) + 0.3 * rng.standard_normal((2, 3))),
        pivot=rng.standard_normal(3),
        height=0.1,
    )


def touching_states(geometry: ContactGeometry, count: int, seed: int) -> Array:
    """Random attitudes and speeds, falling, the lowest vertex within 0.05 above or 0.01 below the plane."""
    rng = np.random.default_rng(seed)
    states = 5.0 * rng.standard_normal((count, 13))
    states[:, 9] = -np.abs(states[:, 9])
    states[:, 3:7] = quaternions.normalized(states[:, 3:7])
    lift = rng.uniform(-0.01, 0.05, count) - geometry.gaps(states).min(axis=1)
    states[:, :3] += lift[:, None] * geometry.normal / (geometry.normal @ geometry.normal)
    return states


def test_a_free_body_falls_with_gravity_and_keeps_its_spin() -> None:
    state = np.array([1.0, 2.0, 9.0, 1.0, 0.0, 0.0, 0.0, 3.0, -2.0, 1.0, 0.5, -1.0, 2.0])
    after = step(CUBE, CONTACTNETS_CUBE, state[None], DT)
    twist = state[7:] - np.array([0.0, 0.0, GRAVITY * DT, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(after.states[0, 7:], twist, rtol=1e-15)
    np.testing.assert_allclose(after.states[0, :3], state[:3] + DT * twist[:3], rtol=1e-15)
    np.testing.assert_allclose(after.states[0, 3:7], quaternions.exp(DT * twist[3:]), atol=1e-15)
    assert not after.impulses.any()


def test_a_cube_dropped_flat_reaches_the_plane_and_does_not_bounce() -> None:
    state = FLAT_AT_REST + np.array([0, 0, 0.01, 0, 0, 0, 0, 0, 0, -10.0, 0, 0, 0])
    after = step(CUBE, CONTACTNETS_CUBE, state[None], DT, limits=EXACT).states[0]
    assert after[2] == pytest.approx(1.0, abs=1e-9)
    assert after[9] == pytest.approx(-0.01 / DT, abs=1e-8)


def test_a_sliding_cube_slows_down_by_friction_times_gravity() -> None:
    state = FLAT_AT_REST.copy()
    state[7:9] = [3.0, 4.0]
    after = step(CUBE, CONTACTNETS_CUBE, state[None], DT, limits=EXACT).states[0]
    speed = 5.0 - 0.18 * GRAVITY * DT
    np.testing.assert_allclose(after[7:10], [0.6 * speed, 0.8 * speed, 0.0], atol=1e-9)


@pytest.mark.parametrize(("friction", "slides"), [(0.29, True), (0.31, False)])
def test_a_cube_on_a_slope_of_three_in_ten_slides_just_when_friction_is_less(friction: float, slides: bool) -> None:
    normal = np.array([-0.3, 0.0, 1.0]) / np.hypot(0.3, 1.0)
    downhill = np.array([-1.0, 0.0, -0.3]) / np.hypot(0.3, 1.0)
    tangents = friction * np.array([downhill, np.cross(normal, downhill)])
    state = FLAT_AT_REST.copy()
    state[3:7] = quaternions.exp([0.0, -np.arctan(0.3), 0.0])
    state[:3] = normal
    geometry = ContactGeometry(CUBE.vertices_normal, normal, CUBE.vertices_normal, tangents)
    after = step(geometry, CONTACTNETS_CUBE, state[None], DT, limits=EXACT).states[0]
    expected = GRAVITY * DT * (0.3 - friction) / np.hypot(0.3, 1.0) if slides else 0.0
    assert after[7:10] @ downhill == pytest.approx(expected, abs=1e-9)


def test_the_oracles_jacobian_is_the_derivative_of_the_gap_along_the_motion() -> None:
    geometry = random_geometry(seed=3, vertices=5)
    state = touching_states(geometry, 1, seed=4)[0]
    rows, _ = contact_rows(geometry, state)
    half = 1e-6

    def moved(sign: float) -> Array:
        position = state[:3] + sign * half * state[7:10]
        turned = quaternions.multiply(state[3:7], quaternions.exp(sign * half * state[10:]))
        return np.concatenate([position, turned, state[7:]])

    slope = (geometry.gaps(moved(1.0)) - geometry.gaps(moved(-1.0))) / (2.0 * half)
    np.testing.assert_allclose(rows[:, 0] @ state[7:], slope, atol=1e-7)


@pytest.mark.parametrize("vertices", [1, 4, 8, 32])
def test_a_step_satisfies_complementarity_and_coulombs_law(vertices: int) -> None:
    geometry, body = random_geometry(vertices, vertices), lopsided_body(vertices)
    states = touching_states(geometry, 40, seed=vertices)
    result = step(geometry, body, states, DT, limits=EXACT)
    violations = [
        violation(geometry, body, before, DT, after, impulses)
        for before, after, impulses in zip(states, result.states, result.impulses, strict=True)
    ]
    assert max(violations) < 1e-9
    assert (result.impulses[..., 0] > 0.0).any(axis=1).mean() > 0.3
    assert np.all(np.linalg.norm(result.impulses[..., 1:], axis=-1) <= result.impulses[..., 0] * (1 + 1e-9))


def test_a_step_agrees_with_the_plain_loop_oracle_on_random_contacts() -> None:
    geometry, body = random_geometry(seed=11, vertices=6), lopsided_body(seed=12)
    states = touching_states(geometry, 12, seed=13)
    result = step(geometry, body, states, DT, limits=EXACT)
    for before, after in zip(states, result.states, strict=True):
        np.testing.assert_allclose(after, oracle_step(geometry, body, before, DT)[0], atol=1e-8)


def test_a_step_agrees_with_the_plain_loop_oracle_on_real_contacts(contactnets_folder: Path) -> None:
    states = real_states(contactnets_folder, range(0, 100, 5))
    touching = states[CUBE.gaps(states).min(axis=1) < 0.05][::25]
    result = step(CUBE, CONTACTNETS_CUBE, touching, DT, limits=EXACT)
    oracle = np.array([oracle_step(CUBE, CONTACTNETS_CUBE, state, DT, sweeps=1500)[0] for state in touching])
    differences = np.linalg.norm(result.states[:, 7:] - oracle[:, 7:], axis=1)
    assert len(touching) >= 50
    assert np.median(differences) < 1e-9
    assert differences.max() < 1e-3


def test_the_default_tolerance_settles_velocities_of_real_contacts(contactnets_folder: Path) -> None:
    states = real_states(contactnets_folder, range(0, 570, 10))
    touching = states[CUBE.gaps(states).min(axis=1) < 0.1]
    quick = step(CUBE, CONTACTNETS_CUBE, touching, DT)
    exact = step(CUBE, CONTACTNETS_CUBE, touching, DT, limits=EXACT)
    differences = np.linalg.norm(quick.states[:, 7:] - exact.states[:, 7:], axis=1)
    assert np.median(differences) < 1.4e-5
    assert differences.max() < 0.03
    assert np.mean(quick.status == StepStatus.CONVERGED) > 0.97


def test_energy_never_grows_where_nothing_penetrates() -> None:
    body = lopsided_body(seed=21)
    geometry = ContactGeometry.of_body(body)
    states = touching_states(geometry, 300, seed=22)
    states[:, 2] += np.maximum(0.0, -geometry.gaps(states).min(axis=1))
    after = step(geometry, body, states, DT, limits=EXACT).states
    gain = energies(body, after) - energies(body, states)
    assert gain.max() < 1e-9


@pytest.mark.parametrize("restitution", [None, 0.4])
@pytest.mark.parametrize("max_sweeps", [3, 400])
def test_steps_have_the_same_bits_together_and_one_by_one(restitution: float | None, max_sweeps: int) -> None:
    geometry = replace(random_geometry(1, vertices=8), restitution=restitution)
    states = touching_states(geometry, 29, seed=2)  # three times eight together, and five
    states[4, 2], states[17, 8] = np.nan, np.inf
    limits, guesses = SweepLimits(max_sweeps=max_sweeps), np.random.default_rng(3).exponential(size=(29, 8, 3))
    together = step(geometry, CONTACTNETS_CUBE, states, DT, guesses, limits)
    alone = [step(geometry, CONTACTNETS_CUBE, states[n, None], DT, guesses[n, None], limits) for n in range(29)]
    assert len(set(together.status.tolist())) == (3 if max_sweeps == 3 else 2)
    for name in ("states", "impulses", "status", "residual"):
        assert getattr(together, name).tobytes() == np.concatenate([getattr(one, name) for one in alone]).tobytes()


def test_where_a_step_starts_its_search_does_not_change_the_velocities() -> None:
    geometry = random_geometry(seed=31, vertices=4)
    states = touching_states(geometry, 20, seed=32)
    guesses = np.abs(np.random.default_rng(33).standard_normal((20, 4, 3)))
    cold = step(geometry, CONTACTNETS_CUBE, states, DT, limits=EXACT)
    warm = step(geometry, CONTACTNETS_CUBE, states, DT, guesses, limits=EXACT)
    np.testing.assert_allclose(warm.states, cold.states, atol=1e-9)


def test_a_good_guess_saves_sweeps() -> None:
    state = FLAT_AT_REST[None]
    solved = step(CUBE, CONTACTNETS_CUBE, state, DT, limits=EXACT)
    one_sweep = SweepLimits(tolerance=1e-9, max_sweeps=1)
    assert step(CUBE, CONTACTNETS_CUBE, state, DT, limits=one_sweep).status[0] == StepStatus.SWEEPS_EXHAUSTED
    assert step(CUBE, CONTACTNETS_CUBE, state, DT, solved.impulses, one_sweep).status[0] == StepStatus.CONVERGED


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e308])
@pytest.mark.parametrize("column", [0, 2, 8, 12])
def test_a_bad_state_gets_a_status_and_leaves_the_others_alone(bad: float, column: int) -> None:
    states = touching_states(CUBE, 7, seed=41)
    clean = step(CUBE, CONTACTNETS_CUBE, states, DT)
    states[3, column] = bad
    mixed = step(CUBE, CONTACTNETS_CUBE, states, DT)
    others = np.arange(7) != 3
    np.testing.assert_array_equal(mixed.states[others], clean.states[others])
    assert np.isfinite(mixed.states[3]).all() or mixed.status[3] == StepStatus.NOT_FINITE
    if not np.isfinite(bad):
        assert mixed.status[3] == StepStatus.NOT_FINITE
        assert np.isnan(mixed.states[3]).all()


@pytest.mark.parametrize(
    ("states", "dt", "message"),
    [
        (np.zeros((2, 12)), DT, "states: found shape (2, 12), expected (N, 13)"),
        (np.zeros(13), DT, "states: found shape (13,), expected (N, 13)"),
        (np.zeros((2, 13)), DT, "quaternion norms: found 0 to 0, expected 1 within 0.001"),
        (FLAT_AT_REST * [[1.0], [1.002]], DT, "quaternion norms: found 1 to 1.002, expected 1 within 0.001"),
        (FLAT_AT_REST[None], -0.5, "dt: found -0.5, expected positive numbers of seconds"),
        (FLAT_AT_REST[None], 0.0, "dt: found 0., expected positive numbers of seconds"),
        (FLAT_AT_REST[None], np.inf, "dt: found inf, expected positive numbers of seconds"),
        (FLAT_AT_REST[None], np.nan, "dt: found nan, expected positive numbers of seconds"),
        (FLAT_AT_REST[None], [DT, DT], "dt: found shape (2,), expected one number or (1,)"),
    ],
)
def test_wrong_input_is_refused(states: Array, dt: float | list[float], message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        step(CUBE, CONTACTNETS_CUBE, states, dt)
    assert str(refused.value) == message


def test_a_quaternion_may_be_off_by_rounding_and_states_are_copied() -> None:
    nearly = np.tile(FLAT_AT_REST, (2, 1))
    nearly[:, 3:7] *= [[0.9991], [1.0009]]
    before = nearly.copy()
    step(CUBE, CONTACTNETS_CUBE, nearly, DT)
    np.testing.assert_array_equal(nearly, before)


def test_limits_and_geometry_are_checked_when_made() -> None:
    with pytest.raises(InvalidValueError, match=r"^tolerance: found 0.0, expected a positive number$"):
        SweepLimits(tolerance=0.0)
    with pytest.raises(InvalidValueError, match=r"^max_sweeps: found 0, expected a whole number of at least 1$"):
        SweepLimits(max_sweeps=0)
    with pytest.raises(InvalidValueError, match="normal"):
        ContactGeometry(CUBE.vertices_normal, np.zeros(3), CUBE.vertices_tangent, CUBE.tangents)
    with pytest.raises(InvalidValueError, match="vertices_tangent"):
        ContactGeometry(CUBE.vertices_normal, CUBE.normal, CUBE.vertices_tangent[:7], CUBE.tangents)
    with pytest.raises(InvalidValueError, match=r"^guesses: found shape \(1, 7, 3\), expected \(1, 8, 3\)$"):
        step(CUBE, CONTACTNETS_CUBE, FLAT_AT_REST[None], DT, np.zeros((1, 7, 3)))


def real_states(folder: Path, ids: range) -> Array:
    """States of real tosses, already in characteristic lengths."""
    return np.concatenate([torch.load(folder / f"{i}.pt", weights_only=True)[0, :, :13].numpy() for i in ids])
