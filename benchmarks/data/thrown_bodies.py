"""Bodies of many shapes and sizes, of one density each, and recordings of how they are carried, thrown and come to rest.

MuJoCo moves them. A smaller body is stiffer: the time constant of its contacts goes with its size, as the time of an elastic
impact does. Every body is thrown from as many of its own sizes over the board, so that each tumbles for some impacts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.world import world_of

FINE_PERIOD = 1.0 / 3000.0
"""Motions are simulated in so fine steps, of which frames at 60, 120 and 250 Hz are taken [s]."""

CONTACT_TIME, STEPS_IN_CONTACT = 0.002, 4.0
"""Time constant of the cube's contacts [s], and how many steps there are in a contact, at least.

With the 6 ms of other worlds here a plate sinks 20 mm into the board.
"""

FLIGHT = (0.2, 0.4)
"""Shortest and longest time from the release until the body reaches the board [s]."""

SLOW, FAST, SPIN = 0.3, 1.2, 8.0
"""Horizontal speed of a release, least and most [m/s]; fastest spin [rad/s]."""

HELD, SWUNG, LONGEST = 0.5, 0.3, 5.0
"""[s] Before the release a body is held still, then swung; it rests that long after the release at the latest."""

RESTING = 0.4
"""[s] A body at rest is seen for so long."""


@dataclass(frozen=True, eq=False)
class ThrownBody:
    """A body made of convex pieces.

    Attributes:
        body: all corners, about the centre of mass.
        pieces: corners of each piece, likewise.
    """

    body: Body
    pieces: tuple[Array, ...]

    @cached_property
    def world(self) -> mujoco.MjModel:
        """The body over the board."""
        contact_time = CONTACT_TIME * self.body.length_scale / CONTACTNETS_CUBE.length_scale
        steps = int(np.ceil(STEPS_IN_CONTACT * FINE_PERIOD / contact_time))
        spec = world_of(self.body, FINE_PERIOD / steps, contact_time)
        if len(self.pieces) > 1:
            moving = spec.body(self.body.name)
            whole = moving.geoms[0]
            for number, piece in enumerate(self.pieces):
                spec.add_mesh(name=f"piece_{number}", uservert=piece.ravel())
                moving.add_geom(
                    type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece_{number}",
                    friction=whole.friction, solref=whole.solref, priority=1,
                )  # fmt: skip
            spec.delete(whole)
        return spec.compile()


def uniform(name: str, pieces: Sequence[ArrayLike], density: float, friction: float) -> ThrownBody:
    """A body of one density [kg/m^3] that is the union of convex pieces which do not overlap, by their corners [m]."""
    hulls = [np.asarray(piece, dtype=float) for piece in pieces]
    volumes, firsts, seconds = zip(*(moments(corners) for corners in hulls), strict=True)
    volume = sum(volumes)
    centre = np.sum(firsts, axis=0) / volume
    spread = np.sum(seconds, axis=0) - volume * np.outer(centre, centre)  # integral of x x^T about the centre
    corners = np.unique(np.round(np.concatenate(hulls) - centre, 12), axis=0)
    size = float(np.linalg.det(np.cov(corners.T, bias=True)) ** (1.0 / 6.0))
    body = Body(name, corners, density * volume, density * (np.trace(spread) * np.eye(3) - spread), friction, size)
    return ThrownBody(body, tuple(corners - centre for corners in hulls))


def moments(corners: Array) -> tuple[float, Array, Array]:
    """Volume, first (3,) and second moments (3, 3) of a convex hull, summed over tetrahedra from its middle."""
    hull, middle = ConvexHull(corners), corners.mean(axis=0)
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for face in hull.simplices:
        tetrahedron = np.vstack([middle, corners[face]])
        part = abs(np.linalg.det(tetrahedron[1:] - middle)) / 6.0
        total = tetrahedron.sum(axis=0)
        volume, first = volume + part, first + part * total / 4.0
        second = second + part * (tetrahedron.T @ tetrahedron + np.outer(total, total)) / 20.0
    return volume, first, second


def prism(outline: Sequence[tuple[float, float]], length: float) -> Array:
    """Corners of a prism with an outline in x and y."""
    return np.array([(x, y, z) for z in (-0.5 * length, 0.5 * length) for x, y in outline])


def ellipsoid(count: int, half: ArrayLike) -> Array:
    """Corners spread over an ellipsoid by the golden angle."""
    heights = (2.0 * np.arange(count) + 1.0) / count - 1.0
    angles, radii = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count), np.sqrt(1.0 - heights**2)
    return np.asarray(np.stack([radii * np.cos(angles), radii * np.sin(angles), heights], axis=1) * np.asarray(half))


def bodies() -> tuple[ThrownBody, ...]:
    """The cube of the real tosses, and eight others."""
    hexagon = [(0.05 * np.cos(angle), 0.05 * np.sin(angle)) for angle in np.pi / 3.0 * np.arange(6)]
    return (
        ThrownBody(CONTACTNETS_CUBE, (CONTACTNETS_CUBE.vertices,)),
        uniform("wedge", [prism([(0.0, 0.0), (0.10, 0.0), (0.0, 0.06)], 0.08)], 900.0, 0.3),
        uniform("hexagonal_prism", [prism(hexagon, 0.09)], 700.0, 0.25),
        uniform("plate", [box([0.2, 0.15, 0.008]).vertices], 600.0, 0.35),
        uniform("rod", [box([0.15, 0.0125, 0.0125]).vertices], 1000.0, 0.2),
        uniform(
            "l_piece",
            [box([0.06, 0.02, 0.02]).vertices, np.add(box([0.02, 0.04, 0.02]).vertices, [-0.04, 0.06, 0.0])],
            800.0,
            0.4,
        ),
        uniform("tetrahedron", [0.045 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])], 1200.0, 0.5),
        uniform("hull_of_40", [ellipsoid(40, [0.07, 0.05, 0.04])], 500.0, 0.3),
        uniform("die", [box([0.01, 0.01, 0.01]).vertices], 1200.0, 0.2),
    )


def release(body: Body, rng: np.random.Generator) -> Array:
    """(13,) state of a release, from which the body falls for a time within `FLIGHT`."""
    orientation = quaternions.normalized(rng.standard_normal(4))
    angle, speed, flight = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(SLOW, FAST), rng.uniform(*FLIGHT)
    up = rng.uniform(0.0, 0.25 * body.gravity * flight)
    clear = float(np.linalg.norm(body.vertices, axis=1).max()) + 0.5 * body.gravity * flight**2 - up * flight
    axis = rng.standard_normal(3)
    spin = rng.uniform(0.0, SPIN) * axis / np.linalg.norm(axis)
    return np.concatenate([[0.0, 0.0, clear], orientation, [speed * np.cos(angle), speed * np.sin(angle), up], spin])


def thrown(piece: ThrownBody, first: Array) -> Array:
    """(T, 7) poses every `FINE_PERIOD`: held, swung, thrown from the release (13,), at rest.

    Raises:
        RuntimeError: the body does not come to rest within `LONGEST`.
    """
    model = piece.world
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = first[:7], first[7:]
    steps = round(FINE_PERIOD / model.opt.timestep)
    flown, resting = [first[:7].copy()], 0
    still = 0.02 * piece.body.length_scale, 0.02
    while resting * FINE_PERIOD < RESTING:
        if len(flown) * FINE_PERIOD > LONGEST:
            raise RuntimeError(f"{piece.body.name}: found no rest within {LONGEST:g} s of the release")
        mujoco.mj_step(model, data, steps)
        flown.append(data.qpos.copy())
        speeds = np.linalg.norm(data.qvel[:3]), np.linalg.norm(data.qvel[3:])
        resting = resting + 1 if speeds[0] < still[0] and speeds[1] < still[1] else 0
    return np.concatenate([swing(first), np.array(flown)])


def swing(first: Array) -> Array:
    """(T, 7) poses before a release: at rest, then with constant acceleration up to its velocities."""
    times = -FINE_PERIOD * np.arange(round((HELD + SWUNG) / FINE_PERIOD), 0, -1)
    moving = np.clip(times + SWUNG, 0.0, None)
    way = (moving**2 / (2.0 * SWUNG) - 0.5 * SWUNG)[:, None]
    turned = quaternions.multiply(np.tile(first[3:7], (len(way), 1)), quaternions.exp(way * first[10:]))
    return np.concatenate([first[:3] + way * first[7:10], turned], axis=1)
