"""The statistics that LeRobot normalises data by: of each feature, over an episode or over all of them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Stats = dict[str, list[float] | list[int]]


def feature_stats(values: NDArray[Any]) -> Stats:
    """Of the frames of one feature.

    Args:
        values: (N,) or (N, D).

    Returns:
        Lists of D numbers by the statistic's name (D is 1 for a scalar); `count` has one number.
    """
    rows = np.asarray(values, dtype=float).reshape(len(values), -1)
    plain = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
    quantiles = dict(zip(QUANTILES, np.quantile(rows, list(QUANTILES.values()), axis=0)))
    found: Stats = {name: value.tolist() for name, value in plain.items()}
    return {**found, "count": [len(rows)], **{name: value.tolist() for name, value in quantiles.items()}}


def dataset_stats(columns: Mapping[str, NDArray[Any]]) -> dict[str, Stats]:
    """Of all features, by their names."""
    return {name: feature_stats(values) for name, values in columns.items()}
