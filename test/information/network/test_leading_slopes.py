"""A few slopes in place of many: right on average, exact where there are enough, alike for the same seed."""

import numpy as np
import pytest
import torch
from torch import Tensor

from contact_curation.information.network.forward_pass import Slopes, leading_slopes

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
    return leading_slopes(slopes, count, weights, np.random.default_rng(seed))


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
