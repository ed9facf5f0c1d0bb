"""What a toss must pass before it is scored, or one bad frame of the tracker looks like the best toss of all.

See method.md 0.2, 2.1.

Each gate is a pure function of a toss and needs no model of friction or shape beyond the body's polytope; it gives one line per
kind of fault, with the worst frame. With g = 9.81 e3, dt the time from a frame to the next, and dv = v' - v + g dt the velocity
that contact (and nothing else) has given in between:

    impulse   dv_z >= -tol,  |dv_xy| <= mu_max max(dv_z, 0) + tol     a contact pushes up, within a generous friction cone
    airborne  |dv| <= a_max dt,  |w' - w| <= w_max                    no contact, no push and no twist
    twist     |w' - w| <= r |dv| + w_tol                              no push, no twist: r a corner's lever over inertia
    energy    |v'|^2/2 + g z' <= |v|^2/2 + g z + e_tol                no contact, no work
    jump      |(p' - p)/dt - v'| <= v_max, and turns likewise         velocities belong to their poses
    depth     lowest corner >= -depth                                 the board is hard
    rest      tilt <= angle, |height| <= bound of the face it lies on a body at rest lies flat on the board

Faster than 150 frames a second the bounds on velocities grow with the rate and those on accelerations with its square, as a
tracker's noise does (`smoothing.noise_growth`). Stamps and quaternion norms complete the list. The jump gate sees what a
filter hid: a median of three takes an outlier of one frame out of the velocities, but not out of the positions. A rejected toss
is stored and shown, never deleted.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.smoothing import all_around, noise_growth
from contact_curation.motion.toss import NANOSECONDS, Toss


@dataclass(frozen=True)
class GateConfig:
    """Bounds, for a body of about 10 cm at 60 to 150 frames a second; faster, some of them grow.

    method.md 2.1 gives them in half widths of 0.0524 m: tol 3 and depth 0.15. The others lie above what all 570 public tosses
    show (0.51 g, 0.7 rad/s, 0.8 rad/s, 0.04 m^2/s^2, 0.20 m/s, 16 rad/s, 1.1 degrees, 2.6 mm).

    Attributes:
        enabled: False lets everything pass.
        gravity: [m/s^2].
        largest_friction: mu_max of the cone; 1.5 times the body's friction where that is more.
        impulse_tolerance: tol [m/s].
        airborne_clearance: a body whose corners are higher than this is in the air [m].
        airborne_acceleration: a_max [m/s^2].
        airborne_spin_change: w_max, from frame to frame [rad/s].
        twist_leverage: r over that of a uniform box with the body's corners; more for a body with its mass inside.
        twist_tolerance: w_tol [rad/s].
        energy_tolerance: e_tol, per mass [m^2/s^2].
        jump_velocity: v_max, about 3 mm at 148 Hz [m/s].
        jump_spin: the same of turns [rad/s].
        depth: of the lowest corner under the board [m].
        rest_tilt: of the face that the body comes to lie on [rad].
        rest_height: of that face over or under the board [m].
        resting_speed: a body is at rest at the end if it is as slow as that over the last frames [m/s].
        resting_spin: likewise [rad/s].
        quaternion_tolerance: on the norm.
        largest_gap: between frames, in frame periods.
    """

    enabled: bool = True
    gravity: float = 9.81
    largest_friction: float = 0.5
    impulse_tolerance: float = 3.0 * 0.0524
    airborne_clearance: float = 0.010
    airborne_acceleration: float = 0.6 * 9.81
    airborne_spin_change: float = 2.0
    twist_leverage: float = 1.0
    twist_tolerance: float = 2.0
    energy_tolerance: float = 0.1
    jump_velocity: float = 0.4
    jump_spin: float = 25.0
    depth: float = 0.15 * 0.0524
    rest_tilt: float = float(np.radians(1.4))
    rest_height: float = 0.003
    resting_speed: float = 0.05
    resting_spin: float = 0.5
    quaternion_tolerance: float = 1e-4
    largest_gap: float = 1.5

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name != "enabled" and not value > 0.0:
                raise InvalidValueError(field.name, value, "a positive number")

    def of_body(self, gravity: float, friction: float) -> "GateConfig":
        """The same under a body's gravity, the cone at least `FRICTION_MARGIN` times as wide as its own."""
        return replace(self, gravity=gravity, largest_friction=max(self.largest_friction, FRICTION_MARGIN * friction))

    def of_tracker(self, noise: float) -> "GateConfig":
        """The same for poses that are `noise` times as noisy as the real rig's: what noise reaches in the air grows with it."""
        return replace(self, **{name: noise * getattr(self, name) for name in REACHED_BY_NOISE})


