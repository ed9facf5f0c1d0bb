"""The moment in which a tracked body leaves a gripper and begins to fall freely, and its state then.

While it is held, the body moves as the hand was planned to, but not exactly:

    h(t) = P(t) + c + u s + a s^2 / 2,    s = t - t_expected

with the planned path P and small errors c, u, a of place, velocity and acceleration, which have Gaussian priors. From the
beginning f of the fall on it is a projectile that goes on from there:

    p(t) = h(f) + h'(f) (t - f) + g (t - f)^2 / 2,    t >= f

For a given f the model is linear in (c, u, a). So f is found on the profile of the robust squared error (Huber's loss, with the
scale of the tracker's noise), and its uncertainty from the profile's curvature. Orientation and angular velocity at f are those
of the torque-free motion that fits the flight.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from contact_curation.configs import check_positive
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

SMALLEST_NOISE = 1e-5
"""[m]: poses of a simulation are not taken for exact."""

HUBER = 2.0
"""Residuals beyond so many standard deviations count linearly."""

REWEIGHTINGS = 3
COARSE, FINE = 0.006, 0.001
"""Steps in which the profile is searched [s]."""

TURNINGS = 6
"""Iterations of the fit of orientations."""

TURN_STEP = 0.008
"""Step in which torque-free rotations are integrated [s]."""


@dataclass(frozen=True)
class ReleaseConfig:
    """How the beginning of a fall is looked for.

    Attributes:
        held_span: poses of the held body so long before the command to open take part [s].
        latest: a fall is expected within this time after that command [s].
        flight_span: poses so long after the beginning of the fall take part, as long as the body is in the air [s].
        fewest_frames: smallest number of frames of the held body, and of the flight.
        clearance: a body whose lowest vertex is nearer to the board may have hit it [m].
        place_error: standard deviation of the held body's place error [m].
        velocity_error: standard deviation of the held body's velocity error [m/s].
        acceleration_error: standard deviation of the held body's acceleration error [m/s^2].
        significance: difference of log-likelihoods by which a fall has to explain the poses better than a held body.
    """

    held_span: float = 0.1
    latest: float = 0.25
    flight_span: float = 0.15
    fewest_frames: int = 6
    clearance: float = 0.004
    place_error: float = 0.02
    velocity_error: float = 0.1
    acceleration_error: float = 0.7
    significance: float = 25.0

    def __post_init__(self) -> None:
        check_positive(self, self.__dataclass_fields__, "release.")


DEFAULT_RELEASE = ReleaseConfig()


@dataclass(frozen=True, eq=False)
class Track:
    """What a tracker saw of a body on the board, in order of time.

    Attributes:
        times: (N,) [s].
        positions: (N, 3) [m].
        orientations_wxyz: (N, 4).
    """

    times: Array
    positions: Array
    orientations_wxyz: Array


@dataclass(frozen=True, eq=False)
class HandPath:
    """Where the body is planned to be while it is held, and would be if it were never released.

    Attributes:
        times: (M,) [s], evenly spaced or not; before and behind the arm stands still.
        positions: (M, 3) [m] on the board.
    """

    times: Array
    positions: Array
    _spline: CubicSpline = field(init=False, repr=False)
    _slope: PPoly = field(init=False, repr=False)

    def __post_init__(self) -> None:
        spline = CubicSpline(self.times, self.positions, bc_type="clamped")
        object.__setattr__(self, "_spline", spline)
        object.__setattr__(self, "_slope", spline.derivative())

    def at(self, times: Array) -> tuple[Array, Array]:
        """Places (N, 3) [m] and velocities (N, 3) [m/s]."""
        inside = np.clip(times, self.times[0], self.times[-1])
        return np.asarray(self._spline(inside)), np.where((times == inside)[:, None], self._slope(inside), 0.0)


class BodyShape(NamedTuple):
    """What a falling body is.

    Attributes:
        vertices: (V, 3) [m].
        inertia: (3, 3), in any unit.
        gravity: [m/s^2].
    """

    vertices: Array
    inertia: Array
    gravity: float


class Fall(NamedTuple):
    """The beginning of a free fall.

    Attributes:
        time: when [s].
        time_sd: its standard deviation [s].
        state: (13,) of the body then: position, orientation wxyz, velocity on the board, angular velocity in its own frame.
    """

    time: float
    time_sd: float
    state: Array


def find_fall(track: Track, hand: HandPath, opened: float, expected: float, body: BodyShape,
              config: ReleaseConfig = DEFAULT_RELEASE) -> Fall | str:  # fmt: skip
    """Finds when a tracked body began to fall.

    Args:
        track: its poses from before the command to open to the landing or later.
        hand: planned motion of the held body, on the same clock, as late as the arm was.
        opened: when the gripper was told to open: the body is held until then [s].
        expected: when the fall is expected [s].
        body: what falls.
        config: how to look.

    Returns:
        The beginning of the fall, or in one line why none was found.
    """
    until = _first_contact(track, opened, body, config)
    seen = (track.times >= opened - config.held_span) & (track.times < until)
    times, positions = track.times[seen], track.positions[seen]
    for part, count in (("held body", (times <= opened).sum()), ("flight", (times > opened).sum())):
        if count < config.fewest_frames:
            return f"the tracker saw {count} frames of the {part}, expected at least {config.fewest_frames}"
    profile = _Profile(times, positions, hand, expected, body.gravity, config)
    found = profile.best(opened, min(opened + config.latest, float(times[-config.fewest_frames])))
    if isinstance(found, str):
        return found
    time, time_sd, place, velocity = found
    flying = seen & (track.times >= time) & (track.times <= time + config.flight_span)
    turn = _turning(track.times[flying] - time, track.orientations_wxyz[flying], body.inertia)
    return Fall(time, time_sd, np.concatenate([place, turn[0], velocity, turn[1]]))


def _noise(positions: Array) -> float:
    """Standard deviation of the tracker's white noise per axis, from third differences [m]."""
    thirds = np.diff(positions, n=3, axis=0)
    return max(1.4826 * float(np.median(np.abs(thirds - np.median(thirds, axis=0)))) / float(np.sqrt(20.0)), SMALLEST_NOISE)


