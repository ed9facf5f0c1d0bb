"""Motions of the joints as samples, one per control step, made of ramps whose acceleration is bounded and has no jumps.

A ramp accelerates a joint from rest to a speed v (backwards in time: from v to rest). Its acceleration is a trapezoid of height
a that rises within the time r. The ramp lasts T = v/a + r and covers the distance v T / 2. Each joint has its own ramp, and all
ramps end at the release, so every joint covers the shortest possible distance.
"""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.quaternions import Array


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


def _duration(speeds: Array, config: RampConfig) -> Array:
    return np.maximum(np.abs(speeds) / config.acceleration, config.rise) + config.rise
