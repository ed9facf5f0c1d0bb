"""Rotations and poses one at a time, in plain floats.

A pose stream is handled pose by pose at 148 Hz and more, where a NumPy array of four numbers costs fifty times its arithmetic.
Same conventions as `quaternions` (wxyz, Hamilton) and `poses`; tests hold the two together.
"""

from collections.abc import Iterable, Sequence
from math import asin, atan2, cos, prod, sin, sqrt
from typing import NamedTuple

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class ScalarPose(NamedTuple):
    """Pose of a child frame in its parent: `p_parent = R(orientation) p_child + position`.

    Attributes:
        position: [m].
        orientation_wxyz: unit quaternion.
    """

    position: Vector
    orientation_wxyz: Quaternion


IDENTITY = ScalarPose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


def vector(values: Iterable[float]) -> Vector:
    """Three numbers, e.g. of an array (3,), as plain floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product a * b."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def unit(q: Quaternion) -> Quaternion:
    """A quaternion scaled to length 1."""
    w, x, y, z = q
    length = sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def conjugate(q: Quaternion) -> Quaternion:
    """Inverse rotation of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


def rotate(q: Quaternion, vector: Vector) -> Vector:
    """R(q) v, as v + w t + u x t with u the vector part and t = 2 u x v."""
    w, x, y, z = q
    vx, vy, vz = vector
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return vx + w * tx + y * tz - z * ty, vy + w * ty + z * tx - x * tz, vz + w * tz + x * ty - y * tx


def third_row(q: Quaternion) -> Vector:
    """The third row of R(q): what the body's axes contribute to height."""
    w, x, y, z = q
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def compose(parent: ScalarPose, child: ScalarPose) -> ScalarPose:
    """The pose of `child`, given in `parent`'s frame, in the frame that `parent` is given in."""
    x, y, z = rotate(parent.orientation_wxyz, child.position)
    px, py, pz = parent.position
    return ScalarPose((px + x, py + y, pz + z), multiply(parent.orientation_wxyz, child.orientation_wxyz))


def inverse(pose: ScalarPose) -> ScalarPose:
    """The parent's pose in the child's frame."""
    back = conjugate(pose.orientation_wxyz)
    x, y, z = rotate(back, pose.position)
    return ScalarPose((-x, -y, -z), back)


def angle_between(a: Quaternion, b: Quaternion) -> float:
    """Angle [rad] of the rotation from a to b, by the chord where the cosine is blind to small ones."""
    sign = -1.0 if sum(one * other for one, other in zip(a, b)) < 0.0 else 1.0
    chord = sqrt(sum((one - sign * other) ** 2 for one, other in zip(a, b)))
    return 4.0 * asin(min(1.0, 0.5 * chord))


def rotation_vector(q: Quaternion) -> Vector:
    """Axis times angle of the shorter rotation of a unit quaternion [rad]."""
    w, x, y, z = q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    half_sine = sqrt(x * x + y * y + z * z)
    factor = 2.0 if half_sine < 1e-12 else 2.0 * atan2(half_sine, w) / half_sine
    return factor * x, factor * y, factor * z


def rotation_by(turn: Vector) -> Quaternion:
    """The unit quaternion of a rotation vector [rad]."""
    x, y, z = turn
    angle = sqrt(x * x + y * y + z * z)
    factor = 0.5 if angle < 1e-12 else sin(0.5 * angle) / angle
    return cos(0.5 * angle), factor * x, factor * y, factor * z


def interpolated(times: Sequence[float], poses: Sequence[ScalarPose], time: float) -> ScalarPose:
    """The pose at a time by Lagrange's polynomial through others; through equal ones exactly these.

    Through two it is a straight line, and slerp. Orientations are interpolated as rotation vectors seen from the first pose,
    which should be next to the time.

    Args:
        times: of the poses, no two the same.
        poses: of one frame in another.
        time: where the pose is wanted.
    """
    (x, y, z), first = poses[0]
    back, (dx, dy, dz), turn = conjugate(first), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for at, ((px, py, pz), orientation) in zip(times[1:], poses[1:], strict=True):
        weight = prod((time - other) / (at - other) for other in times if other != at)
        rx, ry, rz = rotation_vector(multiply(back, orientation))
        dx, dy, dz = dx + weight * (px - x), dy + weight * (py - y), dz + weight * (pz - z)
        turn = turn[0] + weight * rx, turn[1] + weight * ry, turn[2] + weight * rz
    return ScalarPose((x + dx, y + dy, z + dz), unit(multiply(first, rotation_by(turn))))
