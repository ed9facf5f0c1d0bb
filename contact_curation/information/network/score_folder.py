"""Exact toss scores of networks, kept in files until the pool is complete, and their inner products (method.md 2.7).

A toss's score s = sum_t g_t has as many numbers as the networks have weights, too many for a record. But all that a selection
asks of the scores is their Gram matrix, and any vectors with the same Gram matrix answer the same.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.quaternions import Array

CHUNK = 64
"""Scores in memory at a time, twice."""

Scores = NDArray[np.float32]


@dataclass(frozen=True)
class ScoreFolder:
    """Scores in single precision, a file each.

    Attributes:
        folder: an existing folder of its own.
    """

    folder: Path

    def write(self, digest: str, version: str, score: Scores) -> None:
        """Keeps the score (P,) of the toss with this digest at a version of theta."""
        np.save(self._path(digest, version), score)

    def gram(self, digests: Sequence[str], version: str) -> Array:
        """(K, K) inner products of the scores of tosses that were written."""
        pieces = [list(digests[first : first + CHUNK]) for first in range(0, len(digests), CHUNK)]
        found = np.empty((len(digests), len(digests)))
        for i, piece in enumerate(pieces):
            rows = self._read(piece, version)
            for j, other in enumerate(pieces[: i + 1]):
                products = rows @ (rows if j == i else self._read(other, version)).T
                here, there = (slice(k * CHUNK, k * CHUNK + len(part)) for k, part in ((i, piece), (j, other)))
                found[here, there], found[there, here] = products, products.T
        return found

    def _read(self, digests: Sequence[str], version: str) -> Scores:
        return np.stack([np.load(self._path(digest, version), allow_pickle=False) for digest in digests])

    def _path(self, digest: str, version: str) -> Path:
        return self.folder / f"{version}-{digest}.npy"


def coordinates_of(gram: Array) -> Array:
    """Vectors (K, K) with a given Gram matrix (K, K), up to its rounding."""
    values, vectors = np.linalg.eigh(0.5 * (gram + gram.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
