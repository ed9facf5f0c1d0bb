"""The record of a scored toss: everything that ranking needs, in a few kB."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

Rows = NDArray[np.floating[Any]]
"""Rows of a factor, as narrow as they are kept."""


@dataclass(frozen=True)
class ParameterBlock:
    """A named run of parameters: columns start to stop of a factor.

    The weights of a network are too many; columns of a block whose name ends with "network" are those of a sketch, in which
    inner products are nearly what they are in the weights (`network_sketch`).
    """

    name: str
    start: int
    stop: int

    @property
    def sketched(self) -> bool:
        """Whether its columns are no parameters but a sketch of them."""
        return self.name.endswith("network")


@dataclass(frozen=True, eq=False, slots=True)
class TossInformation:
    """The information one toss carries about the parameters theta, at one theta.

    Attributes:
        toss_id: the toss.
        body: its body's name.
        model: what theta parameterises, e.g. "polytope".
        parameters_version: which theta (a digest); ranks of different versions are never mixed.
        estimator: "empirical" or "gauss-newton".
        influence_bound: losses above this are scaled down to it; inf when unbounded.
        blocks: names of the parameter runs, covering 0..P.
        transitions: how many there are.
        not_scored: how many of them the solver could not certify.
        duration: [s].
        mean_loss: mean loss of the scored transitions (method.md 1.2), characteristic units.
        block_traces: (blocks,) exact trace of the Fisher sum, per block.
        score_sum: (P,) sum of the scores g_t.
        factor: (R, P) W with F = W^T W the Fisher sum, up to truncation at R rows; float32 as `scoring` makes it, and float64
            wherever it is computed with.
        centroid: (3,) mean position, characteristic lengths.
        tilt_axes: (2, 3) directions in which block "tilt" moves the ground's normal, the pivot being the centroid;
            (0, 3) where the model has no tilt and height.
    """

    toss_id: str
    body: str
    model: str
    parameters_version: str
    estimator: str
    influence_bound: float
    blocks: tuple[ParameterBlock, ...]
    transitions: int
    not_scored: int
    duration: float
    mean_loss: float
    block_traces: Array
    score_sum: Array
    factor: Rows
    centroid: Array
    tilt_axes: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        size = self.blocks[-1].stop if self.blocks else 0
        shapes = {"block_traces": (len(self.blocks),), "score_sum": (size,), "centroid": (3,)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise InvalidValueError(f"{name} of toss {self.toss_id}", f"shape {getattr(self, name).shape}", f"{shape}")
        if self.factor.ndim != 2 or self.factor.shape[1] != size:
            raise InvalidValueError(f"factor of toss {self.toss_id}", f"shape {self.factor.shape}", f"(R, {size})")
        if self.tilt_axes.shape not in ((0, 3), (2, 3)):
            raise InvalidValueError(f"tilt_axes of toss {self.toss_id}", f"shape {self.tilt_axes.shape}", "(2, 3) or (0, 3)")
        for name in (*shapes, "factor", "tilt_axes", "duration"):
            if not np.isfinite(getattr(self, name)).all():
                raise InvalidValueError(f"{name} of toss {self.toss_id}", "a value that is not finite", "finite numbers")

    @property
    def parameters(self) -> int:
        """P."""
        return self.blocks[-1].stop

    @property
    def trace(self) -> float:
        """Exact trace of the Fisher sum."""
        return float(self.block_traces.sum())

    def in_words(self) -> str:
        """One line about the toss, for logs."""
        scored = self.transitions - self.not_scored
        size = f"trace {self.trace:.4g}, loss {self.mean_loss:.3g}"
        return f"scored {self.toss_id}: {size}, {scored} of {self.transitions} transitions"

    def fisher(self) -> Array:
        """(P, P) Fisher sum, up to the factor's truncation."""
        rows = np.asarray(self.factor, dtype=float)
        return np.asarray(rows.T @ rows)
