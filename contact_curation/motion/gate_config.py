"""The bounds of the quality checks. They follow from the body and its tracker; a user may set any of them in SI units.

The numbers are those of method.md 2.1 for ContactNets' cube at its rig's rate and noise, where nothing of all 570 public tosses
reaches them. Lengths go with the body's size and are at least `LENGTH_NOISE` times the noise of a vertex; bounds on velocities
and accelerations are what noise makes of them; spins that contacts give go with the body's own levers (`scales`).
"""

from dataclasses import dataclass, fields
from math import radians, sqrt

import numpy as np

from contact_curation.configs import check_positive, ranged
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.pose_noise import LOUD, RIG_NOISE, RIG_TURN, TrackerScale
from contact_curation.motion.scales import BodyScale
from contact_curation.motion.smoothing import QUIET_PERIOD

LENGTH_NOISE, VELOCITY_NOISE, TURN_NOISE = 10.0, 8.0, 8.0
"""So many standard deviations of poses no bound may be under: of lengths, of velocities (over a frame period), of turns."""

AIRBORNE_NOISE = 11.0
"""Standard deviations of a position: noise changes a displacement in the air by more from frame to frame in 1 of 100,000.

The velocity that gravity changes leaves the median of three nothing to do, so the vertical one is a second difference (a
standard deviation of sqrt(6)); in the horizontal ones the median leaves 1.07. The acceleration is this over the squared period.
"""

FRICTION_MARGIN = 1.5
"""A body's friction is what somebody took it for."""


def airborne_noise(tracker: TrackerScale) -> float:
    """How much noise, up to `LOUD` times what is told, may change a displacement in the air from frame to frame [m]."""
    return AIRBORNE_NOISE * LOUD * RIG_NOISE * tracker.position


