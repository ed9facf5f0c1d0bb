"""A few backward passes that stand for many: the strongest directions exactly, all that is left by one random mixture of it.

A Gauss-Newton matrix is a sum over m residuals, sum_j s_j s_j^T, s_j the slopes of one of them by a model's outputs. For any
orthonormal columns Q in the space of the residuals and a vector e of random signs,

    sum_q (S^T q)(S^T q)^T + (S^T e')(S^T e')^T,   e' = (I - Q Q^T) e

has that sum as its mean, and only what Q misses is noisy. A few steps of subspace iteration find a Q that misses little (as in
Hutch++: Meyer, Musco, Musco, Woodruff 2021).
"""

from collections.abc import Sequence

import numpy as np
import torch

from contact_curation.information.network.forward_pass import Slopes

ITERATIONS = 2
"""Of the subspace iteration; each multiplies what is weak by the square of its share."""


def leading_slopes(slopes: Slopes, count: int, weights: Sequence[float], rng: np.random.Generator) -> Slopes:
    """Slopes (count, B, ...) whose outer products have those of slopes (m, B, ...) as their mean, for each of B transitions.

    Args:
        slopes: by each of a model's outputs.
        count: at least 1.
        weights: how far theta moves each output: what is strong is judged by it, and nothing but noise depends on it.
        rng: where the signs come from.
    """
    rows = torch.cat([slope.flatten(2) for slope in slopes], dim=2).transpose(0, 1)  # (B, m, C)
    batch, residuals, _ = rows.shape
    if count >= residuals:
        return slopes
    sizes = [slope[0, 0].numel() for slope in slopes]
    weighted = rows * torch.as_tensor(np.repeat(weights, sizes))
    rest = torch.as_tensor(rng.choice([-1.0, 1.0], (batch, residuals, 1)))
    basis = torch.as_tensor(rng.standard_normal((batch, residuals, count - 1)))
    for _ in range(ITERATIONS if count > 1 else 0):
        basis = torch.linalg.qr(weighted @ (weighted.mT @ basis))[0]
    directions = torch.cat([basis, rest - basis @ (basis.mT @ rest)], dim=2)
    made = torch.split((directions.mT @ rows).transpose(0, 1), sizes, dim=2)
    return tuple(part.reshape(count, *slope.shape[1:]) for part, slope in zip(made, slopes, strict=True))
