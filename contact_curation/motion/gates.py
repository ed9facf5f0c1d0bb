"""The quality checks (gates) of a toss before it is scored; without them one tracking outlier can look like the best toss.

See method.md 0.2, 2.1.

Each gate is a pure function of a toss and needs no model of friction or shape beyond the body's vertices and inertia I; it
gives one line per kind of fault, with the worst frame. With g gravity, dt the time from a frame to the next, and
dv = v' - v + g dt e3 and dw = w' - w + I^-1 (w x I w) dt the velocity and spin that contact (and nothing else) has given:

    impulse   dv_z >= -tol,  |dv_xy| <= mu_max max(dv_z, 0) + tol     a contact pushes up, within a generous friction cone;
                                                                      sideways also sums over up to 0.1 s
    airborne  |dv| <= a_max dt,  |dw| <= w_max                        no contact, no push and no twist
    twist     |dw_a| <= lever_a |J| / m + w_tol                       no push, no twist: I dw = r x J at a vertex r (`scales`)
    energy    |v'|^2/2 + g z' <= |v|^2/2 + g z + e_tol                no contact, no work
    jump      |(p' - p)/dt - v'| <= v_max, and turns likewise         velocities belong to their poses
    depth     lowest vertex >= -depth                                 the board is hard
    rest      tilt <= angle, |height| <= bound of the face it lies on a body at rest lies flat on the board

a is each principal axis of inertia, and |J| / m = sqrt(1 + mu_max^2) dv_z. The symbols are fields of `GateConfig`: tol is
impulse_tolerance, mu_max largest_friction, a_max airborne_acceleration, w_max airborne_spin_change, w_tol twist_tolerance,
e_tol energy_tolerance, v_max jump_velocity. The bounds follow from the body's size and inertia and from the tracker's rate and
noise (`gate_config`). Stamps and quaternion norms complete the list. The jump gate sees what a
filter hid: a median of three takes an outlier of one frame out of the velocities, but not out of the positions. A rejected toss
is stored and shown, never deleted.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.gate_config import TURN_NOISE, GateBounds, GateConfig
from contact_curation.motion.pose_noise import RIG, RIG_TURN, TrackerScale
from contact_curation.motion.scales import BodyScale, TossedBody, scale_of
from contact_curation.motion.smoothing import (
    all_around,
    clear_steps,
    is_filtered,
    kinematic_noise_growth,
    median_of_three,
    noise_growth,
    noise_without_filter,
    vertex_travels,
)
from contact_curation.motion.toss import NANOSECONDS, Toss

ON_A_LINE = 0.05
"""A triangle with a smaller share of a face's largest area."""

PUSHING = 0.1
"""[s] Impulses are summed over up to so long: what noise does to velocities does not add up, but a tilt of the board does."""

REST_FRAMES, ROCKING_FRAMES = 5, 9
"""The last ones, over which a body at rest at the end is slow, and tilts no more; of the latter more over 150 a second."""


@dataclass(frozen=True, eq=False)
class Steps:
    """The T - 1 steps between the T frames of a toss, as the gates see them.

    Attributes:
        toss: T frames.
        tracker: how noisy its poses are.
        lowest: (T,) height of the lowest vertex [m].
        dt: (T - 1,) [s].
        contact_velocities: (T - 1, 3) dv [m/s].
        spin_changes: (T - 1, 3) dw about the principal axes of inertia [rad/s].
        turn_offsets: (T - 1, 3) turns over their time less the filtered angular velocities, likewise [rad/s].
        airborne: (T - 1,) whether the body is in the air in all frames that the velocities at both ends come from.
        footing: (3, 3) where three vertices of the face it lies on are at the end [m]; None for a body that still moves.
    """

    toss: Toss
    tracker: TrackerScale
    lowest: Array
    dt: Array
    contact_velocities: Array
    spin_changes: Array
    turn_offsets: Array
    airborne: NDArray[np.bool_]
    footing: Array | None

    def growth(self, noise: float = 1.0, order: int = 1) -> float:
        """What bounds on velocities (order 1) or accelerations (2) are multiplied with, for so many times the rig's noise."""
        return kinematic_noise_growth(self.toss.frame_period, noise, order)


def steps_of(toss: Toss, body: TossedBody, bounds: GateBounds, tracker: TrackerScale = RIG) -> Steps:
    """Computes the quantities that all gates use."""
    return _steps_of(toss, body.polytope, scale_of(body), bounds, tracker)


