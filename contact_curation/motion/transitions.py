"""Tosses as transitions: pairs of successive frames, in characteristic units, ready to be scored."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.even_stamps import EVEN
from contact_curation.motion.toss import NANOSECONDS, Toss

SAME_PERIOD = 0.01
"""Share by which two estimates of one frame period differ at most."""

MULTIPLE = 0.15
"""Frame periods by which steps, in their mean, differ at most from multiples of it."""


@dataclass(frozen=True, eq=False)
class Transitions:
    """N transitions of K tosses, toss after toss. Lengths in characteristic lengths, time in s.

    A state row is position (3), orientation wxyz (4), linear velocity in the board's frame (3), angular velocity in the body's
    frame (3) (method.md 1.0).

    Attributes:
        toss_ids: K ids.
        before: (N, 13) states.
        after: (N, 13) states one frame later.
        dt: (N,) times between them [s]: frame periods, more of them where frames are missing; as stamped in a toss whose stamps
            are uneven, since those that were wrong have been made even.
        starts: (K + 1,) toss k owns rows starts[k]:starts[k + 1].
    """

    toss_ids: tuple[str, ...]
    before: Array
    after: Array
    dt: Array
    starts: NDArray[np.int64]

    @property
    def toss_index(self) -> NDArray[np.int64]:
        """(N,) which toss a row belongs to."""
        return np.repeat(np.arange(len(self.toss_ids)), np.diff(self.starts))

    @property
    def index_in_toss(self) -> NDArray[np.int64]:
        """(N,) number of a row within its toss."""
        counts = np.diff(self.starts)
        return np.arange(self.starts[-1]) - np.repeat(self.starts[:-1], counts)


def states_of(toss: Toss, length_scale: float) -> Array:
    """States (T, 13) of a toss with lengths divided by `length_scale` [m]."""
    return np.concatenate(
        [
            toss.positions / length_scale,
            toss.orientations_wxyz,
            toss.linear_velocities / length_scale,
            toss.angular_velocities,
        ],
        axis=1,
    )


def usual_period(steps: Array) -> float:
    """The frame period of steps (n,) between frames [s]: their median, or their mean for each frame where that is another.

    A clock of milliseconds counts 120 frames a second in steps of 8, 8 and 9 ms, and two cameras take turns after 6 and 8 ms.
    Longer steps are several frames only if all of them together are multiples of one period: of two cameras that take turns
    after 5 and 8 ms, or at rates of their own, none is missing.
    """
    median, period = float(np.median(steps)), float(steps.mean())
    for usual in (median, float(np.quantile(steps, 0.25))):
        frames = np.maximum(np.rint(steps / usual), 1.0)
        if np.abs(steps / usual - frames).mean() <= MULTIPLE:
            period = float(steps.sum() / frames.sum())
            break
    return median if abs(period - median) <= SAME_PERIOD * median else period


def periods_of(toss: Toss) -> NDArray[np.int64]:
    """(T,) frame periods from the first frame of a toss to each: one more each time, but where frames are missing or uneven."""
    stamped, frames = _stamped(toss)
    if _uneven(toss, stamped, frames):
        return nearest_frames(stamped, toss.frame_period)
    return np.concatenate([[0], np.cumsum(frames)])


def nearest_frames(steps: Array, period: float) -> NDArray[np.int64]:
    """(T,) frame periods to the end of each of T - 1 steps, from 0 on: the nearest whole numbers, perhaps one of them twice."""
    return np.rint(np.concatenate([[0.0], np.cumsum(steps)]) / period).astype(np.int64)


def _steps_of(toss: Toss) -> Array:
    """(T - 1,) times between frames [s]."""
    stamped, frames = _stamped(toss)
    return stamped if _uneven(toss, stamped, frames) else np.asarray(toss.frame_period * frames)


def _stamped(toss: Toss) -> tuple[Array, NDArray[np.int64]]:
    """(T - 1,) steps between frames as stamped [s], and in whole frame periods."""
    stamped = np.diff(toss.stamps_ns) / NANOSECONDS
    return stamped, np.maximum(np.rint(stamped / toss.frame_period), 1.0).astype(np.int64)


def _uneven(toss: Toss, stamped: Array, frames: NDArray[np.int64]) -> bool:
    return bool(np.abs(stamped - toss.frame_period * frames).max(initial=0.0) > EVEN / NANOSECONDS)


def by_differences(data: Transitions) -> Transitions:
    """The transitions with velocities that lead from pose to pose, p' = p + dt v'; the first of a toss is the second, again."""
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(data.before[:, 3:7]), data.after[:, 3:7]))
    rates = np.concatenate([data.after[:, :3] - data.before[:, :3], turns], axis=1) / data.dt[:, np.newaxis]
    earlier = np.arange(len(data.dt)) - (data.index_in_toss > 0)
    before, after = (
        np.concatenate([states[:, :7], each], axis=1) for states, each in ((data.before, rates[earlier]), (data.after, rates))
    )
    return replace(data, before=before, after=after)


def transitions_of(tosses: Sequence[Toss], length_scale: float) -> Transitions:
    """All transitions of `tosses`.

    Args:
        tosses: at least one.
        length_scale: the body's characteristic length [m].

    Raises:
        InvalidValueError: no toss was given.
    """
    if not tosses:
        raise InvalidValueError("tosses", "none", "at least one")
    states = [states_of(toss, length_scale) for toss in tosses]
    counts = [len(rows) - 1 for rows in states]
    return Transitions(
        toss_ids=tuple(toss.toss_id for toss in tosses),
        before=np.concatenate([rows[:-1] for rows in states]),
        after=np.concatenate([rows[1:] for rows in states]),
        dt=np.concatenate([_steps_of(toss) for toss in tosses]),
        starts=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
    )
