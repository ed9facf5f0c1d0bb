"""The loss in torch: the kernel's numbers, Jacobians that are derivatives, and a differentiable loss for training."""

from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from contact_curation.contact.evaluation import Cone, Estimator, SolveStatus, evaluate, fisher_sums
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta, contacts_of
from contact_curation.contact.torch_loss import contact_losses, loss_and_slopes, polytope_losses
from contact_curation.errors import InvalidValueError
from contact_curation.solver.cone_problem import ConeWeights
from test.contact.cases import CUBE, DT, TRUE, full_vector, noisy_geometry, rows_of_kind, tracked_transitions
from test.contact.torch_evaluation import evaluate_in_torch, loss_terms
from test.contact.torch_fisher import fisher_sums_in_torch

Losses = Callable[[Theta], tuple[Tensor, Tensor]]


def frames(kind: str = "impact", count: int = 8) -> Frames:
    rows = rows_of_kind(kind, count)
    return Frames.of(CUBE, rows.before, rows.after, np.full(count, DT))


def test_theta_goes_to_a_vector_and_back() -> None:
    geometry = noisy_geometry(1, pivot=True)
    theta = Theta.of(geometry)
    np.testing.assert_array_equal(theta.vector().numpy(), full_vector(geometry))
    again = theta.with_vector(theta.vector()).geometry()
    for name in ("vertices_normal", "normal", "vertices_tangent", "tangents", "pivot", "height"):
        np.testing.assert_array_equal(getattr(again, name), getattr(geometry, name))
    np.testing.assert_array_equal(theta.with_vector(theta.vector().repeat(5, 1)).vector()[3].numpy(), full_vector(geometry))


def test_whole_numbers_are_states_too() -> None:
    states = np.tile(np.arange(13) == 3, (2, 1))
    whole, plain = (Frames.of(CUBE, states.astype(kind), states.astype(kind), [1, 2]) for kind in (int, float))
    assert all(map(torch.equal, whole, plain))


def test_gaps_are_those_of_the_geometry() -> None:
    rows, geometry = rows_of_kind("impact"), noisy_geometry(2, pivot=True)
    contacts = contacts_of(Theta.of(geometry), frames())
    np.testing.assert_allclose(contacts.gaps.numpy(), geometry.gaps(rows.before), atol=1e-12)
    np.testing.assert_allclose(contacts.gaps_next.numpy(), geometry.gaps(rows.after), atol=1e-12)


def test_jacobians_are_derivatives_along_twists() -> None:
    """method.md 6.3: of gaps and tangential places, along x + v, R exp(omega)."""
    geometry, at = noisy_geometry(3, pivot=True), frames("sliding")
    theta = Theta.of(geometry)

    def places(twist: Tensor, rotation: Tensor, position: Tensor) -> Tensor:
        zero = torch.zeros((), dtype=twist.dtype)
        x, y, z = twist[3], twist[4], twist[5]
        spin = torch.stack([torch.stack([zero, -z, y]), torch.stack([z, zero, -x]), torch.stack([-y, x, zero])])
        turned, moved = rotation @ torch.linalg.matrix_exp(spin), position + twist[:3]
        gap = (theta.vertices_normal @ turned.T + moved - theta.pivot) @ theta.normal - theta.height
        return torch.cat([gap[:, None], (theta.vertices_tangent @ turned.T + moved) @ theta.tangents.T], dim=1)

    jacobians = contacts_of(theta, at).jacobians
    for n in range(len(jacobians)):
        derivative = torch.func.jacrev(places)(torch.zeros(6, dtype=torch.float64), at.rotations[n], at.positions[n])
        assert (derivative - jacobians[n]).abs().max() < 1e-10


@pytest.mark.parametrize("cone", list(Cone))
@pytest.mark.parametrize("geometry", [TRUE, noisy_geometry(4, pivot=True)], ids=["true", "noisy"])
def test_torch_and_the_kernel_evaluate_alike(geometry: ContactGeometry, cone: Cone) -> None:
    rows, config = tracked_transitions(), LossConfig(cone=cone)
    before, after, dt = rows.before[::4], rows.after[::4], rows.dt[::4]
    kernel = evaluate(geometry, CUBE, before, after, dt, config)
    with torch.no_grad():  # as where a mean loss is taken
        plain = evaluate_in_torch(geometry, CUBE, before, after, dt, config)
    assert kernel.solved.all()
    assert plain.solved.all()
    np.testing.assert_allclose(plain.terms, kernel.terms, atol=1e-7)
    np.testing.assert_allclose(plain.losses, kernel.losses, atol=1e-9)
    assert np.abs(plain.scores - kernel.scores).max() < 1e-5
    assert np.median(np.abs(plain.scores - kernel.scores)) < 1e-8