def _steps_of(toss: Toss, polytope: Polytope, scale: BodyScale, bounds: GateBounds, tracker: TrackerScale) -> Steps:
    lowest = polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1)
    dt = np.diff(toss.stamps_ns) / NANOSECONDS
    gained = np.diff(toss.linear_velocities, axis=0) + np.outer(dt, [0.0, 0.0, bounds.gravity])
    spins = toss.angular_velocities @ scale.axes  # (T, 3)
    turns = quaternions.log(
        quaternions.multiply(quaternions.conjugate(toss.orientations_wxyz[:-1]), toss.orientations_wxyz[1:])
    )
    return Steps(
        toss,
        tracker,
        lowest,
        dt,
        gained,
        np.diff(spins, axis=0) - _free_spin_changes(spins, scale.moments, dt),
        turns @ scale.axes / dt[:, np.newaxis] - _filtered(spins[1:], toss),
        airborne_steps(toss, lowest, scale.reach, bounds.airborne_clearance),
        None if _rocks(toss, tracker) else footing(toss, polytope, bounds.resting_speed, bounds.resting_spin),
    )


def _filtered(velocities: Array, toss: Toss) -> Array:
    """Velocities (T - 1, 3) of a toss as medians of three, as those of fast cameras are: a jump is what they leave out."""
    return velocities if is_filtered(toss.frame_period) else median_of_three(velocities)


def airborne_steps(toss: Toss, lowest: Array, reach: float, clearance: float) -> NDArray[np.bool_]:
    """Steps (T - 1,) with the body in the air in, and between, all frames that the velocities at both ends come from."""
    clear = np.append(clear_steps(lowest, vertex_travels(toss, reach)), True)  # (T,)
    return np.asarray((all_around(lowest > clearance, 2, 2) & all_around(clear, 2, 1))[:-1])


def footing(toss: Toss, polytope: Polytope, speed: float, spin: float) -> Array | None:
    """(3, 3) where the three lowest vertices of the face that a body lies on are, in the median of the last frames [m].

    None where it still moves, faster than `speed` [m/s] or `spin` [rad/s]. The face is the one that is most nearly level;
    without it the three lowest vertices may belong to several faces, or lie on a line.
    """
    last = slice(-REST_FRAMES, None)
    speeds, spins = (quaternions.lengths(each[last]) for each in (toss.linear_velocities, toss.angular_velocities))
    if _median(speeds) > speed or _median(spins) > spin:
        return None
    turned = quaternions.to_matrix(toss.orientations_wxyz[last]) @ polytope.vertices.T
    corners = _median(turned.swapaxes(1, 2) + toss.positions[last, np.newaxis])
    down = -quaternions.third_rows(toss.orientations_wxyz[-1])  # in the body's frame
    return np.asarray(corners[_triangle_of(corners, polytope.face_towards(down))])


def rest_normal(corners: Array) -> Array:
    """(3,) up, of the face that a body lies on, by its `footing`."""
    normal = quaternions.cross(corners[1] - corners[0], corners[2] - corners[0])
    return np.asarray(normal * np.sign(normal[2]) / np.linalg.norm(normal))


def inspect(toss: Toss, body: TossedBody, config: GateConfig, tracker: TrackerScale = RIG) -> tuple[str, ...]:
    """Why a toss is rejected, one line per gate that it fails; empty when it passes.

    Args:
        toss: of the body.
        body: as described.
        config: what its user has set.
        tracker: how noisy its poses are.
    """
    if not config.enabled:
        return ()
    scale = scale_of(body)
    bounds = config.bounds(scale, tracker)
    steps = _steps_of(toss, body.polytope, scale, bounds, tracker)
    return tuple(line for gate in GATES if (line := gate(steps, bounds)))


def stamps_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that no frame is missing."""
    return _worst("time between frames", steps.dt / steps.toss.frame_period, bounds.largest_gap, "frame periods")


def quaternion_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that quaternions have norm 1."""
    off = np.abs(quaternions.lengths(steps.toss.orientations_wxyz) - 1.0)
    return _worst("quaternion norm beside 1", off, bounds.quaternion_tolerance, "", first=0)


def depth_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that the body does not penetrate the board."""
    return _worst("depth in the board", -steps.lowest, bounds.depth, "m", first=0)


def rest_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that a body at rest lies flat."""
    if steps.footing is None:
        return ""
    tilt = float(np.degrees(np.arccos(min(rest_normal(steps.footing)[2], 1.0))))
    bound = np.degrees(bounds.rest_tilt)
    return f"tilt at rest: found {tilt:.4g} degrees, expected at most {bound:.4g} degrees" if tilt > bound else ""


