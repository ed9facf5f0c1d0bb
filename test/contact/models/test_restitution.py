"""Bodies that bounce: loss, score, information and motion with a restitution."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Cone, Estimator, evaluate, fisher_sums
from contact_curation.contact.geometry_parameters import INITIAL_RESTITUTION, ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.contact.rollout import rollout
from contact_curation.contact.time_step import step
from contact_curation.contact.torch_contacts import Frames, Theta
from contact_curation.contact.torch_loss import polytope_losses
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry, geometry_of_bytes
from contact_curation.learning.fits.polytope_sums import moved
from test.contact.torch_fisher import profile_fishers

E, DT = 0.3, 1.0 / 148.0
POINT = ContactGeometry(np.zeros((1, 3)), np.array([0.0, 0.0, 1.0]), np.zeros((1, 3)), 0.18 * np.eye(2, 3))
BOUNCING = replace(ContactGeometry.of_body(CONTACTNETS_CUBE), restitution=E, noise=ImpulseNoise(0.0), height=0.02)


def state(height: float, speed: float) -> Array:
    return np.array([[0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0]])


def impacts(count: int = 16) -> tuple[Array, Array]:
    """Transitions (N, 13) in which fast cubes meet the ground."""
    rng = np.random.default_rng(0)
    before = np.zeros((count, 13))
    before[:, 2] = 1.4 + 0.3 * rng.random(count)
    turns = rng.standard_normal((count, 4))
    before[:, 3:7] = turns / np.linalg.norm(turns, axis=1)[:, None]
    before[:, 7:] = rng.normal(0.0, 5.0, (count, 6))
    before[:, 9] = -25.0 - 20.0 * rng.random(count)
    after = rollout(BOUNCING, CONTACTNETS_CUBE, before, 2, DT).states[1::2]
    after[:, 7:] += rng.normal(0.0, 1.0, (count, 6))
    return before, after


def test_a_contact_where_the_ground_mirrors_its_depth_costs_nothing() -> None:
    fall = -30.0 - CONTACTNETS_CUBE.scaled_gravity * DT
    depth = -(0.1 + DT * fall)
    before, after = state(0.1, -30.0), state(E * depth, (E * depth - 0.1) / DT)
    bounced = evaluate(replace(POINT, restitution=E), CONTACTNETS_CUBE, before, after, DT)
    assert bounced.solved.all()
    assert bounced.losses[0] < 1e-3 * evaluate(POINT, CONTACTNETS_CUBE, before, after, DT).losses[0]


def test_a_contact_below_the_board_does_not_bounce_from_the_depth_that_it_has() -> None:
    """A shape that is a little too large, or a tracker's noise, puts a body at rest under the board."""
    fall = CONTACTNETS_CUBE.scaled_gravity * DT
    still = state(-0.05, 0.0)
    plain, bouncing = (evaluate(replace(POINT, restitution=e), CONTACTNETS_CUBE, still, still, DT).losses for e in (None, E))
    assert bouncing == pytest.approx(plain, rel=0.2)
    rising = state(-0.05, 2.0 * fall)
    plain, bouncing = (evaluate(replace(POINT, restitution=e), CONTACTNETS_CUBE, rising, still, DT).losses for e in (None, E))
    assert np.array_equal(plain, bouncing)