REACHED_BY_NOISE = (
    *("airborne_acceleration", "airborne_spin_change", "twist_tolerance", "energy_tolerance"),
    *("resting_speed", "resting_spin"),
)
FRICTION_MARGIN = 1.5
"""A body's friction is what somebody took it for."""

REST_FRAMES = 5
"""The last ones, over which a body at rest at the end is slow."""


@dataclass(frozen=True, eq=False)
class Steps:
    """The T - 1 steps between the T frames of a toss, as the gates see them.

    Attributes:
        toss: T frames.
        lowest: (T,) height of the lowest corner [m].
        dt: (T - 1,) [s].
        contact_velocities: (T - 1, 3) dv [m/s].
        spin_changes: (T - 1,) |w' - w| [rad/s].
        airborne: (T - 1,) whether the body is in the air in all frames that the velocities at both ends come from.
        footing: (3, 3) where the three lowest corners are at the end [m]; None for a body that still moves.
        spin_by_push: how fast a push of 1 m/s at a corner turns a uniform box with the body's corners, at most [rad/s].
    """

    toss: Toss
    lowest: Array
    dt: Array
    contact_velocities: Array
    spin_changes: Array
    airborne: NDArray[np.bool_]
    footing: Array | None
    spin_by_push: float

    @property
    def noise(self) -> float:
        """What bounds on velocities are multiplied with."""
        return noise_growth(self.toss.frame_period)


def steps_of(toss: Toss, polytope: Polytope, config: GateConfig) -> Steps:
    """What all gates look at, worked out once."""
    lowest = polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1)
    dt = np.diff(toss.stamps_ns) / NANOSECONDS
    gained = np.diff(toss.linear_velocities, axis=0) + np.outer(dt, [0.0, 0.0, config.gravity])
    spun = np.linalg.norm(np.diff(toss.angular_velocities, axis=0), axis=1)
    airborne = all_around(lowest > config.airborne_clearance, 2, 2)[:-1]  # the poses that v and v' come from
    return Steps(toss, lowest, dt, gained, spun, airborne, footing(toss, polytope, config), spin_by_push(polytope))


def footing(toss: Toss, polytope: Polytope, config: GateConfig) -> Array | None:
    """(3, 3) where the three lowest corners are at rest, in the median of the last frames [m]; None if it still moves."""
    last = slice(-REST_FRAMES, None)
    speeds, spins = (np.linalg.norm(each[last], axis=1) for each in (toss.linear_velocities, toss.angular_velocities))
    if np.median(speeds) > config.resting_speed or np.median(spins) > config.resting_spin:
        return None
    turned = quaternions.to_matrix(toss.orientations_wxyz[last]) @ polytope.vertices.T
    corners = np.median(turned.swapaxes(1, 2) + toss.positions[last, np.newaxis], axis=0)
    return np.asarray(corners[np.argsort(corners[:, 2])[:3]])


def spin_by_push(polytope: Polytope) -> float:
    """R / k^2 [1/m]: R to the outermost corner, k^2 = (b^2 + c^2) / 3 of a uniform box, b and c its lesser half widths."""
    squares = np.square(polytope.vertices)
    arms = squares.sum(axis=1, keepdims=True) - squares  # (V, 3) squared distances from the axes
    return float(3.0 * np.sqrt(squares.sum(axis=1).max()) / arms.mean(axis=0).min())