def rest_height_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that a body at rest lies on the board."""
    height = 0.0 if steps.footing is None else float(steps.footing[:, 2].mean())
    if abs(height) <= bounds.rest_height:
        return ""
    return f"height at rest: found {height:.4g} m, expected at most {bounds.rest_height:.4g} m over or under the board"


def impulse_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that contact impulses point up."""
    return _worst("impulse that pulls down", -steps.contact_velocities[:, 2], impulse_bound(steps, bounds), "m/s")


def cone_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that contact impulses stay in the friction cone, and so do their sums on the board: a hand takes its time."""
    outside = _outside_cone(steps.contact_velocities, bounds)
    on_board = np.where(steps.airborne[:, np.newaxis], 0.0, steps.contact_velocities)
    given = np.concatenate([np.zeros((1, 3)), np.cumsum(on_board, axis=0)])
    for count in range(2, min(round(PUSHING / steps.toss.frame_period), len(steps.dt)) + 1):
        of_sums = _outside_cone(given[count:] - given[:-count], bounds)
        outside[count - 1 :] = np.maximum(outside[count - 1 :], of_sums)
    return _worst("impulse outside the friction cone", outside, impulse_bound(steps, bounds), "m/s")


def _outside_cone(gained: Array, bounds: GateBounds) -> Array:
    """(N,) how far velocities (N, 3) that contact has given are outside [m/s]."""
    sideways = quaternions.lengths(gained[:, :2])
    return np.asarray(sideways - bounds.largest_friction * np.maximum(gained[:, 2], 0.0))


def impulse_bound(steps: Steps, bounds: GateBounds) -> float:
    """What noise and the median of three leave of an impulse that is none; the median may move gravity's by a frame [m/s]."""
    period = steps.toss.frame_period
    noise = bounds.least_impulse * noise_without_filter(period) / period
    least = noise + bounds.gravity * period if noise else 0.0
    return max(bounds.impulse_tolerance * steps.growth(), least)


def airborne_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that only gravity accelerates a body in the air."""
    pushed = np.where(steps.airborne, quaternions.lengths(steps.contact_velocities) / steps.dt, 0.0)
    period = steps.toss.frame_period
    least = bounds.airborne_noise * noise_without_filter(period) / period**2
    bound = max(bounds.airborne_acceleration * (1.0 if least else steps.growth(steps.tracker.position, 2)), least)
    return _worst("acceleration in the air beyond gravity", pushed, bound, "m/s^2")


def spin_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that the spin of a body in the air changes only by free rotation."""
    changes = np.where(steps.airborne, quaternions.lengths(steps.spin_changes), 0.0)
    bound = bounds.airborne_spin_change * steps.growth(steps.tracker.turn)
    return _worst("change of spin in the air", changes, bound, "rad/s")


def twist_gate(steps: Steps, bounds: GateBounds) -> str:
    """Nothing twists a body but a push at a vertex; a median may have moved either by a frame, or two pushes into one."""
    pushes = sqrt(1.0 + bounds.largest_friction**2) * _between_nothing(np.maximum(steps.contact_velocities[:, 2], 0.0))
    nearby = pushes[1:-1] + np.maximum(pushes[:-2], pushes[2:])
    nearby = nearby + np.minimum(nearby, bounds.gravity * steps.dt)  # at a peak a median clips what gravity takes in a frame
    beyond = (np.abs(steps.spin_changes) - np.outer(nearby, bounds.levers)).max(axis=1)
    bound = bounds.twist_tolerance * steps.growth(max(steps.tracker.position, steps.tracker.turn))
    return _worst("change of spin beyond what a contact's impulse gives", beyond, bound, "rad/s")


def energy_gate(steps: Steps, bounds: GateBounds) -> str:
    """Nothing lifts or speeds up a body in the air; of its centre of mass, per mass."""
    squares = (steps.toss.linear_velocities**2).sum(axis=1)
    gained = np.diff(0.5 * squares + bounds.gravity * steps.toss.positions[:, 2])
    allowed = np.maximum(bounds.energy_tolerance, bounds.energy_speed * np.sqrt(np.maximum(squares[:-1], squares[1:])))
    allowed = allowed * steps.growth(steps.tracker.position)
    return _worst_beyond("energy gained in the air", np.where(steps.airborne, gained, 0.0), allowed, "m^2/s^2")