@pytest.mark.parametrize("lower", [0.0, 0.6])
def test_scores_are_slopes_of_the_loss(lower: float) -> None:
    """Of contacts that come from above the board, and of some that are under it before."""
    before, after = impacts()
    before[:, 2] -= lower
    assert np.count_nonzero(BOUNCING.gaps(before) < 0.0) >= 10 * lower
    found = evaluate(BOUNCING, CONTACTNETS_CUBE, before, after, DT)
    assert found.solved.all()
    assert found.scores.shape == (16, 59)

    def losses(direction: Array, by: float) -> Array:
        parts = np.split(by * direction, [24, 27, 51, 57, 58])
        changed = replace(
            BOUNCING,
            vertices_normal=BOUNCING.vertices_normal + parts[0].reshape(8, 3),
            normal=BOUNCING.normal + parts[1],
            vertices_tangent=BOUNCING.vertices_tangent + parts[2].reshape(8, 3),
            tangents=BOUNCING.tangents + parts[3].reshape(2, 3),
            height=BOUNCING.height + float(parts[4][0]),
            restitution=E + float(parts[5][0]),
        )
        return evaluate(changed, CONTACTNETS_CUBE, before, after, DT).losses

    fisher = fisher_sums(BOUNCING, CONTACTNETS_CUBE, before, after, DT, [0, 16], Estimator.GAUSS_NEWTON).fishers[0]
    np.testing.assert_allclose(fisher, fisher.T, atol=1e-9 * np.trace(fisher))
    directions = [*np.random.default_rng(1).standard_normal((4, 59)), *np.eye(59)[[26, 57, 58]]]
    for direction in directions:
        slope = (losses(direction, 1e-5) - losses(direction, -1e-5)) / 2e-5
        assert -2.0 * found.scores @ direction == pytest.approx(slope, rel=1e-3, abs=1e-3 * np.abs(slope).max())


@pytest.mark.slow
@pytest.mark.parametrize("cone", list(Cone))
@pytest.mark.parametrize("lower", [0.0, 0.6])
def test_the_gauss_newton_matrix_is_the_dense_one(lower: float, cone: Cone) -> None:
    """As without a restitution (`test/contact/test_fishers.py`), of contacts from above the board and from under it."""
    before, after = impacts()
    before[:, 2] -= lower
    config, rows = LossConfig(cone=cone), np.arange(17)
    ours = fisher_sums(BOUNCING, CONTACTNETS_CUBE, before, after, DT, rows, Estimator.GAUSS_NEWTON, config=config).fishers
    impulses = evaluate(BOUNCING, CONTACTNETS_CUBE, before, after, DT, config).impulses
    frames = Frames.of(CONTACTNETS_CUBE, before, after, np.full(16, DT), precesses=True)
    dense = profile_fishers(BOUNCING, frames, impulses, config.for_theta(CONTACTNETS_CUBE, BOUNCING.is_rigid))
    assert dense.shape == (16, 59, 59)
    assert (dense[:, 58, 58] > 1e-3 * np.trace(dense, axis1=1, axis2=2) / 59).any()
    scale = np.abs(dense).max(axis=(1, 2), keepdims=True)
    assert (np.abs(ours - dense) / scale).max() < 1e-7


def test_torch_has_the_kernels_losses_and_scores_by_every_parameter() -> None:
    before, after = impacts()
    found = evaluate(BOUNCING, CONTACTNETS_CUBE, before, after, DT)
    theta = Theta(*(torch.as_tensor(part).clone().requires_grad_() for part in Theta.of(BOUNCING)))
    restitution = torch.tensor(E, dtype=torch.float64, requires_grad=True)
    losses, solved = polytope_losses(
        theta, CONTACTNETS_CUBE, before, after, np.full(16, DT), restitution=restitution, precesses=True
    )
    assert solved.all()
    np.testing.assert_array_equal(losses.detach(), found.losses)
    weights = np.linspace(0.5, 2.0, 16)
    by = torch.autograd.grad(losses, [*theta[:5], restitution], torch.as_tensor(weights))
    slope = np.concatenate([each.numpy().ravel() for each in by])
    np.testing.assert_allclose(slope, -2.0 * weights @ found.scores, rtol=1e-12, atol=1e-12)
    for outside, inside in ((-0.1, 0.0), (1.2, 1.0)):
        clamped = polytope_losses(
            theta,
            CONTACTNETS_CUBE,
            before,
            after,
            np.full(16, DT),
            restitution=torch.tensor(outside, dtype=torch.float64),
            precesses=True,
        )[0]
        limit = evaluate(replace(BOUNCING, restitution=inside), CONTACTNETS_CUBE, before, after, DT)
        np.testing.assert_array_equal(clamped.detach(), np.where(limit.solved, limit.losses, np.nan))


