"""A bounded loss is the loss below the bound, has the slope it should above, and leaves most transitions alone."""

import numpy as np
import pytest
import torch

from contact_curation.learning.training.objective import InfluenceBound, InfluenceShape, bounded

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
