"""Frames that a recording lacks although its stamps are even: they were lost, and the stamps written anew, one period apart.

Poses that are published as a table at a rate often have such places: a step of two or three times the motion at once, most
of them where a tracker lost a body for its speed, at impacts. A body in the air gives its time away:

    x(t) = x_m + v t - g t^2 / 2,   R(t) = R_m exp(w t)        over SIDE before a step, and SIDE behind it

An impact between two flights takes no time, so that both are at one pose when it happens. With n + k periods between the last
frame of one flight and the first of the next, n of them stamped, the distance between both is taken at the moment at which
they are nearest, position and the body's reach times the turn. k frames are lost where that distance is within the noise for k
alone, and clearly not for any other number; and every frame in between lies on one of the flights, at a whole number of
periods. What several impacts in a row, or a sliding body, leave open stays as it is. Where a flight is shorter than SIDE, four
frames of it do that lie on it as exactly as the tracker measures. Where both are so short, gravity shows in neither: the body
may roll on the board from edge to edge, and then both parabolas bend wrongly.
"""

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.pose_noise import RIG_NOISE

SIDE, FEWEST = 0.032, 5
"""[s] So long a part of a flight is looked at on either side, and so many frames at least."""

SHORT, EXACT = 4, 5.0 * RIG_NOISE
"""Frames of a short part of a flight, and its largest misfit [m]: over so few gravity cannot be seen, but the noise can."""

FALLS = 0.4
"""Of gravity: what a parabola through these frames may differ from it; what slides has none."""

BETWEEN = 3
"""Frames that belong to no flight, at most, between two."""

MOST = 8
"""Frames lost at once."""

FLIES, LEAVES, MEETS = 12.0 * RIG_NOISE, 6.0, 27.0 * RIG_NOISE
"""[m] Largest misfit of a flight (rms); times it, that of a frame that is of it no more; largest distance of two that meet."""

CLEARLY = 4.0
"""Times what was found: the distance for every other number of lost frames; and at least `MEETS`."""

BENDS = 3.0
"""Times what gravity bends a path in a period: that distance, too, where gravity shows in no flight."""

SLOWEST = 45.0 * RIG_NOISE
"""[m] A body that moves less in a period gives no time away."""

MOMENTS = 50
"""In a period, at which the distance is taken."""

AT_ONCE = 1024
"""Steps whose flights are fitted together: as many as memory for is never felt."""


class _Flight(NamedTuple):
    """Through some frames: pose, and motion in a period, at one of them; times are in periods from there."""

    position: Array
    velocity: Array
    orientation_wxyz: Array
    turn: Array
    fall: Array
    misfit: float
    seen_to_fall: bool

    def at(self, times: Array) -> tuple[Array, Array]:
        """Positions (N, 3) and orientations (N, 4)."""
        times = times[:, np.newaxis]
        turned = quaternions.multiply(self.orientation_wxyz, quaternions.exp(self.turn * times))
        return self.position + self.velocity * times + 0.5 * self.fall * times**2, turned


def lost_frames(positions: Array, orientations_wxyz: Array, period: float, reach: float, gravity: float) -> NDArray[np.int64]:
    """(T - 1,) how many frames are lost in each step for certain; 0 where none is, or nobody can tell.

    Args:
        positions: (T, 3) of the body's centre of mass, z up [m].
        orientations_wxyz: (T, 4).
        period: between frames [s].
        reach: distance of the body's farthest vertex from the centre of mass [m].
        gravity: [m/s^2].
    """
    side = max(round(SIDE / period), FEWEST) if period > 0.0 else len(positions)
    poses = _Poses(positions, orientations_wxyz, reach, np.array([0.0, 0.0, -gravity * period**2]), side)
    lost, told = np.zeros(max(len(positions) - 1, 0), dtype=np.int64), 0
    if len(positions) < 2 * SHORT:
        return lost
    steps = np.flatnonzero(poses.kinks() > 0.5 * SLOWEST) + 1
    steps = steps[(steps >= SHORT - 1) & (steps < len(positions) - SHORT)]
    for block in np.split(steps, range(AT_ONCE, len(steps), AT_ONCE)):
        ending = poses.flights(block, backwards=True)
        beginning = poses.flights(np.unique(block[:, np.newaxis] + 1 + np.arange(BETWEEN + 1)), backwards=False)
        for last in sorted(ending):
            if last >= told:
                found = poses.junction(last, ending[last], beginning)
                lost[last : last + len(found)] = found
                told = last + len(found)
    return lost


@cache
def _least_squares(count: int, first: int) -> tuple[Array, Array]:
    """(2, count) to the line and (count,) to the second derivative of the parabola through values at `first`, `first` + 1..."""
    times = np.arange(first, first + count, dtype=float)
    return np.linalg.pinv(np.stack([np.ones(count), times], axis=1)), 2.0 * np.linalg.pinv(np.vander(times, 3))[0]


