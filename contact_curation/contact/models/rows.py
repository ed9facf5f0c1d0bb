"""Batches of transitions for models, and their losses."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from contact_curation.geometry.quaternions import Array


class Rows(NamedTuple):
    """B transitions: states (B, 13) before and after, frame periods (B,) [s]."""

    before: Array
    after: Array
    dt: Array

    def take(self, chosen: ArrayLike | slice) -> "Rows":
        """Some of them."""
        index = chosen if isinstance(chosen, slice) else np.asarray(chosen)
        return Rows(self.before[index], self.after[index], self.dt[index])


class BatchLoss(NamedTuple):
    """The loss of one batch.

    Attributes:
        losses: (B,) per transition, differentiable by theta; NaN where the impulses carry no certificate.
        solved: (B,) whether they carry one; nothing flows back from the others.
        regularizer: () what keeps theta's scale in place, without its weight; zero where a model needs none. It is no part of
            the likelihood and enters no score (method.md A4).
    """

    losses: Tensor
    solved: Tensor
    regularizer: Tensor


def over_finite_rows(rows: Rows, losses_of: Callable[[Rows], BatchLoss]) -> BatchLoss:
    """`losses_of` the transitions whose numbers are all finite; the others are not solved.

    For models that differentiate through a network: the slope that comes back to a bad transition is zero, but zero times its
    inputs, which are not numbers, would spoil the gradient of all.
    """
    finite = np.isfinite(rows.before).all(axis=1) & np.isfinite(rows.after).all(axis=1) & np.isfinite(rows.dt)
    if finite.all():
        return losses_of(rows)
    found, kept = losses_of(rows.take(finite)), torch.as_tensor(finite)
    losses, solved = torch.full((len(kept),), torch.nan, dtype=torch.float64), torch.zeros(len(kept), dtype=torch.bool)
    return BatchLoss(losses.index_put((kept,), found.losses), solved.index_put((kept,), found.solved), found.regularizer)
