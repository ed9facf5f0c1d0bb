"""What is identified: a box's half extents, its friction, and the time constant and damping ratio of MuJoCo's contacts.

Mass, inertia and the centre are as described. All are positive and are identified by their logarithms, within BOUNDS.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.world import DEFAULT_WORLD

NAMES = ("half_x", "half_y", "half_z", "friction", "contact_time", "damping_ratio")
UNLIKE = 1e-6
"""Largest difference of a box's corners from half extents [m]."""

FACTOR = 3.0
"""By which half extents may differ from those described."""

BOUNDS = {"friction": (0.01, 2.0), "contact_time": (0.0021, 0.05), "damping_ratio": (0.05, 3.0)}
"""Contacts need at least two time steps of 1 ms."""


@dataclass(frozen=True, eq=False)
class IdentifiedBox:
    """A box.

    Attributes:
        half_extents: (3,) [m].
        friction: of the board and the box.
        contact_time: of contacts [s].
        damping_ratio: of contacts.
    """

    half_extents: Array
    friction: float
    contact_time: float = DEFAULT_WORLD.contact_time
    damping_ratio: float = DEFAULT_WORLD.damping_ratio

    @staticmethod
    def described(body: Body) -> "IdentifiedBox":
        """The box that a body is described as.

        Raises:
            InvalidValueError: it is no box about its centre of mass, along its axes.
        """
        half = np.abs(body.vertices).max(axis=0)
        if len(body.vertices) != 8 or np.abs(np.abs(body.vertices) - half).max() > UNLIKE:
            raise InvalidValueError(f"shape of {body.name}", f"{len(body.vertices)} vertices", "the 8 corners of a box")
        return IdentifiedBox(half, body.friction)

    @staticmethod
    def of_vector(vector: Array) -> "IdentifiedBox":
        """The box that has such logarithms (6,), in the order of NAMES."""
        values = np.exp(vector)
        return IdentifiedBox(values[:3], *values[3:].tolist())

    @property
    def vector(self) -> Array:
        """(6,) logarithms, in the order of NAMES."""
        return np.log([*self.half_extents, self.friction, self.contact_time, self.damping_ratio])

    def of(self, body: Body) -> Body:
        """A body of this shape and friction, its corners in the order of another's."""
        return replace(body, vertices=np.sign(body.vertices) * self.half_extents, friction=self.friction)


def bounds_of(body: Body) -> tuple[Array, Array]:
    """(6,) lowest and (6,) highest vector that is looked at."""
    half = IdentifiedBox.described(body).half_extents
    low, high = zip(*BOUNDS.values(), strict=True)
    return np.log([*(half / FACTOR), *low]), np.log([*(half * FACTOR), *high])


class Identified(NamedTuple):
    """A box that was identified.

    Attributes:
        box: it.
        half_widths: (6,) of the 95 % intervals of its vector; NaN where the method gives none.
        evaluations: how often all windows were simulated.
    """

    box: IdentifiedBox
    half_widths: Array
    evaluations: int