@dataclass(frozen=True)
class GateConfig:
    """Bounds of the quality checks that a user sets; None derives one from the body and its tracker.

    `size` is half the width of a cube with the same spread of vertices (`motion.scales`), g gravity. In brackets stands the
    derived bound of ContactNets' cube.

    Bounds on velocities hold up to 150 frames a second for the noise of ContactNets' rig; with more of either they grow, those
    on accelerations with the square of the rate. Velocities that are not filtered (smoothing.py) count as 1.6 times as noisy.

    Attributes:
        enabled: whether gates are applied; if not, every toss passes.
        gravity: gravitational acceleration [m/s^2]; by default the body's.
        largest_friction: friction coefficient of the cone; by default 1.5 times the body's, at least 0.5 [0.5].
        impulse_tolerance: tolerance of impulses outside the friction cone [m/s]; by default 0.219 sqrt(size g) [0.157].
        airborne_clearance: height over which all vertices of a body in the air are [m]; by default 0.191 size [0.010].
        airborne_acceleration: largest acceleration in the air beside gravity [m/s^2]; by default 0.6 g, or what the tracker's
            noise can make at its rate, if that is more [5.89; 8.5 at 148 frames a second].
        airborne_spin_change: largest change of angular velocity between frames in the air, beside free rotation [rad/s]; by
            default 2.
        twist_leverage: factor on the levers of the body, larger than 1 where its inertia is not well known.
        twist_tolerance: tolerance of changes of angular velocity that no contact impulse explains [rad/s]; by default 2, or
            more for a noisy tracker of a small body [2].
        energy_tolerance: tolerance of a gain of energy per mass [m^2/s^2]; by default the larger of 0.1 and 0.04 m/s times the
            speed.
        jump_velocity: largest difference of the velocity from the displacement over time [m/s]; by default 0.4, which is 3 mm
            from frame to frame at 148 Hz.
        jump_spin: largest difference of the angular velocity from the rotation over time, about any axis [rad/s]; by default
            what an impulse at a vertex gives that changes the velocity by 0.74 m/s [25].
        depth: largest depth of the lowest vertex under the board in any frame [m]; by default 0.15 size [0.0079].
        rest_tilt: largest tilt of the face on which the body comes to rest [rad]; by default 0.024 (1.4 degrees).
        rest_height: largest distance from the board of the face on which the body comes to rest [m]; by default 0.0573 size
            [0.003].
        resting_speed: largest speed over the last frames of a body at rest [m/s]; by default 0.05.
        resting_spin: largest angular speed over the last frames of a body at rest [rad/s]; by default 0.5.
        quaternion_tolerance: largest deviation of a quaternion's norm from 1.
        largest_gap: longest time between frames, in frame periods; at least `segmenter.largest_gap`.
    """

    enabled: bool = True
    gravity: float | None = ranged(None, 0.0, 100.0)
    largest_friction: float | None = ranged(None, 0.0, 100.0)
    impulse_tolerance: float | None = ranged(None, 0.0, 100.0)
    airborne_clearance: float | None = ranged(None, 0.0, 10.0)
    airborne_acceleration: float | None = ranged(None, 0.0, 1e5)
    airborne_spin_change: float | None = ranged(None, 0.0, 1e4)
    twist_leverage: float = ranged(1.0, 0.0, 1e3)
    twist_tolerance: float | None = ranged(None, 0.0, 1e4)
    energy_tolerance: float | None = ranged(None, 0.0, 1e4)
    jump_velocity: float | None = ranged(None, 0.0, 100.0)
    jump_spin: float | None = ranged(None, 0.0, 1e4)
    depth: float | None = ranged(None, 0.0, 10.0)
    rest_tilt: float | None = ranged(None, 0.0, 1.6)
    rest_height: float | None = ranged(None, 0.0, 10.0)
    resting_speed: float | None = ranged(None, 0.0, 100.0)
    resting_spin: float | None = ranged(None, 0.0, 1e4)
    quaternion_tolerance: float = ranged(1e-4, 0.0, 0.1)
    largest_gap: float = ranged(1.5, 1.0, 1e3)

    def __post_init__(self) -> None:
        given = (each.name for each in fields(self) if each.name != "enabled" and getattr(self, each.name) is not None)
        check_positive(self, given, infinite=True)

    def bounds(self, body: BodyScale, tracker: TrackerScale) -> "GateBounds":
        """The bounds for a body and its tracker."""
        vertex = LENGTH_NOISE * tracker.at(body.reach)
        gravity = self.gravity or body.gravity
        friction = self.largest_friction or max(0.5, FRICTION_MARGIN * body.friction)
        pushed = VELOCITY_NOISE * RIG_NOISE / QUIET_PERIOD * sqrt(1.0 + friction**2)
        return GateBounds(
            gravity=gravity,
            largest_friction=friction,
            impulse_tolerance=self.impulse_tolerance or 0.21925646 * sqrt(gravity * body.size),
            airborne_clearance=self.airborne_clearance or max(0.010 / 0.0524 * body.size, vertex),
            airborne_acceleration=self.airborne_acceleration or 0.6 * gravity,
            airborne_noise=0.0 if self.airborne_acceleration else airborne_noise(tracker),
            airborne_spin_change=self.airborne_spin_change or 2.0,
            levers=self.twist_leverage * body.levers,
            twist_tolerance=self.twist_tolerance or max(2.0, pushed * float(body.levers.max())),
            energy_tolerance=self.energy_tolerance or 0.1,
            energy_speed=0.0 if self.energy_tolerance else 0.04,
            least_impulse=0.0 if self.impulse_tolerance else VELOCITY_NOISE * RIG_NOISE * tracker.position,
            least_jump=0.0 if self.jump_velocity else VELOCITY_NOISE * RIG_NOISE * tracker.position,
            jump_velocity=self.jump_velocity or 0.4,
            jump_spins=np.full(3, self.jump_spin) if self.jump_spin else 0.7385451 * body.levers,
            depth=self.depth or max(0.15 * body.size, vertex),
            rest_tilt=self.rest_tilt or max(radians(1.4), TURN_NOISE * RIG_TURN * tracker.turn),
            rest_height=self.rest_height or max(0.003 / 0.0524 * body.size, vertex),
            resting_speed=(self.resting_speed or 0.05) * tracker.position,
            resting_spin=(self.resting_spin or 0.5) * tracker.turn,
            quaternion_tolerance=self.quaternion_tolerance,
            largest_gap=self.largest_gap,
        )


@dataclass(frozen=True, eq=False)
class GateBounds:
    """The bounds of `GateConfig` for a body and its tracker, every field a number.

    Attributes:
        levers: (3,) about the principal axes of inertia, those of `scales` times `twist_leverage` [rad/m].
        airborne_noise: noise may change a displacement in the air by so much from frame to frame [m]; zero where the user has
            set the bound.
        energy_speed: energy that a speed of 1 m/s may gain in the air, per mass [m/s]; zero where the user has set the bound.
        least_impulse: from frame to frame noise may be taken for an impulse that is so long [m]; likewise.
        least_jump: likewise for a jump [m].
        jump_spins: (3,) about the principal axes [rad/s].
    """

    gravity: float
    largest_friction: float
    impulse_tolerance: float
    airborne_clearance: float
    airborne_acceleration: float
    airborne_noise: float
    airborne_spin_change: float
    levers: Array
    twist_tolerance: float
    energy_tolerance: float
    energy_speed: float
    least_impulse: float
    least_jump: float
    jump_velocity: float
    jump_spins: Array
    depth: float
    rest_tilt: float
    rest_height: float
    resting_speed: float
    resting_spin: float
    quaternion_tolerance: float
    largest_gap: float
