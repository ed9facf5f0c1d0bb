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


def periods_of(toss: Toss) -> NDArray[np.int64]:
    """(T,) frame periods from the first frame of a toss to each; one more each time, but where frames are missing."""
    steps = np.rint(np.diff(toss.stamps_ns) / (NANOSECONDS * toss.frame_period)).astype(np.int64)
    return np.concatenate([[0], np.cumsum(np.maximum(steps, 1))])


def _steps_of(toss: Toss) -> Array:
    """(T - 1,) times between frames [s]."""
    even, stamped = toss.frame_period * np.diff(periods_of(toss)), np.diff(toss.stamps_ns) / NANOSECONDS
    return even if np.abs(stamped - even).max() <= EVEN / NANOSECONDS else stamped


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