def rest_normal(corners: Array) -> Array:
    """(3,) up, of the face that a body lies on, by its `footing`."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return np.asarray(normal * np.sign(normal[2]) / np.linalg.norm(normal))


def inspect(toss: Toss, polytope: Polytope, config: GateConfig) -> tuple[str, ...]:
    """Why a toss is rejected, one line per gate that it fails; empty when it passes."""
    if not config.enabled:
        return ()
    steps = steps_of(toss, polytope, config)
    return tuple(line for gate in GATES if (line := gate(steps, config)))


def stamps_gate(steps: Steps, config: GateConfig) -> str:
    """No frame is missing."""
    return _worst("time between frames", steps.dt / steps.toss.frame_period, config.largest_gap, "frame periods")


def quaternion_gate(steps: Steps, config: GateConfig) -> str:
    """Orientations are rotations."""
    off = np.abs(np.linalg.norm(steps.toss.orientations_wxyz, axis=1) - 1.0)
    return _worst("quaternion norm beside 1", off, config.quaternion_tolerance, "", first=0)


def depth_gate(steps: Steps, config: GateConfig) -> str:
    """The body does not go into the board."""
    return _worst("depth in the board", -steps.lowest, config.depth, "m", first=0)


def rest_gate(steps: Steps, config: GateConfig) -> str:
    """A body at rest lies flat, ..."""
    if steps.footing is None:
        return ""
    tilt = float(np.degrees(np.arccos(min(rest_normal(steps.footing)[2], 1.0))))
    bound = np.degrees(config.rest_tilt)
    return f"tilt at rest: found {tilt:.4g} degrees, expected at most {bound:.4g} degrees" if tilt > bound else ""


def rest_height_gate(steps: Steps, config: GateConfig) -> str:
    """... and on the board."""
    height = 0.0 if steps.footing is None else float(steps.footing[:, 2].mean())
    if abs(height) <= config.rest_height:
        return ""
    return f"height at rest: found {height:.4g} m, expected at most {config.rest_height:.4g} m over or under the board"


def impulse_gate(steps: Steps, config: GateConfig) -> str:
    """What contact gives points up, ..."""
    bound = config.impulse_tolerance * steps.noise
    return _worst("impulse that pulls down", -steps.contact_velocities[:, 2], bound, "m/s")


def cone_gate(steps: Steps, config: GateConfig) -> str:
    """... and stays within the friction cone."""
    sideways = np.linalg.norm(steps.contact_velocities[:, :2], axis=1)
    outside = sideways - config.largest_friction * np.maximum(steps.contact_velocities[:, 2], 0.0)
    return _worst("impulse outside the friction cone", outside, config.impulse_tolerance * steps.noise, "m/s")


def airborne_gate(steps: Steps, config: GateConfig) -> str:
    """Nothing but gravity moves a body in the air."""
    pushed = np.where(steps.airborne, np.linalg.norm(steps.contact_velocities, axis=1) / steps.dt, 0.0)
    bound = config.airborne_acceleration * steps.noise**2
    return _worst("acceleration in the air beyond gravity", pushed, bound, "m/s^2")


def spin_gate(steps: Steps, config: GateConfig) -> str:
    """Nothing twists a body in the air."""
    changes = np.where(steps.airborne, steps.spin_changes, 0.0)
    return _worst("change of spin in the air", changes, config.airborne_spin_change * steps.noise, "rad/s")


def twist_gate(steps: Steps, config: GateConfig) -> str:
    """Nothing twists a body but a push; a median may have moved either by a frame."""
    pushes = np.pad(np.linalg.norm(steps.contact_velocities, axis=1), 1)
    nearby = np.maximum(np.maximum(pushes[:-2], pushes[1:-1]), pushes[2:])
    beyond = steps.spin_changes - config.twist_leverage * steps.spin_by_push * nearby
    return _worst("change of spin beyond what its push gives", beyond, config.twist_tolerance * steps.noise, "rad/s")


def energy_gate(steps: Steps, config: GateConfig) -> str:
    """Nothing lifts or speeds up a body in the air; of its centre of mass, per mass."""
    energy = 0.5 * (steps.toss.linear_velocities**2).sum(axis=1) + config.gravity * steps.toss.positions[:, 2]
    gained = np.where(steps.airborne, np.diff(energy), 0.0)
    return _worst("energy gained in the air", gained, config.energy_tolerance * steps.noise, "m^2/s^2")


def jump_gate(steps: Steps, config: GateConfig) -> str:
    """The body moves by its velocity."""
    rates = np.diff(steps.toss.positions, axis=0) / steps.dt[:, np.newaxis]
    off = np.linalg.norm(rates - steps.toss.linear_velocities[1:], axis=1)
    return _worst("displacement beside the velocity", off, config.jump_velocity * steps.noise, "m/s")


def turn_gate(steps: Steps, config: GateConfig) -> str:
    """The body turns by its angular velocity."""
    orientations = steps.toss.orientations_wxyz
    turns = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations[:-1]), orientations[1:]))
    off = np.linalg.norm(turns / steps.dt[:, np.newaxis] - steps.toss.angular_velocities[1:], axis=1)
    return _worst("turn beside the angular velocity", off, config.jump_spin * steps.noise, "rad/s")


type Gate = Callable[[Steps, GateConfig], str]
"""Gives the line of what it finds wrong with a toss; an empty one where nothing is."""

GATES: tuple[Gate, ...] = (
    stamps_gate,
    quaternion_gate,
    depth_gate,
    rest_gate,
    rest_height_gate,
    impulse_gate,
    cone_gate,
    airborne_gate,
    spin_gate,
    twist_gate,
    energy_gate,
    jump_gate,
    turn_gate,
)
"""In the order of their lines. Another gate takes a function and a line here; a bound of its own, a field of `GateConfig`."""


def _worst(what: str, values: Array, bound: float, unit: str, first: int = 1) -> str:
    """The line of the largest value, if it is over the bound; `first` is the frame of the first value."""
    at = int(np.argmax(values))
    if values[at] <= bound:
        return ""
    return f"{what}: found {values[at]:.4g} {unit} at frame {at + first}, expected at most {bound:.4g} {unit}".replace(
        "  ", " "
    )
