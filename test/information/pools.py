"""Made-up tosses whose information is known, for the tests of this part."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import ParameterBlock, Rows, TossInformation


def toss(toss_id: str, factor: Rows, **changes: Any) -> TossInformation:
    """A toss of the given factor (R, P), whose rows are taken for the scores of its transitions; P in two blocks."""
    size = factor.shape[1]
    blocks = changes.pop("blocks", None) or blocks_of([("first", (size + 1) // 2), ("second", size // 2)])
    diagonal = np.square(factor).sum(axis=0)
    fields: dict[str, Any] = {
        "toss_id": toss_id,
        "body": "cube",
        "model": "polytope",
        "parameters_version": "theta",
        "estimator": "empirical",
        "influence_bound": np.inf,
        "blocks": blocks,
        "transitions": max(len(factor), 1),
        "not_scored": 0,
        "duration": 1.0,
        "mean_loss": 0.1,
        "block_traces": np.array([diagonal[block.start : block.stop].sum() for block in blocks]),
        "score_sum": factor.sum(axis=0),
        "factor": factor,
        "centroid": np.zeros(3),
    }
    return TossInformation(**(fields | changes))


def blocks_of(sizes: Sequence[tuple[str, int]]) -> tuple[ParameterBlock, ...]:
    """Blocks from names and sizes, none of them empty."""
    sizes = [(name, size) for name, size in sizes if size]
    edges = np.cumsum([0, *(size for _, size in sizes)]).tolist()
    return tuple(ParameterBlock(name, *span) for (name, _), span in zip(sizes, pairwise(edges)))


def tosses(count: int, parameters: int, rows: int, seed: int, spread: float = 1.0) -> list[TossInformation]:
    """Tosses that differ in size, in direction and in number of rows; `spread` is that of the logarithms of their sizes."""
    rng = np.random.default_rng(seed)
    scale = np.exp(rng.normal(0.0, 1.0, parameters))
    made = []
    for index in range(count):
        own_rows = int(rng.integers(1, rows + 1))
        sizes = np.exp(rng.normal(0.0, spread, (own_rows, 1)))
        factor = sizes * rng.standard_normal((own_rows, parameters)) * scale
        made.append(toss(f"toss-{index:04d}", factor, duration=float(rng.uniform(0.5, 2.0))))
    return made


def rescaled(info: TossInformation, scale: Array) -> TossInformation:
    """The same toss in parameters theta' = theta / scale: its scores are multiplied by `scale` (P,)."""
    return toss(info.toss_id, info.factor * scale, duration=info.duration, score_sum=info.score_sum * scale)
