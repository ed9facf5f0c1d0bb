"""Scales of the bounds of segmenter and quality checks: a body's lengths, time and levers.

    size      (det C)^(1/6), with C the covariance of the vertices: half the width of a cube, (a b c)^(1/3) of a box
    reach     distance of the farthest vertex from the centre of mass
    time      sqrt(size / g), in which the body falls half its size
    levers    m l_a / I_a for each principal axis a, with l_a the distance of the farthest vertex from it

An impulse J at a contact vertex r changes the velocity by J / m and the angular velocity by I^-1 (r x J), so about axis a by at
most the lever times |J| / m. The numbers of `GateConfig` and `SegmenterConfig` were measured for ContactNets' cube and the
noise of its rig (`pose_noise.RIG_NOISE`, `RIG_TURN`; method.md 2.1).
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import sqrt
from typing import Protocol

import numpy as np

from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array


class TossedBody(Protocol):
    """The properties of a body that are needed; `contact.body.Body` has them."""

    @property
    def name(self) -> str: ...
    @property
    def polytope(self) -> Polytope: ...
    @property
    def mass(self) -> float: ...
    @property
    def inertia(self) -> Array: ...
    @property
    def friction(self) -> float: ...
    @property
    def gravity(self) -> float: ...
    def __hash__(self) -> int: ...


@dataclass(frozen=True, eq=False)
class BodyScale:
    """The lengths, time and levers of a body.

    Attributes:
        size: [m]; see above.
        reach: [m].
        balanced_rise: of the polytope [m].
        axes: (3, 3) principal axes of inertia in the body's frame, as columns.
        moments: (3,) inertia about them [kg m^2].
        levers: (3,) how fast a push of 1 m/s at a vertex turns the body about each of them, at most [rad/m].
        friction: of the body.
        gravity: [m/s^2].
    """

    size: float
    reach: float
    balanced_rise: float
    axes: Array
    moments: Array
    levers: Array
    friction: float
    gravity: float

    @cached_property
    def time(self) -> float:
        """In which the body falls half its size [s]."""
        return sqrt(self.size / self.gravity)


@lru_cache(maxsize=8)
def scale_of(body: TossedBody) -> BodyScale:
    """The scales of a body."""
    vertices = body.polytope.vertices
    moments, axes = np.linalg.eigh(body.inertia)
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])  # right-handed, as Euler's equations want them
    squares = np.square(vertices @ axes)
    squares_off_axis = squares.sum(axis=1, keepdims=True) - squares  # (V, 3)
    levers = body.mass * np.sqrt(squares_off_axis.max(axis=0)) / moments
    return BodyScale(
        size_of(vertices),
        float(np.sqrt(np.square(vertices).sum(axis=1).max())),
        body.polytope.balanced_rise,
        axes,
        moments,
        levers,
        body.friction,
        body.gravity,
    )


def size_of(vertices: Array) -> float:
    """The size [m] of a body with these vertices (V, 3), the same wherever its origin is."""
    off = vertices - vertices.mean(axis=0)
    first, second, third = off.T @ off / len(off)
    return float(np.dot(first, np.cross(second, third)) ** (1.0 / 6.0))
