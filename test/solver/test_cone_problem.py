"""The inner problem as data: what its numbers mean, and that the certificate can be trusted."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.solver.certificate import FACET_NORMALS, natural_residuals, objectives, project
from contact_curation.solver.cone_problem import Array, Cone, ConeProblems, ConeWeights
from test.solver.known_problems import KNOWN, KnownProblem, random_problems


def objective_in_plain_loops(problems: ConeProblems, impulses: Array) -> Array:
    """method.md 1.2, a line per term, plus eps |l|^2."""
    weights, values = problems.weights, np.zeros(problems.batch)
    for n in range(problems.batch):
        jacobian, measured = problems.jacobians[n], problems.velocities_next[n]
        change = problems.inverse_mass @ sum(jacobian[i].T @ impulses[n, i] for i in range(problems.contacts))
        predicted = problems.free_velocities[n] + change
        values[n] += weights.match * np.sum((predicted - measured) ** 2)
        for i in range(problems.contacts):
            normal, tangent = impulses[n, i, 0], impulses[n, i, 1:]
            slip = jacobian[i, 1:] @ measured
            values[n] += weights.complementarity_normal * (problems.gaps_next[n, i] * normal) ** 2
            values[n] += weights.complementarity_tangent * np.sum((problems.gaps_next[n, i] * tangent) ** 2)
            values[n] += weights.dissipation * np.sum((normal * slip + np.linalg.norm(slip) * tangent) ** 2)
            values[n] += weights.penetration * min(0.0, problems.gaps[n, i] + problems.dt[n] * jacobian[i, 0] @ predicted) ** 2
        values[n] += weights.regularization * np.sum(impulses[n] ** 2)
    return values


def test_the_objective_is_the_loss_of_the_method_and_a_little_regularisation() -> None:
    weights = ConeWeights(0.2, 0.7, 1.3, 0.6, 2.5, 1e-2)
    problems = replace(random_problems(7, 5, seed=1), weights=weights)
    impulses = np.random.default_rng(2).standard_normal((7, 5, 3))
    np.testing.assert_allclose(objectives(problems, impulses).values, objective_in_plain_loops(problems, impulses), rtol=1e-12)


def test_the_gradient_is_that_of_the_objective() -> None:
    problems, rng = random_problems(3, 4, seed=3), np.random.default_rng(4)
    impulses = rng.standard_normal((3, 4, 3))
    gradients = objectives(problems, impulses).gradients
    for place in np.ndindex(4, 3):
        step = np.zeros((4, 3))
        step[place] = 1e-6
        slope = (objectives(problems, impulses + step).values - objectives(problems, impulses - step).values) / 2e-6
        np.testing.assert_allclose(gradients[:, *place], slope, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("cone", list(Cone))
def test_a_projection_is_in_the_cone_and_what_it_takes_away_in_the_polar_cone(cone: Cone) -> None:
    points = np.random.default_rng(5).standard_normal((4000, 3)) * np.array([2.0, 1.0, 1.0])
    feet = project(points, cone)
    taken = points - feet
    assert inside(feet, cone).all()
    np.testing.assert_allclose((feet * taken).sum(axis=1), 0.0, atol=1e-12)
    members = project(np.random.default_rng(6).standard_normal((500, 3)) * 3.0, cone)
    assert (taken @ members.T).max() < 1e-12
    np.testing.assert_allclose(project(feet, cone), feet, atol=1e-12)
    assert 0.05 < np.mean(np.abs(taken).max(axis=1) == 0.0) < 0.95


def inside(points: Array, cone: Cone) -> Array:
    """(N,) whether points are in the cone up to rounding."""
    if cone is Cone.CIRCULAR:
        return np.asarray(np.linalg.norm(points[:, 1:], axis=1) <= points[:, 0] + 1e-12)
    return np.asarray((points @ FACET_NORMALS.T).min(axis=1) >= -1e-12)


def test_the_octagon_stands_around_the_friction_disk_and_touches_it_at_multiples_of_45_degrees() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
    rim = np.stack([np.ones(16), np.cos(angles), np.sin(angles)], axis=1)
    np.testing.assert_allclose(project(rim, Cone.POLYHEDRAL), rim, atol=1e-15)
    room = (rim @ FACET_NORMALS.T).min(axis=1)
    np.testing.assert_allclose(room[::2], 0.0, atol=1e-15)
    np.testing.assert_allclose(room[1::2], 1.0 - np.cos(np.pi / 8), atol=1e-15)


@pytest.mark.parametrize("known", KNOWN, ids=lambda known: known.name)
def test_the_certificate_accepts_the_answer_by_hand_and_refuses_another(known: KnownProblem) -> None:
    for cone in Cone:
        problems = replace(known.problems, cone=cone)
        assert natural_residuals(problems, known.impulses[None])[0] < 1e-5
        assert natural_residuals(problems, known.impulses[None] + np.array([0.3, 0.0, 0.0]))[0] > 1e-3


def test_the_certificate_of_a_number_that_is_missing_is_no_number() -> None:
    problems = random_problems(2, 3, seed=7)
    impulses = np.zeros((2, 3, 3))
    impulses[1, 2, 0] = np.nan
    for cone in Cone:
        residuals = natural_residuals(replace(problems, cone=cone), impulses)
        assert np.isfinite(residuals).tolist() == [True, False]


@pytest.mark.parametrize(
    ("field", "shape", "expected"),
    [
        ("jacobians", (2, 3, 3, 5), "(2, 3, 3, 6)"),
        ("jacobians", (2, 65, 3, 6), "(B, K, 3, 6) with K from 1 to 64"),
        ("jacobians", (2, 0, 3, 6), "(B, K, 3, 6) with K from 1 to 64"),
        ("jacobians", (3, 3, 6), "(B, K, 3, 6) with K from 1 to 64"),
        ("inverse_mass", (6,), "(6, 6)"),
        ("gaps", (2, 4), "(2, 3)"),
        ("gaps_next", (3, 3), "(2, 3)"),
        ("free_velocities", (2, 5), "(2, 6)"),
        ("velocities_next", (1, 6), "(2, 6)"),
        ("dt", (2, 1), "(2,)"),
    ],
)
def test_a_wrong_shape_is_refused_with_its_name(field: str, shape: tuple[int, ...], expected: str) -> None:
    wrong: dict[str, Any] = {field: np.zeros(shape)}
    with pytest.raises(InvalidValueError) as refused:
        replace(random_problems(2, 3, seed=8), **wrong)
    assert str(refused.value) == f"{field}: found shape {shape}, expected {expected}"


def test_as_many_contacts_as_the_kernel_holds_are_accepted_and_lists_become_arrays_of_floats() -> None:
    problems = random_problems(2, 64, seed=9)
    assert (problems.batch, problems.contacts) == (2, 64)
    listed: dict[str, Any] = {"gaps": [[1], [2]], "dt": [1, 1]}
    whole = replace(random_problems(2, 1, seed=8), **listed)
    assert whole.gaps.dtype == whole.dt.dtype == float
    second = problems.rows(slice(1, 2))
    for name in ("jacobians", "gaps", "gaps_next", "free_velocities", "velocities_next", "dt"):
        np.testing.assert_array_equal(getattr(second, name), getattr(problems, name)[1:2])
    np.testing.assert_array_equal(second.inverse_mass, problems.inverse_mass)


@pytest.mark.parametrize("name", ["match", "penetration", "regularization"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
def test_a_weight_that_has_to_be_positive_is_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError) as refused:
        ConeWeights(**{name: value})
    assert str(refused.value) == f"loss.{name}: found {value}, expected a positive number"


@pytest.mark.parametrize("name", ["complementarity_normal", "complementarity_tangent", "dissipation"])
@pytest.mark.parametrize("value", [-1.0, np.inf, np.nan])
def test_a_weight_below_zero_is_refused_and_zero_is_not(name: str, value: float) -> None:
    assert getattr(ConeWeights(**{name: 0.0}), name) == 0.0
    with pytest.raises(InvalidValueError) as refused:
        ConeWeights(**{name: value})
    assert str(refused.value) == f"loss.{name}: found {value}, expected a number of at least 0"


@pytest.mark.parametrize("cone", list(Cone))
def test_a_projection_is_the_nearest_point_of_the_cone(cone: Cone) -> None:
    """By hand: on the axis, at the apex, on the rim, and the foot of a point beside it."""
    points = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [1.0, 3.0, 0.0], [1.0, 0.0, -3.0]])
    feet = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [2.0, 2.0, 0.0], [2.0, 2.0, 0.0], [2.0, 0.0, -2.0]])
    np.testing.assert_allclose(project(points, cone), feet, atol=1e-15)


def test_the_two_cones_differ_between_the_facets_middles() -> None:
    turn = np.pi / 8.0
    point = np.array([[0.0, np.cos(turn), np.sin(turn)]])
    np.testing.assert_allclose(project(point, Cone.CIRCULAR)[0], [0.5, 0.5 * np.cos(turn), 0.5 * np.sin(turn)], atol=1e-15)
    edge = np.array([np.cos(turn), np.cos(turn), np.sin(turn)])
    np.testing.assert_allclose(project(point, Cone.POLYHEDRAL)[0], edge / (1.0 + np.cos(turn) ** 2), atol=1e-15)


def test_the_residual_is_the_largest_step_of_a_projected_gradient() -> None:
    problems = random_problems(3, 4, seed=10)
    impulses = np.abs(np.random.default_rng(11).standard_normal((3, 4, 3)))
    for cone in Cone:
        gradients = objectives(problems, impulses).gradients
        steps = np.abs(impulses - project(impulses - gradients, cone))
        found = natural_residuals(replace(problems, cone=cone), impulses)
        np.testing.assert_array_equal(found, steps.reshape(3, -1).max(axis=1))