class _Poses(NamedTuple):
    """T poses in steps of one period."""

    positions: Array
    orientations_wxyz: Array
    reach: float
    fall: Array
    side: int

    def kinks(self) -> Array:
        """(T - 2,) how far each inner frame's next one is from where the last two lead [m]."""
        turns = quaternions.multiply(quaternions.conjugate(self.orientations_wxyz[:-1]), self.orientations_wxyz[1:])
        steps = np.hstack([np.diff(self.positions, axis=0), self.reach * quaternions.log(turns)])
        return np.asarray(np.linalg.norm(np.diff(steps, axis=0) - np.concatenate([self.fall, np.zeros(3)]), axis=1))

    def flights(self, anchors: NDArray[np.int64], backwards: bool) -> dict[int, _Flight]:
        """Of frames at which a flight begins (backwards: ends), its longer part, else the short one; no others are in it."""
        flights: dict[int, _Flight] = {}
        for count, most in ((self.side, FLIES), (SHORT, EXACT)):
            first = 1 - count if backwards else 0
            whole = (anchors + first >= 0) & (anchors + first + count <= len(self.positions))
            left = np.array([anchor for anchor in anchors[whole].tolist() if anchor not in flights], dtype=np.int64)
            flights |= self._fitted(left, first, count, most)
        return flights

    def _fitted(self, anchors: NDArray[np.int64], first: int, count: int, most: float) -> dict[int, _Flight]:
        """Those through `count` frames, from the `first`-th after each anchor on, that fly with a misfit of `most`."""
        times = np.arange(first, first + count)
        frames = anchors[:, np.newaxis] + times
        positions, own = self.positions[frames], self.orientations_wxyz[anchors]
        turns = quaternions.log(quaternions.multiply(quaternions.conjugate(own)[:, np.newaxis], self.orientations_wxyz[frames]))
        rows = np.concatenate([positions - 0.5 * np.outer(times**2, self.fall), turns], axis=2)
        line, bends = _least_squares(count, first)
        lines = line @ rows
        off = rows - (lines[:, :1] + times[:, np.newaxis] * lines[:, 1:])
        off[..., 3:] *= self.reach
        misfits, long = np.sqrt((off**2).mean(axis=(1, 2))), count > SHORT
        flies = misfits <= most
        if long:
            flies &= np.abs(positions[..., 2] @ bends - self.fall[2]) <= FALLS * abs(self.fall[2])
        turned = quaternions.multiply(own, quaternions.exp(lines[:, 0, 3:]))
        return {
            int(anchors[i]): _Flight(
                lines[i, 0, :3], lines[i, 1, :3], turned[i], lines[i, 1, 3:], self.fall, float(misfits[i]), long
            )
            for i in np.flatnonzero(flies).tolist()
        }

    def distances(self, frame: int, flight: _Flight, times: Array) -> Array:
        """(N,) of a frame from a flight at some times."""
        return np.linalg.norm(self._apart(*flight.at(times), self.positions[frame], self.orientations_wxyz[frame]), axis=1)

    def _apart(self, positions: Array, orientations: Array, others: Array, other_orientations: Array) -> Array:
        turns = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations), other_orientations))
        return np.hstack([positions - others, self.reach * turns])

    def junction(self, last: int, before: _Flight, beginning: dict[int, _Flight]) -> list[int]:
        """Frames lost in the steps from frame `last`, where a flight ends, to where the next begins; empty if none is told."""
        if np.linalg.norm(np.append(before.velocity, self.reach * before.turn)) < SLOWEST:
            return []
        if self.distances(last + 1, before, np.ones(1))[0] < LEAVES * max(before.misfit, RIG_NOISE):
            return []
        for first in range(last + 1, last + 2 + BETWEEN):
            if first in beginning:
                return self._lost_between(last, before, first, beginning[first])
        return []

    def _lost_between(self, last: int, before: _Flight, first: int, after: _Flight) -> list[int]:
        if self._meeting(before, after, first - last)[0] <= MEETS:
            return [0] * (first - last)  # as it is where frames are lost, or nobody can tell: most impacts end here
        spans = first - last + np.arange(MOST + 1)
        nearest = [self._meeting(before, after, int(span)) for span in spans]
        distances = np.array([distance for distance, _ in nearest])
        lost = int(distances.argmin())
        others = np.delete(distances, lost).min()
        bent = 0.0 if before.seen_to_fall or after.seen_to_fall else BENDS * abs(self.fall[2])
        if distances[lost] > MEETS or others < max(CLEARLY * distances[lost], MEETS, bent):
            return []
        times, span, moment = [0], int(spans[lost]), nearest[lost][1]
        whole = np.arange(1.0, span)
        for frame in range(last + 1, first):
            of_one, of_other = self.distances(frame, before, whole), self.distances(frame, after, whole - span)
            off = np.where(whole < moment, of_one, of_other)
            at = int(off.argmin())
            if off[at] > 2.0 * MEETS or whole[at] <= times[-1]:
                return []
            times.append(int(whole[at]))
        return [later - earlier - 1 for earlier, later in pairwise([*times, span])]

    def _meeting(self, before: _Flight, after: _Flight, span: int) -> tuple[float, float]:
        """Least distance of two flights `span` periods apart, and when [periods]."""
        times = np.linspace(0.0, span, MOMENTS * span + 1)
        apart = self._apart(*before.at(times), *after.at(times - span))
        steps = np.diff(apart, axis=0)
        shares = -(apart[:-1] * steps).sum(axis=1) / np.maximum((steps**2).sum(axis=1), 1e-30)
        on_steps = apart[:-1] + np.clip(shares, 0.0, 1.0)[:, np.newaxis] * steps
        distances = np.linalg.norm(on_steps, axis=1)
        return float(distances.min()), float(times[distances.argmin()])