def jump_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that displacements agree with velocities, but where friction pushed aside and the next push ended it in a step."""
    rates = np.diff(steps.toss.positions, axis=0) / steps.dt[:, np.newaxis]
    off = quaternions.lengths(rates - _filtered(steps.toss.linear_velocities[1:], steps.toss))
    bound = max(bounds.jump_velocity * steps.growth(), bounds.least_jump / steps.toss.frame_period)
    allowed = np.maximum(bound, bounds.largest_friction * passing_pushes(steps, bounds))
    return _worst_beyond("displacement beside the velocity", off, allowed, "m/s")


def turn_gate(steps: Steps, bounds: GateBounds) -> str:
    """Checks that rotations agree with angular velocities, but where a push began a turn and the next ended it in a step."""
    pushes = sqrt(1.0 + bounds.largest_friction**2) * passing_pushes(steps, bounds)
    allowed = np.maximum(bounds.jump_spins * steps.growth(), np.outer(pushes, bounds.levers))
    axis = int(np.argmax(np.abs(steps.turn_offsets) - allowed)) % 3
    return _worst_beyond("turn beside the angular velocity", np.abs(steps.turn_offsets[:, axis]), allowed[:, axis], "rad/s")


def passing_pushes(steps: Steps, bounds: GateBounds) -> Array:
    """(T - 1,) the lesser of what contact gives upwards at the beginning and at the end of a step, without a median [m/s]."""
    rates = np.diff(steps.toss.positions[:, 2]) / steps.dt
    gained = rates[1:] - rates[:-1] + bounds.gravity * steps.dt[1:]
    pushes = _between_nothing(gained)  # (T,) at each frame; none is known at the ends
    return np.maximum(np.minimum(pushes[:-1], pushes[1:]), 0.0)


type Gate = Callable[[Steps, GateBounds], str]
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


def _worst_beyond(what: str, values: Array, bounds: Array, unit: str) -> str:
    """The line of the value that is farthest over its own bound, if any is; the first value is of frame 1."""
    at = int(np.argmax(values - bounds))
    return _worst(what, values[at : at + 1], float(bounds[at]), unit, first=at + 1)


def _between_nothing(values: Array) -> Array:
    """Values (N,) with a zero before and after them."""
    return np.concatenate([[0.0], values, [0.0]])


def _median(values: Array) -> Array:
    """The median (...) of values (N, ...); `np.median`, which takes any axis, takes three times as long for few."""
    ordered, middle = np.sort(values, axis=0), len(values) // 2
    return np.asarray(ordered[middle] if len(values) % 2 else ordered[middle - 1 : middle + 1].mean(axis=0))


def _free_spin_changes(spins: Array, moments: Array, dt: Array) -> Array:
    """(T - 1, 3) what a body's inertia alone makes of its spins (T, 3) about the principal axes: Euler's equations."""
    middle = 0.5 * (spins[:-1] + spins[1:])
    return np.asarray(quaternions.cross(moments * middle, middle) / moments * dt[:, np.newaxis])


def _rocks(toss: Toss, tracker: TrackerScale) -> bool:
    """Whether a body still tilts over its last frames, however slowly: a round one may rock on a face for long."""
    last = slice(-1 - round(ROCKING_FRAMES * noise_growth(toss.frame_period)), None)
    down = quaternions.third_rows(toss.orientations_wxyz[last])
    return float(quaternions.lengths(down - down[-1]).max()) > TURN_NOISE * RIG_TURN * tracker.turn


def _triangle_of(corners: Array, face: NDArray[np.int64]) -> NDArray[np.int64]:
    """The three lowest of the vertices (V, 3) of a face that are on no line."""
    first, second, *others = face[np.argsort(corners[face, 2])].tolist()
    along = corners[second] - corners[first]
    areas = quaternions.lengths(quaternions.cross(corners[others] - corners[first], along))
    third = others[int(np.argmax(areas > ON_A_LINE * areas.max()))]
    return np.array([first, second, third])


def _worst(what: str, values: Array, bound: float, unit: str, first: int = 1) -> str:
    """The line of the largest value, if it is over the bound; `first` is the frame of the first value."""
    at = int(np.argmax(values))
    if values[at] <= bound:
        return ""
    found, most = (f"{number:.4g} {unit}".rstrip() for number in (values[at], bound))
    return f"{what}: found {found} at frame {at + first}, expected at most {most}"
