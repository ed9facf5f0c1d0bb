"""The kernel's loss and score: a hand case per term, the envelope theorem, the layout, one bad transition among good ones."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import LOSS_TERMS, Cone, Evaluation, SolveStatus, evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import transitions_of
from test.contact.cases import (
    CUBE,
    DT,
    TRUE,
    Rows,
    full_vector,
    geometry_of,
    noisy_geometry,
    profile_losses,
    rows_of_kind,
    tracked_transitions,
)
from test.simulated import simulated_tosses

POINT = ContactGeometry(np.zeros((1, 3)), np.array([0.0, 0.0, 1.0]), np.zeros((1, 3)), 0.18 * np.eye(2, 3))
"""One contact in the centre of mass."""

DROP = CONTACTNETS_CUBE.scaled_gravity * DT


def state(height: float = 0.0, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    return np.array([[0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0, *velocity, 0.0, 0.0, 0.0]])


def loss_of(before: Array, after: Array, **weights: float) -> tuple[dict[str, float], Array]:
    """Terms by name and the impulse of a single transition of the point."""
    found = evaluate(POINT, CUBE, before, after, DT, LossConfig(**weights))  # type: ignore[arg-type]
    assert found.solved.all()
    return dict(zip(LOSS_TERMS, found.terms[0].tolist())), found.impulses[0, 0]


def test_free_fall_costs_nothing() -> None:
    terms, impulse = loss_of(state(3.0, (1.0, 0.0, -5.0)), state(2.9, (1.0, 0.0, -5.0 - DROP)))
    assert max(terms.values()) < 1e-12
    assert np.abs(impulse).max() < 1e-7


def test_a_downward_kick_is_all_mismatch() -> None:
    terms, impulse = loss_of(state(3.0), state(3.0, (0.0, 0.0, -DROP - 2.0)))
    assert terms["match"] == pytest.approx(0.1 * 2.0**2)
    assert sum(terms.values()) == pytest.approx(terms["match"])
    assert np.abs(impulse).max() < 1e-7


def test_a_push_from_afar_pays_for_its_gap() -> None:
    gap, kick, mass = 0.5, 2.0, CUBE.mass
    terms, impulse = loss_of(state(gap), state(gap, (0.0, 0.0, kick - DROP)))
    expected = 0.1 * kick / mass / (0.1 / mass**2 + gap**2 + 1e-6)
    assert impulse[0] == pytest.approx(expected, rel=1e-6)
    assert terms["match"] == pytest.approx(0.1 * (expected / mass - kick) ** 2)
    assert terms["complementarity_n"] == pytest.approx((gap * expected) ** 2)
    assert terms["complementarity_t"] < 1e-12


def test_friction_from_afar_pays_for_its_gap_too() -> None:
    """The point stops dead sideways: with s = 0 friction costs nothing but its gap."""
    gap, kick, speed, mass, friction = 0.5, 5.0, 0.3, CUBE.mass, 0.18
    terms, impulse = loss_of(state(gap, (-speed, 0.0, DROP - kick)), state(gap))
    expected = 0.1 * friction / mass * speed / (0.1 * friction**2 / mass**2 + gap**2 + 1e-6)
    assert impulse[1] == pytest.approx(expected, rel=1e-6)
    assert terms["complementarity_t"] == pytest.approx((gap * expected) ** 2)


def test_a_slide_without_friction_breaks_maximal_dissipation() -> None:
    """An upward kick while sliding at speed v: e = l_n s + |s| l_t is zero only with full friction, which would brake."""
    speed, kick = 4.0, 1.0
    terms, impulse = loss_of(state(0.0, (speed, 0.0, DROP - kick)), state(0.0, (speed, 0.0, 0.0)))
    slip = 0.18 * speed
    assert terms["cone"] == pytest.approx((impulse[0] * slip + slip * impulse[1]) ** 2, rel=1e-6)
    assert terms["cone"] > 1e-4
    assert impulse[0] > 0.1 > 0.0 > impulse[1] > -impulse[0]


def test_a_point_predicted_below_the_plane_penetrates() -> None:
    """It keeps falling through the plane, so that no impulse is wanted: what is left is the predicted gap."""
    terms, impulse = loss_of(state(-0.2, (0.0, 0.0, -6.0)), state(-0.25, (0.0, 0.0, -6.0 - DROP)), penetration=1e-3)
    predicted = -0.2 + DT * (-6.0 - DROP + impulse[0] / CUBE.mass)
    assert terms["penetration"] == pytest.approx(1e-3 * predicted**2)
    assert predicted < -0.2


def test_weights_multiply_their_terms() -> None:
    rows = rows_of_kind("impact")
    config = LossConfig(match=0.3, complementarity_normal=0.5, complementarity_tangent=2.0, dissipation=0.7, penetration=1.5)
    found = evaluate(TRUE, CUBE, rows.before, rows.after, DT, config)
    assert found.solved.all()
    miss = velocity_change(found) - (rows.after[:, 7:] - rows.before[:, 7:] + np.array([0, 0, DROP, 0, 0, 0]))
    np.testing.assert_allclose(found.terms[:, 0], 0.3 * np.square(miss).sum(axis=1), rtol=1e-9)
    gaps = TRUE.gaps(rows.after)
    np.testing.assert_allclose(found.terms[:, 1], 0.5 * np.square(gaps * found.impulses[..., 0]).sum(axis=1), rtol=1e-9)
    tangent = np.square(gaps[..., None] * found.impulses[..., 1:]).sum(axis=(1, 2))
    np.testing.assert_allclose(found.terms[:, 2], 2.0 * tangent, rtol=1e-9)


def velocity_change(found: Evaluation) -> Array:
    """M^-1 J^T l of the rows of kind impact at the true cube, contact by contact."""
    rows = rows_of_kind("impact")
    change = np.zeros((len(rows), 6))
    for n in range(len(rows)):
        rotation = rotation_of(rows.before[n, 3:7])
        for corner, (normal, first, second) in zip(TRUE.vertices_normal, found.impulses[n]):
            push = np.array([0.18 * first, 0.18 * second, normal])
            change[n, :3] += push / CUBE.mass
            change[n, 3:] += np.linalg.solve(CUBE.scaled_inertia, np.cross(corner, rotation.T @ push))
    return change


def rotation_of(q: Array) -> Array:
    """By Rodrigues' formula."""
    sine = np.linalg.norm(q[1:])
    axis, angle = q[1:] / sine, 2.0 * np.arctan2(sine, q[0])
    skew = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew)


