"""Motions of the joints as samples, one per control step, made of ramps whose acceleration is bounded and has no jumps.

A ramp accelerates a joint from rest to a speed v (backwards in time: from v to rest). Its acceleration is a trapezoid of height
a that rises within the time r. The ramp lasts T = v/a + r and covers the distance v T / 2. Each joint has its own ramp, and all
ramps end at the release, so every joint covers the shortest possible distance.

A stop stays on the path: time on it slows down until the arm stands still. On the path P(s) it goes by s(t) with
s' = 1 - 3 u^2 + 2 u^3, u = t / T, so that

    q' = P'(s) s'    q'' = P''(s) s'^2 + P'(s) s''

T is the shortest time for which the accelerations stay within the limits. A path that ends at rest can always be stopped so:
the slower time slows down, the more the stop is the path's own end.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array

SHORTEST, LONGER = 0.05, 1.2
"""First stopping time that is tried [s], and the ratio of each to the one before."""

SLOWEST = 50.0
"""Times the rest of the path: a stop this slow is the path itself."""


@dataclass(frozen=True)
class RampConfig:
    """How joints accelerate.

    Attributes:
        acceleration: acceleration of a ramp [rad/s^2].
        rise: time in which the acceleration rises to this value [s].
        moving: largest speed between postures, as a share of a joint's speed limit.
        moving_acceleration: largest acceleration between postures [rad/s^2]; it leaves a reserve for braking in a stop.
    """

    acceleration: float = 9.0
    rise: float = 0.06
    moving: float = 0.8
    moving_acceleration: float = 4.5


DEFAULT_RAMP = RampConfig()


@dataclass(frozen=True, eq=False)
class JointPath:
    """A motion of N samples.

    Attributes:
        positions: (N, J) [rad].
        speeds: (N, J) [rad/s].
        accelerations: (N, J) [rad/s^2].
    """

    positions: Array
    speeds: Array
    accelerations: Array

    def __len__(self) -> int:
        return len(self.positions)

    @staticmethod
    def joined(*parts: "JointPath") -> "JointPath":
        """Joins paths; the last sample of each must be the first of the next, and is kept once."""
        rest = parts[1:]
        return JointPath(
            np.concatenate([parts[0].positions, *(part.positions[1:] for part in rest)]),
            np.concatenate([parts[0].speeds, *(part.speeds[1:] for part in rest)]),
            np.concatenate([parts[0].accelerations, *(part.accelerations[1:] for part in rest)]),
        )

    def after(self, first: int) -> "JointPath":
        """The samples from index `first` on."""
        return JointPath(self.positions[first:], self.speeds[first:], self.accelerations[first:])

    def thinned(self, every: int) -> "JointPath":
        """Every `every`-th sample, and the last one."""
        kept = np.unique(np.append(np.arange(0, len(self), every), len(self) - 1))
        return JointPath(self.positions[kept], self.speeds[kept], self.accelerations[kept])


def ramp_way(speeds: Array, config: RampConfig) -> Array:
    """Distances (...) [rad] in which speeds (...) [rad/s] are reached from rest, with the sign of the speeds."""
    return 0.5 * speeds * _duration(speeds, config)


def speeding_up(posture: Array, speeds: Array, step: float, config: RampConfig) -> JointPath:
    """Path from rest to a posture (J,) [rad] passed with speeds (J,) [rad/s]; its last sample is that posture exactly."""
    backwards = slowing_down(posture, -speeds, step, config)
    return JointPath(backwards.positions[::-1], -backwards.speeds[::-1], backwards.accelerations[::-1])


def slowing_down(posture: Array, speeds: Array, step: float, config: RampConfig) -> JointPath:
    """Path from a posture (J,) [rad] passed with speeds (J,) [rad/s] to rest; its first sample is that posture exactly."""
    durations = _duration(speeds, config)
    count = int(np.ceil(durations.max() / step)) + 1
    times = np.arange(count)[:, None] * step  # (N, 1)
    plateau = np.minimum(config.acceleration, np.abs(speeds) / config.rise) * np.sign(speeds)
    rise, zero = config.rise, np.zeros_like(durations)
    gone = [np.clip(times - start, 0.0, None) for start in (zero, zero + rise, durations - rise, durations)]
    signs = np.array([-1.0, 1.0, 1.0, -1.0])
    slope = plateau / rise  # rate of the acceleration
    accelerations = slope * sum(sign * time for sign, time in zip(signs, gone))
    lost = slope * sum(sign * time**2 / 2.0 for sign, time in zip(signs, gone))
    fallen = slope * sum(sign * time**3 / 6.0 for sign, time in zip(signs, gone))
    return JointPath(posture + speeds * times + fallen, speeds + lost, np.asarray(accelerations))


def moving(start: Array, end: Array, fastest: Array, step: float, config: RampConfig) -> JointPath:
    """Path from rest at one posture (J,) to rest at another, straight in joint space, with a quintic time law.

    Args:
        start: (J,) first posture [rad].
        end: (J,) last posture [rad].
        fastest: (J,) speed limits of the joints [rad/s].
        step: time between samples [s].
        config: shares of speed and acceleration.
    """
    way = end - start
    by_speed = (15.0 / 8.0 * np.abs(way) / (config.moving * fastest)).max()
    by_acceleration = np.sqrt(10.0 / np.sqrt(3.0) * np.abs(way).max() / config.moving_acceleration)
    count = max(int(np.ceil(max(by_speed, by_acceleration) / step)), 2)
    s = np.linspace(0.0, 1.0, count + 1)[:, None]
    total = count * step
    return JointPath(
        start + way * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5),
        way / total * (30.0 * s**2 - 60.0 * s**3 + 30.0 * s**4),
        way / total**2 * (60.0 * s - 180.0 * s**2 + 120.0 * s**3),
    )


def stopped(path: JointPath, at: float, step: float, acceleration: Array) -> JointPath:
    """The way to rest from where a path is at a time.

    Args:
        path: samples every `step`, at rest at its end.
        at: time on it from which on it is slowed down [s].
        step: between samples [s].
        acceleration: (J,) limits [rad/s^2].
    """
    if at <= 0.0:  # it has not begun
        still = np.zeros((2, path.positions.shape[1]))
        return JointPath(np.repeat(path.positions[:1], 2, axis=0), still, still)
    rest = (len(path) - 1) * step - at
    total = SHORTEST
    while True:
        slowed = _slowed(path, at, step, total)
        fits = bool((np.abs(slowed.accelerations) <= acceleration).all())
        if fits or total > SLOWEST * max(rest, step):
            return slowed
        total *= LONGER


def _slowed(path: JointPath, at: float, step: float, total: float) -> JointPath:
    count = max(int(np.ceil(total / step)), 2)
    total = count * step
    u = np.linspace(0.0, 1.0, count + 1)
    on_path = at + total * (u - u**3 + 0.5 * u**4)
    rate, change = 1.0 - 3.0 * u**2 + 2.0 * u**3, (6.0 * u**2 - 6.0 * u) / total
    rows = np.clip(on_path / step, 0.0, len(path) - 1.0)
    first = np.minimum(rows.astype(int), len(path) - 2)
    share = (rows - first)[:, None]
    positions, speeds, accelerations = (
        part[first] + share * (part[first + 1] - part[first]) for part in (path.positions, path.speeds, path.accelerations)
    )
    moving = (rows < len(path) - 1.0)[:, None]
    rate, change = rate[:, None], change[:, None]
    return JointPath(positions, moving * speeds * rate, moving * (accelerations * rate**2 + speeds * change))


def _duration(speeds: Array, config: RampConfig) -> Array:
    return np.maximum(np.abs(speeds) / config.acceleration, config.rise) + config.rise
