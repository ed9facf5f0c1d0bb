"""Unit quaternions in wxyz order, batched over leading axes.

q and -q are one rotation. A body's rotation R(q) takes body coordinates to world coordinates, and angular velocity is in the
body frame: q_dot = 0.5 q * (0, omega) (method.md 1.0).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

IDENTITY: Array = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(a_wxyz: ArrayLike, b_wxyz: ArrayLike) -> Array:
    """Hamilton product a * b, shapes (..., 4)."""
    a, b = np.asarray(a_wxyz, dtype=float), np.asarray(b_wxyz, dtype=float)
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    product = np.empty((*np.broadcast(aw, bw).shape, 4))
    product[..., 0] = aw * bw - ax * bx - ay * by - az * bz
    product[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def conjugate(q_wxyz: ArrayLike) -> Array:
    """Inverse rotation of unit quaternions (..., 4)."""
    q = np.asarray(q_wxyz, dtype=float)
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def to_matrix(q_wxyz: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    q = np.asarray(q_wxyz, dtype=float)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x, y * y, z * z, x * y, x * z, y * z, w * x, w * y, w * z
    matrices = np.empty((*q.shape[:-1], 3, 3))
    matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 0, 2] = 1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy)
    matrices[..., 1, 0], matrices[..., 1, 1], matrices[..., 1, 2] = 2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx)
    matrices[..., 2, 0], matrices[..., 2, 1], matrices[..., 2, 2] = 2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy)
    return matrices


def third_rows(q_wxyz: ArrayLike) -> Array:
    """The third rows (..., 3) of `to_matrix`: the direction upwards in the body's frame."""
    q = np.asarray(q_wxyz, dtype=float)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = np.empty((*q.shape[:-1], 3))
    rows[..., 0], rows[..., 1], rows[..., 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return rows


def rotate(q_wxyz: ArrayLike, vector: ArrayLike) -> Array:
    """R(q) v for quaternions (..., 4) and vectors (..., 3)."""
    return np.asarray(np.einsum("...ij,...j->...i", to_matrix(q_wxyz), np.asarray(vector, dtype=float)))


def exp(rotation_vector: ArrayLike) -> Array:
    """Quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    vector = np.asarray(rotation_vector, dtype=float)
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector], axis=-1)


def log(q_wxyz: ArrayLike) -> Array:
    """Shortest rotation vectors (..., 3) [rad] of unit quaternions (..., 4)."""
    q = np.asarray(q_wxyz, dtype=float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., :1])
    scale = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)
    return np.asarray(scale * q[..., 1:])


def cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (..., 3); `np.cross`, which takes any axis, takes five times as long for few."""
    ax, ay, az, bx, by, bz = (each[..., axis] for each in (a, b) for axis in range(3))
    product = np.empty((*np.broadcast(ax, bx).shape, 3))
    product[..., 0], product[..., 1], product[..., 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return product


def lengths(vectors: Array) -> Array:
    """Lengths (...) of vectors (..., n), with the digits of `np.linalg.norm`, which takes twice as long for few."""
    return np.asarray(np.sqrt((vectors * vectors).sum(axis=-1)))


def angle_between(a_wxyz: ArrayLike, b_wxyz: ArrayLike) -> Array:
    """Angles (...) [rad] of the rotations from a to b."""
    return np.asarray(np.linalg.norm(log(multiply(conjugate(a_wxyz), b_wxyz)), axis=-1))


def normalized(q_wxyz: ArrayLike) -> Array:
    """Quaternions (..., 4) divided by their norm; the caller has checked that the norm is near 1."""
    q = np.asarray(q_wxyz, dtype=float)
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))
