"""Scores by a network's weights through the slopes of its layers, against automatic differentiation of single transitions."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.end_to_end import EndToEndModel
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.torch_contacts import Contacts
from contact_curation.contact.torch_loss import cone_problems
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.forward_pass import (
    Draws,
    ForwardPass,
    Slopes,
    contact_residuals,
    forward_pass,
    frozen_copy,
    leading_slopes,
    residuals_by_impulses,
)
from contact_curation.information.network.sketch import ghost_norms, summed_gradient
from contact_curation.solver.certificate import free_directions, objectives
from test.contact.test_time_step import lopsided_body
from test.information.network_cases import NETWORKS, long_scores, network, rows_of, some_not_solved, tosses


def impacts(count: int) -> Rows:
    """The transitions in which the velocity changes most."""
    rows = rows_of(tosses())
    change = np.abs(rows.after[:, 9] - rows.before[:, 9])
    return rows.take(np.sort(np.argsort(-change)[:count]))


def passed(model: Model, rows: Rows, config: LossConfig = DEFAULT_LOSS) -> tuple[ForwardPass, list[torch.Tensor]]:
    """A forward pass and the slopes of the scores by every layer."""
    found = forward_pass(frozen_copy(model), rows, config)
    (slopes,) = zip(*found.score_slopes(found.solved.astype(float)), strict=True)
    return found, list(found.deltas(slopes))


def traces(found: ForwardPass, deltas: list[torch.Tensor]) -> Array:
    return np.sum([ghost_norms(*pair).numpy() for pair in zip(found.tape, deltas, strict=True)], axis=0)


@pytest.mark.parametrize("count", [1, 7])
@pytest.mark.parametrize("kind", NETWORKS)
def test_ghost_norms_and_sums_are_those_of_single_gradients(kind: str, count: int) -> None:
    model, rows = network(kind), impacts(count)
    found, deltas = passed(model, rows)
    scores = np.concatenate(list(long_scores(model, rows).values()), axis=1)
    assert found.solved.all()
    np.testing.assert_allclose(traces(found, deltas), np.square(scores).sum(axis=1), rtol=1e-9)
    summed = summed_gradient(found.tape, deltas).numpy()
    np.testing.assert_allclose(summed, scores.sum(axis=0), atol=1e-9 * np.abs(scores).max())


def test_a_model_whose_spins_precess_is_scored_by_its_own_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DeepModel, "precesses", True)
    rows = impacts(7)
    model = model_class("deep").initial(lopsided_body(1), Form.PHYSICAL, rows, np.random.default_rng(7))
    expected, found = model.batch_loss(rows, DEFAULT_LOSS), forward_pass(frozen_copy(model), rows, DEFAULT_LOSS)
    assert expected.solved.all()
    np.testing.assert_allclose(found.losses, expected.losses.detach(), rtol=1e-9)


@pytest.mark.slow
def test_ghost_norms_of_256_transitions_are_exact_to_1e_5() -> None:
    """method.md 6, check 15; to rounding, in fact."""
    model, rows = network("deep"), rows_of(tosses()).take(slice(0, 256))
    norms = np.square(np.concatenate(list(long_scores(model, rows).values()), axis=1)).sum(axis=1)
    found = traces(*passed(model, rows))
    assert np.abs(found - norms).max() <= 1e-10 * norms.max()
    np.testing.assert_allclose(found, norms, rtol=1e-5, atol=1e-12 * norms.max())


@pytest.mark.parametrize("kind", ["deep", "deepvertex"])
def test_what_is_not_solved_is_left_out_and_disturbs_nobody(kind: str) -> None:
    model, rows = network(kind), impacts(7)
    few = some_not_solved(model, rows)
    found, deltas = passed(model, rows, few)
    hard, easy = np.flatnonzero(~found.solved), np.flatnonzero(found.solved)
    assert np.isnan(found.losses[hard]).all()
    norms = traces(found, deltas)
    assert (norms[hard] == 0.0).all()
    np.testing.assert_allclose(norms[easy], traces(*passed(model, rows.take(easy), few)), rtol=1e-9)


def test_a_model_that_is_scored_may_go_on_learning() -> None:
    model = network("deep")
    copied = frozen_copy(model)
    with torch.no_grad():
        next(copied.parameters()).add_(1.0)
    assert all(value.requires_grad for value in model.parameters())
    assert not torch.equal(next(model.parameters()), next(copied.parameters()))


def second_moment(found: ForwardPass, directions: torch.Tensor) -> float:
    """The trace of the sum of outer products of what directions give, over all transitions."""
    slopes = found.profile_slopes(directions, np.ones(len(found.losses)))
    each: list[Slopes] = [found.deltas(one) for one in zip(*slopes, strict=True)]
    return float(sum(traces(found, list(deltas)).sum() for deltas in each))


def test_random_directions_give_the_gauss_newton_trace_on_average() -> None:
    found = forward_pass(frozen_copy(network("deep")), impacts(3), DEFAULT_LOSS)
    size = found.directions_size
    assert size == 6 + 9 * 8
    exact = second_moment(found, torch.eye(size, dtype=torch.float64)[:, None].expand(-1, 3, -1))
    rng = np.random.default_rng(0)
    draws = [second_moment(found, torch.as_tensor(rng.standard_normal((1, 3, size)))) for _ in range(150)]
    error = float(np.std(draws)) / np.sqrt(len(draws))
    assert error < 0.15 * exact
    assert abs(np.mean(draws) - exact) < 3.0 * error


def test_residuals_by_impulses_are_their_derivatives() -> None:
    model, rows = frozen_copy(network("deep")), impacts(5)
    found = forward_pass(model, rows, DEFAULT_LOSS)
    contacts = Contacts(*(value.detach() for value in found.outputs))
    assert found.impulses is not None
    impulses = found.impulses.clone().requires_grad_()
    said = contact_residuals(contacts, found.frames, impulses, DEFAULT_LOSS)
    expected = [torch.autograd.grad(column.sum(), impulses, retain_graph=True)[0] for column in said.T]
    derivatives = residuals_by_impulses(contacts, found.frames, found.impulses, DEFAULT_LOSS)
    torch.testing.assert_close(derivatives, torch.stack(expected, dim=1), rtol=1e-12, atol=1e-12)


def test_unit_directions_take_out_what_impulses_explain_and_no_more_than_their_regularization_allows() -> None:
    stiff = replace(DEFAULT_LOSS, regularization=1e-2)
    found = forward_pass(frozen_copy(network("deep")), impacts(4), stiff)
    units = torch.eye(found.directions_size, dtype=torch.float64)[:, None].expand(-1, 4, -1)
    rows = torch.cat([slope.flatten(2) for slope in found.profile_slopes(units, np.ones(4))], dim=2)  # (n, B, C)
    leaves = Contacts(*(value.detach().requires_grad_() for value in found.outputs))
    assert found.impulses is not None
    said = contact_residuals(leaves, found.frames, found.impulses, stiff)
    columns = [torch.autograd.grad(column.sum(), leaves, retain_graph=True) for column in said.T]
    by_contacts = torch.stack([torch.cat([part.flatten(1) for part in column], dim=1) for column in columns], dim=1)
    gradients = objectives(cone_problems(leaves, found.frames, stiff), found.impulses.numpy()).gradients
    bases = torch.as_tensor(free_directions(found.impulses.numpy(), gradients, stiff.cone))
    by_impulses = residuals_by_impulses(leaves, found.frames, found.impulses, stiff).detach()
    free = torch.einsum("brkc,bkcd->brkd", by_impulses, bases).flatten(2)
    damped = free.mT @ free + stiff.regularization * torch.eye(free.shape[2])
    kept = torch.eye(free.shape[1]) - free @ torch.linalg.solve(damped, free.mT)
    torch.testing.assert_close(torch.einsum("nbi,nbj->bij", rows, rows), by_contacts.mT @ kept @ by_contacts)


def test_an_end_to_end_models_unit_directions_give_its_jacobian() -> None:
    model, rows = network("end_to_end"), impacts(2)
    assert isinstance(model, EndToEndModel)
    found = forward_pass(frozen_copy(model), rows, DEFAULT_LOSS)
    units = torch.eye(6, dtype=torch.float64)[:, None].expand(-1, 2, -1)
    expected = 0.0
    for row in range(2):
        for component in model.missed_velocities(rows.take([row]))[0]:
            slopes = torch.autograd.grad(component, list(model.parameters()), retain_graph=True)
            expected += sum(float(slope.square().sum()) for slope in slopes)
    assert second_moment(found, units) == pytest.approx(expected, rel=1e-9)


BATCH, RESIDUALS = 2, 12


def slopes_of_rank(rank: int) -> Slopes:
    """By two outputs, (3,) and (2, 2), per transition."""
    rng = np.random.default_rng(rank)
    strong = rng.standard_normal((RESIDUALS, rank)) * 3.0 ** -np.arange(rank)
    flat = torch.as_tensor(np.einsum("mr,brc->mbc", strong, rng.standard_normal((BATCH, rank, 7))))
    return flat[..., :3], flat[..., 3:].reshape(RESIDUALS, BATCH, 2, 2)


def moment(slopes: Slopes) -> Tensor:
    """(B, 7, 7) sums of outer products."""
    rows = torch.cat([slope.flatten(2) for slope in slopes], dim=2)
    return torch.einsum("nbi,nbj->bij", rows, rows)


def made(slopes: Slopes, count: int, seed: int, weights: tuple[float, float] = (1.0, 1.0)) -> Slopes:
    return leading_slopes(slopes, weights, Draws.of(np.random.default_rng(seed), BATCH, RESIDUALS, count))


@pytest.mark.parametrize("count", [1, 3])
def test_they_are_right_on_average(count: int) -> None:
    slopes = slopes_of_rank(5)
    moments = torch.stack([moment(made(slopes, count, seed, (2.0, 0.5))) for seed in range(400)])
    errors = moments.std(dim=0) / 400**0.5
    assert ((moments.mean(dim=0) - moment(slopes)).abs() <= 5.0 * errors + 1e-12).all()


def test_as_many_as_the_rank_and_one_more_are_exact() -> None:
    slopes = slopes_of_rank(3)
    torch.testing.assert_close(moment(made(slopes, 4, 0)), moment(slopes))


def test_noise_falls_as_there_are_more() -> None:
    slopes = slopes_of_rank(6)
    traces = [[float(moment(made(slopes, count, seed))[0].trace()) for seed in range(60)] for count in (1, 2, 4)]
    deviations = [float(np.std(each)) for each in traces]
    assert deviations[0] > 3.0 * deviations[1] > 9.0 * deviations[2] > 0.0


def test_as_many_as_there_are_stay_as_they_are() -> None:
    slopes = slopes_of_rank(5)
    assert made(slopes, RESIDUALS, 0) is slopes


def test_nothing_gives_nothing() -> None:
    silent = tuple(torch.zeros_like(slope) for slope in slopes_of_rank(2))
    assert all(torch.equal(slope, torch.zeros_like(slope)) for slope in made(silent, 3, 0))
