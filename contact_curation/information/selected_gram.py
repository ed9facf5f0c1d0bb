"""What the Gram matrix of the kept tosses' scores says of them (METHOD 2.7).

The information of k tosses, by their summed scores S (k, P), is S^T S; its non-zero eigenvalues are those of the Gram matrix
S S^T, exactly, however many weights a network has. The effective rank is exp of the entropy of their shares (Roy and Vetterli
2007): k if all tosses say as much in directions of their own, 1 if all say the same.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array

ROUNDING = float(np.finfo(np.float32).eps)
"""Scores of networks are kept in single precision."""


@dataclass(frozen=True)
class KeptGram:
    """The non-zero eigenvalues of a kept set's Gram matrix.

    Attributes:
        smallest: of those above rounding; 0 where there is none.
        largest: of all.
        rank: how many are above rounding.
        effective_rank: see above; 0 where all scores are zero.
    """

    smallest: float
    largest: float
    rank: int
    effective_rank: float


def kept_gram(scores: Array) -> KeptGram:
    """The eigenvalues for scores (k, P) of k >= 1 kept tosses, or any vectors with the same inner products."""
    values = np.linalg.eigvalsh(scores @ scores.T)
    told = values[values > len(values) * ROUNDING * values[-1]]
    if not told.size:
        return KeptGram(0.0, 0.0, 0, 0.0)
    shares = told / told.sum()
    return KeptGram(float(told[0]), float(told[-1]), told.size, float(np.exp(-(shares * np.log(shares)).sum())))
