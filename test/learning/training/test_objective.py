"""What training goes down: bounded losses, the ground near zero, and what diverges is found among its neighbours."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import MODELS
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.objective import (
    InfluenceBound,
    InfluenceShape,
    bounded,
    ground_excess,
    height_parameters,
    not_finite,
    not_finite_gradient,
)
from contact_curation.learning.training.progress import TrainingState
from contact_curation.learning.training.protocols import budgeted, published
from contact_curation.learning.training.training import Training, new_training
from test.contact.cases import CUBE, tracked_transitions
from test.contact.model_cases import VARIANTS, model_of
from test.contact.model_cases import rows_of as rows_of_kind
from test.learning.toy import SOLVED, STEEP, UNSOLVED, Toy, toy_data

LOSSES = torch.tensor([1.0, 2.0, 3.0, 4.0, 100.0], dtype=torch.float64)
BOUND = 4.0
"""Their quantile 0.75."""


def slopes(losses: torch.Tensor, influence: InfluenceBound) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    leaf = losses.clone().requires_grad_()
    bounded(leaf, influence).sum().backward()  # type: ignore[no-untyped-call]
    assert leaf.grad is not None
    return leaf.grad.numpy()


def test_huber_is_the_loss_up_to_the_bound_and_grows_like_its_root_above() -> None:
    found = bounded(LOSSES, InfluenceBound(0.75, shape=InfluenceShape.HUBER)).numpy()
    np.testing.assert_allclose(found, [1.0, 2.0, 3.0, 4.0, 2 * np.sqrt(BOUND * 100.0) - BOUND])
    np.testing.assert_allclose(
        slopes(LOSSES, InfluenceBound(0.75, shape=InfluenceShape.HUBER)), [1, 1, 1, 1, np.sqrt(BOUND / 100.0)]
    )


def test_geman_never_exceeds_the_bound_and_its_slope_falls_to_nothing() -> None:
    influence = InfluenceBound(0.75, shape=InfluenceShape.GEMAN)
    assert bounded(LOSSES, influence).max() < BOUND
    np.testing.assert_allclose(slopes(LOSSES, influence), (1.0 + LOSSES.numpy() / BOUND) ** -2)


@pytest.mark.parametrize("shape", list(InfluenceShape))
def test_the_slope_is_that_of_finite_differences_with_the_bound_fixed(shape: InfluenceShape) -> None:
    influence, step = InfluenceBound(0.75, shape=shape), 1e-6
    for row in (0, 4):  # moving these leaves the quantile, which is the fourth of five, where it is
        moved = [bounded(LOSSES + step * sign * torch.eye(5, dtype=torch.float64)[row], influence)[row] for sign in (1, -1)]
        assert slopes(LOSSES, influence)[row] == pytest.approx(float(moved[0] - moved[1]) / (2 * step), rel=1e-6)


def test_a_single_loss_and_a_quantile_of_one_are_left_alone() -> None:
    assert bounded(LOSSES, InfluenceBound(1.0)) is LOSSES
    np.testing.assert_array_equal(bounded(LOSSES[4:], InfluenceBound(0.5)), LOSSES[4:])


@pytest.mark.parametrize("shape", list(InfluenceShape))
def test_losses_that_are_all_zero_stay_zero_with_a_finite_slope(shape: InfluenceShape) -> None:
    zeros = torch.zeros(4, dtype=torch.float64)
    assert not bounded(zeros, InfluenceBound(0.5, shape=shape)).any()
    assert np.isfinite(slopes(zeros, InfluenceBound(0.5, shape=shape))).all()


def test_a_multiple_of_the_quantile_bounds_later() -> None:
    slope = slopes(LOSSES, InfluenceBound(0.75, multiple=5.0, shape=InfluenceShape.HUBER))
    np.testing.assert_allclose(slope, [1, 1, 1, 1, np.sqrt(5.0 * BOUND / 100.0)])


@pytest.mark.parametrize(
    ("kind", "form", "count"),
    [
        ("polytope", Form.PHYSICAL, 1),
        ("deep", Form.PHYSICAL, 1),
        ("polytope", Form.CONTACTNETS, 0),
        ("deepvertex", Form.PHYSICAL, 0),
        ("end_to_end", Form.PHYSICAL, 0),
    ],
)
def test_a_height_is_found_where_one_is_learned(kind: str, form: Form, count: int) -> None:
    assert len(height_parameters(model_of(kind, form))) == count


def test_the_excess_is_the_square_and_its_slope_twice_the_height() -> None:
    heights = height_parameters(model_of("polytope", Form.PHYSICAL))
    value, height = ground_excess(heights), float(heights[0].detach())
    value.backward()  # type: ignore[no-untyped-call]
    assert float(value.detach()) == pytest.approx(height**2)
    assert heights[0].grad is not None
    assert float(heights[0].grad) == pytest.approx(2.0 * height)


def height_after(weight: float) -> float:
    config = replace(budgeted("polytope"), steps=60, batch=32, ground=weight)
    training = new_training("polytope", CUBE, tracked_transitions(), None, config, 0)
    training.advance(60)
    assert isinstance(training.model, PolytopeModel)
    return abs(training.model.geometry().height)


def test_a_heavier_weight_holds_the_height_nearer_to_zero() -> None:
    free, held = height_after(0.0), height_after(100.0)
    assert held < 0.02 < free
    assert np.isfinite(free)


@pytest.mark.parametrize(("kind", "form"), VARIANTS[:-1])
def test_contacts_that_cannot_be_squared_are_not_finite(kind: str, form: Form) -> None:
    model, rows = model_of(kind, form), rows_of_kind("impact", 3)
    assert not not_finite(model, rows).any()
    after = rows.after.copy()
    after[1, 2] = 1e200
    assert not_finite(model, rows._replace(after=after)).tolist() == [False, True, False]


def test_what_an_end_to_end_model_could_not_solve_is_not_finite() -> None:
    model, rows = model_of("end_to_end", Form.PHYSICAL), rows_of_kind("impact", 3)
    after = rows.after.copy()
    after[1, 9] = 1e200
    broken = rows._replace(after=after)
    assert not_finite(model, broken).tolist() == [False, True, False]
    assert model.batch_loss(broken, DEFAULT_LOSS).solved.tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("targets", "what", "worst"),
    [
        ([1.0, 2.0, 3.0], [SOLVED, STEEP, SOLVED], 1),
        ([1.0, 1e200, 3.0], [SOLVED, SOLVED, SOLVED], 1),  # its square is not finite
        ([1.0, 2.0, 9.0], [UNSOLVED, SOLVED, SOLVED], 2),  # none alone: the largest
    ],
)
def test_the_worst_has_a_gradient_that_is_not_finite_or_the_largest(
    targets: list[float], what: list[float], worst: int
) -> None:
    assert not_finite_gradient(Toy(), rows_of(toy_data(targets, what)), DEFAULT_LOSS) == worst


@pytest.mark.parametrize("kind", list(MODELS))
def test_parameters_that_have_run_away_stop_the_training_by_name(kind: str) -> None:
    data = tracked_transitions()
    model = model_of(kind, Form.CONTACTNETS)
    with torch.no_grad():
        for value in model.parameters():
            value.mul_(1e200)
    training = Training(model, data, None, replace(published(kind), patience=None), 0)
    progress = training.advance(3)
    assert progress.state is TrainingState.FAILED
    name, place = progress.reason.split(",")[0], int(progress.reason.split("transition ")[1].split(":")[0])
    assert name.removeprefix("toss ") in data.toss_ids
    assert 0 <= place < np.diff(data.starts).max()
    assert "not finite" in progress.reason