@pytest.mark.parametrize("cone", list(Cone))
@pytest.mark.parametrize("geometry", [TRUE, noisy_geometry(3, share=0.05, pivot=True)], ids=["true", "noisy"])
def test_scores_are_half_the_downward_slope_of_the_solved_loss(geometry: ContactGeometry, cone: Cone) -> None:
    """method.md 6.1: at fixed impulses, against central differences of the loss whose impulses are found anew."""
    impacts, others = rows_of_kind("impact", 20), rows_of_kind("sliding", 4)
    rows = Rows(np.concatenate([impacts.before, others.before]), np.concatenate([impacts.after, others.after]))
    config = LossConfig(cone=cone, tolerance=1e-6)
    scores = evaluate(geometry, CUBE, rows.before, rows.after, DT, config).scores
    theta, slopes, step = full_vector(geometry), np.empty_like(scores), 1e-5
    for k in range(theta.size):
        ahead, behind = (geometry_of(theta + side * step * (np.arange(theta.size) == k), geometry.pivot) for side in (1, -1))
        slopes[:, k] = (profile_losses(ahead, rows, config) - profile_losses(behind, rows, config)) / (2.0 * step)
    off = np.abs(-2.0 * scores - slopes) / np.linalg.norm(slopes, axis=1, keepdims=True)
    assert np.median(off) < 1e-6
    assert off.max() < 1e-4


def test_the_columns_of_a_score_have_the_names_of_the_outside_contract() -> None:
    names = parameter_form(TRUE, Form.CONTACTNETS).names()
    assert len(names) == 57
    assert names[:4] == ("vertices_normal[0][0]", "vertices_normal[0][1]", "vertices_normal[0][2]", "vertices_normal[1][0]")
    assert names[24:28] == ("normal[0]", "normal[1]", "normal[2]", "vertices_tangent[0][0]")
    assert names[51:] == tuple(f"tangents[{a}][{b}]" for a in range(2) for b in range(3))