def _first_contact(track: Track, opened: float, body: BodyShape, config: ReleaseConfig) -> float:
    """From when on the body may have touched the board."""
    heights = track.positions[:, 2] + quaternions.rotate(
        track.orientations_wxyz[:, None], body.vertices[None]
    )[:, :, 2].min(axis=1)  # fmt: skip
    low = np.flatnonzero((track.times > opened) & (heights < config.clearance))
    return float(track.times[low[0]]) if len(low) else np.inf


class _Profile:
    """The robust error of the model as a function of when the fall begins."""

    def __init__(self, times: Array, positions: Array, hand: HandPath, expected: float, gravity: float,
                 config: ReleaseConfig) -> None:  # fmt: skip
        self._times, self._positions, self._hand = times, positions, hand
        self._expected, self._config = expected, config
        self._gravity = np.array([0.0, 0.0, -gravity])
        self._noise = _noise(positions)
        self._priors = np.array([config.place_error, config.velocity_error, config.acceleration_error])

    def best(self, earliest: float, latest: float) -> tuple[float, float, Array, Array] | str:
        """When the fall begins, its standard deviation, and place and velocity then; or why there is none."""
        coarse = np.arange(earliest, max(latest, earliest + 2.0 * COARSE), COARSE)
        middle = float(coarse[int(np.argmin([self._fit(begin)[0] for begin in coarse]))])
        grid = middle + np.arange(-COARSE, COARSE + 1e-9, FINE)
        costs = np.array([self._fit(begin)[0] for begin in grid])
        at = int(costs.argmin())
        if grid[at] <= earliest:
            return "no fall found: the body fell before the gripper was told to open"
        if grid[at] >= latest:
            return f"no fall found within {latest - earliest:.2f} s after the gripper's command"
        gain = self._fit(np.inf)[0] - costs[at]
        if gain < 2.0 * self._config.significance:
            return "no fall found: the body moved as if it were still held; did the gripper open?"
        near = slice(max(at - 3, 0), at + 4)
        curve = np.polyfit(grid[near] - grid[at], costs[near], 2)
        step = float(np.clip(-0.5 * curve[1] / curve[0], -FINE, FINE)) if curve[0] > 0.0 else 0.0
        begin = float(grid[at]) + step
        cost, place, velocity = self._fit(begin)
        excess = max(cost / max(3 * len(self._times) - 10, 1), 1.0)  # the noise may be larger than third differences say
        deviation = np.sqrt(excess / curve[0]) if curve[0] > 0.0 else 0.001
        return begin, float(max(deviation, 1e-4)), place, velocity

    def _fit(self, begin: float) -> tuple[float, Array, Array]:
        """The error for a beginning, and the body's place and velocity then."""
        held = np.minimum(self._times, begin)
        flown = (self._times - held)[:, None]
        places, velocities = self._hand.at(held)
        known = places + velocities * flown + 0.5 * self._gravity * flown**2
        s = held[:, None] - self._expected
        design = np.hstack([np.ones_like(s), s + flown, 0.5 * s**2 + s * flown])  # (N, 3), the same for each axis
        rest = (self._positions - known) / self._noise
        scaled = design / self._noise
        weights, prior, knee = np.ones_like(s), np.diag(1.0 / self._priors**2), HUBER * np.sqrt(3.0)
        for _ in range(REWEIGHTINGS):
            weighted = weights * scaled
            unknown = np.linalg.solve(weighted.T @ scaled + prior, weighted.T @ rest)  # (3, 3): c, u, a as rows
            size = np.linalg.norm(rest - scaled @ unknown, axis=1)
            weights = (knee / np.maximum(size, knee))[:, None]
        cost = np.where(size <= knee, size**2, 2.0 * knee * size - knee**2).sum()
        cost += ((unknown / self._priors[:, None]) ** 2).sum()
        if not np.isfinite(begin):
            return float(cost), self._positions[-1], np.zeros(3)
        place, velocity = (part[0] for part in self._hand.at(np.array([begin])))
        s_begin = begin - self._expected
        return (
            float(cost),
            place + unknown[0] + unknown[1] * s_begin + 0.5 * unknown[2] * s_begin**2,
            velocity + unknown[1] + unknown[2] * s_begin,
        )