@pytest.mark.parametrize("estimator", list(Estimator))
def test_torch_and_the_kernel_sum_alike(estimator: Estimator) -> None:
    rows = tracked_transitions()
    edges, stop = rows.starts[:3], rows.starts[2]
    given = (TRUE, CUBE, rows.before[:stop], rows.after[:stop], rows.dt[:stop], edges, estimator, 0.05)
    kernel, plain = fisher_sums(*given), fisher_sums_in_torch(*given)
    scale = np.abs(kernel.fishers).max()
    np.testing.assert_allclose(plain.fishers, kernel.fishers, atol=1e-6 * scale)
    np.testing.assert_allclose(plain.score_sums, kernel.score_sums, atol=1e-6)
    np.testing.assert_array_equal(plain.status, kernel.status)


def test_torch_gives_a_bad_transition_a_status_and_leaves_its_neighbours_alone() -> None:
    rows = rows_of_kind("impact")
    broken = rows.before.copy()
    broken[2, 0] = np.nan
    good, found = (evaluate_in_torch(TRUE, CUBE, before, rows.after, DT) for before in (rows.before, broken))
    assert found.status.tolist() == [SolveStatus.NOT_FINITE if n == 2 else SolveStatus.SOLVED for n in range(8)]
    kept = np.arange(8) != 2
    np.testing.assert_allclose(found.scores[kept], good.scores[kept], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("weights", [ConeWeights(), ConeWeights(0.3, 0.5, 2.0, 0.7, 1.5)], ids=["default", "other"])
def test_slopes_written_out_are_those_of_automatic_differentiation(weights: ConeWeights) -> None:
    at = frames("sliding")
    at.velocities_next[2] = 0.0  # no contact slips: its speed has no derivative there
    given = contacts_of(Theta.of(noisy_geometry(7)), at)
    leaves = Contacts(*(value.detach().requires_grad_() for value in given))
    impulses = torch.as_tensor(np.random.default_rng(8).standard_normal((*given.gaps.shape, 3)))
    expected = loss_terms(leaves, at, impulses, weights).sum(dim=-1)
    losses, slopes = loss_and_slopes(leaves, at, impulses, weights)
    torch.testing.assert_close(losses, expected.detach(), rtol=1e-12, atol=0.0)
    for one, other in zip(slopes, torch.autograd.grad(expected.sum(), leaves), strict=True):
        assert other.any()
        torch.testing.assert_close(one, other, rtol=1e-10, atol=1e-10)


def through_contacts(theta: Theta) -> tuple[Tensor, Tensor]:
    return contact_losses(contacts_of(theta, frames()), frames())


def through_scores(theta: Theta) -> tuple[Tensor, Tensor]:
    rows = rows_of_kind("impact")
    return polytope_losses(theta, CUBE, rows.before, rows.after, np.full(8, DT))


BOTH = pytest.mark.parametrize("losses_of", [through_contacts, through_scores])


@BOTH
def test_the_differentiable_loss_has_the_gradient_of_the_profile(losses_of: Losses) -> None:
    theta = Theta.of(noisy_geometry(5, share=0.1))
    vector = theta.vector().requires_grad_()
    weights = torch.linspace(0.5, 2.0, 8, dtype=torch.float64)
    losses, solved = losses_of(theta.with_vector(vector))
    assert solved.all()
    (slope,) = torch.autograd.grad((weights * losses).sum(), vector)
    direction = torch.randn(58, dtype=torch.float64, generator=torch.Generator().manual_seed(6))
    ahead, behind = (
        (weights * losses_of(theta.with_vector(vector.detach() + side * 1e-6 * direction))[0]).sum() for side in (1, -1)
    )
    assert float(slope @ direction) == pytest.approx(float(ahead - behind) / 2e-6, rel=1e-3)
    assert float(slope.norm()) > 1e-2


@BOTH
def test_a_second_derivative_is_refused_aloud(losses_of: Losses) -> None:
    theta = Theta.of(TRUE)
    vector = theta.vector().requires_grad_()
    losses, _ = losses_of(theta.with_vector(vector))
    message = "create_graph: found True, expected False: the loss has no second derivative, since its impulses stay fixed"
    with pytest.raises(InvalidValueError, match=f"^{message}$"):
        torch.autograd.grad(losses.sum(), vector, create_graph=True)


def test_a_loss_that_is_not_solved_is_no_number_and_sends_nothing_back() -> None:
    at, theta = frames(), Theta.of(TRUE)
    contacts = contacts_of(theta, at)
    gaps = contacts.gaps_next.clone()
    gaps[3, 0] = torch.nan
    leaves = Contacts(contacts.gaps, gaps.requires_grad_(), contacts.jacobians)
    losses, solved = contact_losses(leaves, at)
    assert solved.tolist() == [n != 3 for n in range(8)]
    assert torch.isnan(losses).tolist() == [n == 3 for n in range(8)]
    losses[solved].sum().backward()  # type: ignore[no-untyped-call]
    assert gaps.grad is not None
    assert torch.isfinite(gaps.grad).all()
    assert not gaps.grad[3].any()
    assert gaps.grad[0].any()