def test_a_model_can_be_given_a_restitution_another_noise_and_shared_vertices() -> None:
    still = PolytopeModel(replace(BOUNCING, restitution=None), CONTACTNETS_CUBE, Form.RIGID)
    bouncing = still.bouncing()
    assert (still.geometry().restitution, bouncing.geometry().restitution) == (None, INITIAL_RESTITUTION)
    assert bouncing.bouncing() is bouncing
    noisy = bouncing.with_noise(ImpulseNoise(0.7, 1.1))
    assert noisy.geometry().noise == ImpulseNoise(0.7, 1.1)
    assert noisy.geometry().restitution == INITIAL_RESTITUTION
    apart = replace(POINT, vertices_tangent=np.ones((1, 3)))
    shared = PolytopeModel(apart, CONTACTNETS_CUBE, Form.PHYSICAL).with_shared_vertices()
    np.testing.assert_array_equal(shared.geometry().vertices_tangent, POINT.vertices_normal)
    for model, form in ((bouncing, Form.RIGID), (noisy, Form.RIGID), (shared, Form.PHYSICAL)):
        assert (model.body, model.form) == (CONTACTNETS_CUBE, form)


def test_impacts_are_information_about_the_restitution() -> None:
    before, after = impacts()
    found = fisher_sums(BOUNCING, CONTACTNETS_CUBE, before, after, DT, [0, 16], Estimator.GAUSS_NEWTON).fishers[0]
    assert found[58, 58] > 1.0
    assert np.linalg.eigvalsh(found).min() > -1e-9 * np.trace(found)
    up = before.copy()
    up[:, 2] += 5.0
    free = fisher_sums(BOUNCING, CONTACTNETS_CUBE, up, up, DT, [0, 16], Estimator.GAUSS_NEWTON).fishers[0]
    assert free[58, 58] == 0.0


def test_a_restitution_of_zero_changes_no_number() -> None:
    before, after = impacts()
    without, zero = (evaluate(replace(BOUNCING, restitution=e), CONTACTNETS_CUBE, before, after, DT) for e in (None, 0.0))
    assert np.array_equal(without.losses, zero.losses)
    assert np.array_equal(without.scores, zero.scores[:, :-1])
    plain, still = (rollout(replace(BOUNCING, restitution=e), CONTACTNETS_CUBE, before, 40, DT).states for e in (None, 0.0))
    assert np.array_equal(plain, still)


def test_a_contact_parts_with_its_share_of_the_speed() -> None:
    after = step(replace(POINT, restitution=E), CONTACTNETS_CUBE, state(0.05, -30.0), DT).states
    assert after[0, 9] == pytest.approx(E * 30.0)
    far = step(replace(POINT, restitution=E), CONTACTNETS_CUBE, state(5.0, -30.0), DT).states
    assert far[0, 9] < -30.0


def test_a_dropped_body_rises_by_the_square_of_its_restitution() -> None:
    heights = rollout(replace(POINT, restitution=E), CONTACTNETS_CUBE, state(10.0, 0.0), 120, DT).states[:, 2]
    landed = int(np.argmax(heights < 0.5))
    assert heights[landed + 2 :].max() == pytest.approx(10.0 * E**2, rel=0.1)


def test_only_the_rigid_form_has_a_restitution() -> None:
    form = parameter_form(BOUNCING, Form.RIGID)
    assert form.chart.shape == (59, 29)
    assert form.names()[24:26] == ("restitution", "friction")
    with pytest.raises(
        InvalidValueError, match=r"^form: found physical, expected rigid, since the parameters have a restitution$"
    ):
        parameter_form(BOUNCING, Form.PHYSICAL)


def test_a_step_leaves_it_within_0_and_1() -> None:
    model, to = PolytopeModel(BOUNCING, CONTACTNETS_CUBE, Form.RIGID), np.zeros(29)
    for far, end in ((-2.0, 0.0), (2.0, 1.0), (0.1, E + 0.1)):
        to[24] = far
        assert moved(model, to).geometry().restitution == pytest.approx(end)


def test_theta_as_bytes_keeps_it() -> None:
    assert geometry_of_bytes(bytes_of_geometry(BOUNCING)).restitution == E