def _turning(times: Array, orientations_wxyz: Array, inertia: Array) -> tuple[Array, Array]:
    """Orientation (4,) and angular velocity (3,) in the body's frame at time 0 of the torque-free motion through orientations.

    Errors of both, turned into the frame at time 0, grow as a + b t; exactly so for a body that turns evenly.
    """
    last = min(len(times) - 1, 5)
    between = quaternions.multiply(quaternions.conjugate(orientations_wxyz[0]), orientations_wxyz[last])
    spin = quaternions.log(between) / (times[last] - times[0])
    start = quaternions.multiply(orientations_wxyz[0], quaternions.exp(-times[0] * spin))
    design = np.stack([np.ones_like(times), times], axis=1)
    for _ in range(TURNINGS):
        turned = _torque_free(start, spin, times, inertia)
        off = quaternions.multiply(orientations_wxyz, quaternions.conjugate(turned))  # on the board
        errors = quaternions.rotate(quaternions.conjugate(start), quaternions.log(off))  # (N, 3)
        size = np.linalg.norm(errors - np.median(errors, axis=0), axis=1)
        knee = max(2.0 * float(np.median(size)), 1e-6)
        weighted = design * (knee / np.maximum(size, knee))[:, None]
        place, rate = np.linalg.solve(weighted.T @ design, weighted.T @ errors)
        start, spin = quaternions.multiply(start, quaternions.exp(place)), spin + rate
    return start, spin


def _torque_free(start: Array, spin: Array, times: Array, inertia: Array) -> Array:
    """Orientations (N, 4) at increasing times of a free body that starts at time 0; midpoint rule on Euler's equations."""
    inverse = np.linalg.inv(inertia)

    def change(rate: Array) -> Array:
        (x, y, z), (a, b, c) = inertia @ rate, rate
        return np.asarray(inverse @ np.array([c * y - b * z, a * z - c * x, b * x - a * y]))

    turned, now, found = start, 0.0, []
    for time in times:
        steps = max(int(np.ceil((time - now) / TURN_STEP)), 1)
        step = (time - now) / steps
        for _ in range(steps):
            middle = spin + 0.5 * step * change(spin)
            turned = quaternions.multiply(turned, quaternions.exp(step * middle))
            spin = spin + step * change(middle)
        now = float(time)
        found.append(turned)
    return np.array(found)