@pytest.mark.parametrize("batch", [1, 7, 8, 9])
def test_a_transition_is_scored_alike_alone_and_in_a_batch(batch: int) -> None:
    rows = tracked_transitions()
    together = evaluate(TRUE, CUBE, rows.before[:batch], rows.after[:batch], DT)
    assert together.scores.shape == (batch, 58)
    for n in range(batch):
        alone = evaluate(TRUE, CUBE, rows.before[n : n + 1], rows.after[n : n + 1], DT)
        for name in ("terms", "impulses", "scores", "residuals", "status"):
            np.testing.assert_array_equal(getattr(alone, name)[0], getattr(together, name)[n])


@pytest.mark.parametrize("column", [0, 4, 8, 11])
@pytest.mark.parametrize("which", ["before", "after"])
def test_a_number_that_is_missing_is_a_status_and_touches_no_neighbour(which: str, column: int) -> None:
    rows = rows_of_kind("impact", 9)
    good = evaluate(TRUE, CUBE, rows.before, rows.after, DT)
    states = {"before": rows.before.copy(), "after": rows.after.copy()}
    states[which][4, column] = np.nan
    found = evaluate(TRUE, CUBE, states["before"], states["after"], DT)
    others = np.arange(9) != 4
    assert found.status[4] == SolveStatus.NOT_FINITE
    assert found.solved[others].all()
    np.testing.assert_array_equal(found.scores[others], good.scores[others])


def test_threads_change_nothing_bit_for_bit() -> None:
    rows = tracked_transitions()
    alone, many = (evaluate(TRUE, CUBE, rows.before, rows.after, DT, LossConfig(threads=n)) for n in (1, 4))
    for name in ("terms", "impulses", "scores", "status"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(many, name))


@pytest.mark.parametrize("mass", [0.01, 0.001, 0.00001])
def test_of_a_light_body_too_impulses_count_as_solved_by_the_residual_that_is_given(mass: float) -> None:
    light = replace(CUBE, mass=mass, inertia=CUBE.inertia * mass / CUBE.mass)
    data = transitions_of(simulated_tosses(2, 1), CUBE.length_scale)
    loss = LossConfig(threads=1, balanced=False)
    found = evaluate(ContactGeometry.of_body(light).rigid(), light, data.before, data.after, data.dt, loss)
    assert found.solved.mean() > 0.98
    np.testing.assert_array_equal(found.solved, found.residuals <= loss.tolerance)


def test_what_cannot_be_a_transition_is_refused() -> None:
    good = state()
    with pytest.raises(InvalidValueError, match=r"^states after: found shape \(1, 13\), expected \(2, 13\), as before$"):
        evaluate(POINT, CUBE, np.repeat(good, 2, axis=0), good, DT)
    with pytest.raises(InvalidValueError, match="quaternion"):
        evaluate(POINT, CUBE, good + np.array([0.0] * 3 + [0.1] + [0.0] * 9), good, DT)
    with pytest.raises(InvalidValueError, match=r"^vertices: found 65, expected at most 64$"):
        evaluate(ContactGeometry(np.zeros((65, 3)), POINT.normal, np.zeros((65, 3)), POINT.tangents), CUBE, good, good, DT)


@pytest.mark.parametrize("field", ["match", "penetration", "regularization", "tolerance"])
def test_a_weight_must_be_positive(field: str) -> None:
    with pytest.raises(InvalidValueError, match=rf"^loss.{field}: found 0.0, expected a positive number$"):
        replace(LossConfig(), **{field: 0.0})  # type: ignore[arg-type]


def test_iterations_and_threads_are_checked_by_name() -> None:
    with pytest.raises(InvalidValueError, match=r"^loss\.max_iterations: found 0, expected a whole number of at least 1$"):
        LossConfig(max_iterations=0)
    with pytest.raises(InvalidValueError, match=r"^loss\.threads: found -1, expected a whole number of at least 0$"):
        LossConfig(threads=-1)
