"""How far a predicted motion is from the measured one, toss by toss (method.md 1.11).

    position    = 100 / width * mean_t |x_t - xhat_t|               percent of the body's width
    rotation    = mean_t angle(q_t, qhat_t)                         degrees
    penetration = 100 / width * mean_t max(0, -min_i z_i(qhat_t))   percent of the width; z_i: corners of the body as described

The mean is over all frames, the first one, where both are one, included. The angle comes from an arctangent: the published
arcsine is not a number as soon as rounding takes its argument over 1, and loses digits near a half turn.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array


@dataclass(frozen=True, eq=False)
class MotionErrors:
    """Errors of K predicted motions; NaN where a prediction is not finite.

    Attributes:
        position: (K,) mean distance [% of the body's width].
        rotation: (K,) mean angle [deg].
        penetration: (K,) mean depth below the plane z = 0 [% of the body's width].
    """

    position: Array
    rotation: Array
    penetration: Array

    @property
    def finite(self) -> NDArray[np.bool_]:
        """(K,) which predictions were finite to their end."""
        return np.isfinite(self.position)


def body_width(body: Body) -> float:
    """A cube's width, another body's mean extent along its axes [characteristic lengths]."""
    return float(np.ptp(body.scaled_vertices, axis=0).mean())


def motion_errors(predicted: ArrayLike, measured: ArrayLike, starts: ArrayLike, body: Body) -> MotionErrors:
    """The errors of K motions.

    Args:
        predicted: (N, 13) states, all motions one after the other [characteristic lengths, s], e.g. `Rollout.states`.
        measured: (N, 13) likewise.
        starts: (K + 1,) motion k owns rows starts[k]:starts[k + 1], at least one.
        body: as described; its corners say what penetrates, its width what errors are relative to.

    Raises:
        InvalidValueError: shapes that do not fit together.
    """
    ours, theirs = np.asarray(predicted, dtype=float), np.asarray(measured, dtype=float)
    edges = _checked_starts(np.asarray(starts), len(theirs))
    if ours.shape != theirs.shape or ours.ndim != 2 or ours.shape[1] != 13:
        raise InvalidValueError(
            "predicted states", f"shape {ours.shape}", f"that of the measured ones, {theirs.shape}, (N, 13)"
        )
    percent = 100.0 / body_width(body)
    with np.errstate(over="ignore", invalid="ignore"):  # a motion that runs away becomes NaN below
        depths = -Polytope(body.scaled_vertices).corner_heights(ours[:, :3], ours[:, 3:7]).min(axis=-1)
        per_frame = [
            percent * np.linalg.norm(ours[:, :3] - theirs[:, :3], axis=1),
            np.degrees(quaternions.angle_between(theirs[:, 3:7], ours[:, 3:7])),
            percent * np.maximum(0.0, depths),
        ]
        sums = np.add.reduceat(per_frame, edges[:-1], axis=1)  # (3, K)
    means = sums / np.diff(edges)
    whole = np.logical_and.reduceat(np.isfinite(ours).all(axis=1), edges[:-1])
    means[:, ~(whole & np.isfinite(means).all(axis=0))] = np.nan
    return MotionErrors(*means)


def _checked_starts(starts: NDArray[np.int64], rows: int) -> NDArray[np.int64]:
    if starts.ndim != 1 or starts.size < 2 or starts[0] != 0 or starts[-1] != rows or np.any(np.diff(starts) < 1):
        raise InvalidValueError("starts", starts.tolist()[:5], f"0 to {rows}, strictly increasing")
    return starts
