"""Which numbers theta is made of: a linear map from the kernel's full gradient to the parameters of a form.

The kernel differentiates by everything: vertices_normal (3V), normal (3), vertices_tangent (3V), tangents (6), height (1), in
this order, Q = 6V + 10 numbers; and by the restitution of a theta that has it, as the last one. A form says how these move
with its own P parameters, dQ/dtheta, so that scores change as g C and Fisher matrices as C^T F C.

- ``contactnets``: the 57 parameters (V = 8) of ContactNets' polytope. A turn of the tangents (gauge) changes neither loss nor
  motion (method.md 1.1): it is projected out, so that no estimator, Gauss-Newton's least of all, finds information in it.
- ``physical``: vertices_normal, vertices_tangent, friction (its logarithm), tilt (2) about a pivot, height. The normal stays a
  unit vector, friction a number; nothing depends on where the board's origin lies once the pivot is the data's centroid.
- ``rigid``: the same with one set of vertices, called vertices_normal: friction acts at the contact vertices. It may
  have a restitution, behind the vertices.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

PHYSICAL_TOLERANCE = 1e-9


class Form(StrEnum):
    """How the polytope is parameterised."""

    CONTACTNETS = "contactnets"
    PHYSICAL = "physical"
    RIGID = "rigid"


class Block(NamedTuple):
    """A named run of parameters."""

    name: str
    size: int


@dataclass(frozen=True, eq=False)
class ParameterForm:
    """Theta of a geometry in one form.

    Attributes:
        form: which.
        blocks: names and sizes of the runs of parameters, P in all.
        chart: (Q, P) how the kernel's numbers move with theta.
        gauge: (G, P) directions that change nothing, for any data.
        tilt_axes: (2, 3) directions of the board in which the tilt moves the normal; (0, 3) in the contactnets form.
    """

    form: Form
    blocks: tuple[Block, ...]
    chart: Array
    gauge: Array
    tilt_axes: Array

    @property
    def size(self) -> int:
        """P."""
        return int(self.chart.shape[1])

    def names(self) -> tuple[str, ...]:
        """P names, e.g. ``vertices_normal[2][0]``, in the order of theta."""
        widths = {"vertices_normal": 3, "vertices_tangent": 3, "tangents": 3}
        listed: list[str] = []
        for block in self.blocks:
            width = widths.get(block.name)
            for k in range(block.size):
                place = f"[{k // width}][{k % width}]" if width else (f"[{k}]" if block.size > 1 else "")
                listed.append(block.name + place)
        return tuple(listed)


def is_physical(geometry: ContactGeometry) -> bool:
    """Whether the normal is a unit vector and the tangents are one friction coefficient times an orthonormal pair across it."""
    friction = float(np.linalg.norm(geometry.tangents[0]))
    if not friction > 0.0:
        return False
    frame = np.vstack([geometry.normal, geometry.tangents / friction])  # rounding errors are shares of the friction
    return bool(np.abs(frame @ frame.T - np.eye(3)).max() < PHYSICAL_TOLERANCE)


def form_of_geometry(geometry: ContactGeometry) -> Form:
    """The form that a theta has by itself: rigid where it knows its noise, else physical where it can be."""
    if geometry.noise is not None:
        return Form.RIGID
    return Form.PHYSICAL if is_physical(geometry) else Form.CONTACTNETS


def parameter_form(geometry: ContactGeometry, form: Form) -> ParameterForm:
    """Theta of `geometry` in `form`.

    Raises:
        InvalidValueError: the physical form is wanted of a geometry that is not (see `is_physical`), or the rigid one of a
            geometry with two sets of vertices; or another one of a geometry that has a restitution.
    """
    if geometry.restitution is not None and form is not Form.RIGID:
        raise InvalidValueError("form", form.value, "rigid, since the parameters have a restitution")
    if form is Form.CONTACTNETS:
        return _contactnets_form(geometry)
    if not is_physical(geometry):
        raise InvalidValueError(
            "parameters", f"a normal of length {np.linalg.norm(geometry.normal):.6g} or tangents that are not orthogonal",
            "a unit normal and one friction coefficient, as the physical form has; use the contactnets form",
        )  # fmt: skip
    physical = _physical_form(geometry)
    return physical if form is Form.PHYSICAL else _rigid_form(geometry, physical)


def _contactnets_form(geometry: ContactGeometry) -> ParameterForm:
    own = 3 * geometry.vertex_count
    blocks = (Block("vertices_normal", own), Block("normal", 3), Block("vertices_tangent", own), Block("tangents", 6))
    size = 2 * own + 9
    turn = np.zeros((1, size))
    turn[0, -6:] = np.concatenate([geometry.tangents[1], -geometry.tangents[0]])
    turn /= np.linalg.norm(turn)
    chart = np.eye(size + 1)[:, :size] @ (np.eye(size) - turn.T @ turn)
    return ParameterForm(Form.CONTACTNETS, blocks, chart, turn, np.zeros((0, 3)))


def _physical_form(geometry: ContactGeometry) -> ParameterForm:
    own = 3 * geometry.vertex_count
    blocks = (
        Block("vertices_normal", own),
        Block("vertices_tangent", own),
        Block("friction", 1),
        Block("tilt", 2),
        Block("height", 1),
    )
    friction = float(np.linalg.norm(geometry.tangents[0]))
    axes = geometry.tangents / friction
    normal, vertices_tangent, tangents, height = own, own + 3, 2 * own + 3, 2 * own + 9
    chart = np.zeros((2 * own + 10, 2 * own + 4))
    chart[:own, :own] = np.eye(own)
    chart[vertices_tangent:tangents, own : 2 * own] = np.eye(own)
    chart[tangents:height, 2 * own] = geometry.tangents.ravel()
    for axis in range(2):
        column = 2 * own + 1 + axis
        chart[normal : normal + 3, column] = axes[axis]
        chart[tangents + 3 * axis : tangents + 3 * axis + 3, column] = -friction * geometry.normal
    chart[height, -1] = 1.0
    return ParameterForm(Form.PHYSICAL, blocks, chart, np.zeros((0, 2 * own + 4)), axes)


def _rigid_form(geometry: ContactGeometry, physical: ParameterForm) -> ParameterForm:
    """The physical form along the directions in which both sets of vertices move alike."""
    apart = float(np.abs(geometry.vertices_normal - geometry.vertices_tangent).max())
    if apart > 0.0:
        raise InvalidValueError(
            "vertices_tangent",
            f"up to {apart:.3g} from vertices_normal",
            "the same, as the rigid form has; or the physical form",
        )
    own = 3 * geometry.vertex_count
    together = np.vstack([np.eye(own, own + 4), np.eye(own + 4)])
    blocks = tuple(block for block in physical.blocks if block.name != "vertices_tangent")
    chart = physical.chart @ together
    if geometry.restitution is not None:
        blocks = (blocks[0], Block("restitution", 1), *blocks[1:])
        chart = np.insert(np.vstack([chart, np.zeros(chart.shape[1])]), own, 0.0, axis=1)
        chart[-1, own] = 1.0
    return ParameterForm(Form.RIGID, blocks, chart, np.zeros((0, chart.shape[1])), physical.tilt_axes)


def moved_geometry(geometry: ContactGeometry, form: ParameterForm, step: Array) -> ContactGeometry:
    """The geometry with theta of its physical or rigid form changed by `step` (P,).

    Lengths add, friction is multiplied, and the ground turns with the tilt.
    """
    change = form.chart @ step
    own, tangents = 3 * geometry.vertex_count, 6 * geometry.vertex_count + 3
    place = form.names().index("friction")
    friction = np.linalg.norm(geometry.tangents[0])
    turned = tilt_turn(*step[place + 1 : place + 3].tolist())[0] @ np.vstack([geometry.normal, geometry.tangents / friction])
    bounce = geometry.restitution
    return replace(
        geometry,
        vertices_normal=geometry.vertices_normal + change[:own].reshape(-1, 3),
        normal=turned[0],
        vertices_tangent=geometry.vertices_tangent + change[own + 3 : tangents].reshape(-1, 3),
        tangents=friction * np.exp(step[place]) * turned[1:],
        height=geometry.height + float(step[-1]),
        restitution=None if bounce is None else float(np.clip(bounce + change[-1], 0.0, 1.0)),
    )


def tilt_turn(a: float, b: float) -> tuple[Array, Array]:
    """Q (3, 3), which turns the ground's frame by a tilt t = (a, b), and its derivatives (2, 3, 3) by it.

    The rows of the frame are the normal and the two tilt axes; contact/models/polytope.py has the formula.
    """
    size = math.sqrt(1.0 + a * a + b * b)
    u, c = 1.0 / size, 1.0 / (size * (size + 1.0))
    turn = [[u, u * a, u * b], [-u * a, 1.0 - c * a * a, -c * a * b], [-u * b, -c * a * b, 1.0 - c * b * b]]
    by_size = -(2.0 * size + 1.0) * c * c  # of c
    ua, ub, ca, cb = -a * u**3, -b * u**3, by_size * a * u, by_size * b * u  # of u and c, by a and by b
    along_a, along_b, cross_a, cross_b = ua * a + u, ub * b + u, ca * a * b + c * b, cb * a * b + c * a
    by_a = [[ua, along_a, ua * b], [-along_a, -ca * a * a - 2.0 * c * a, -cross_a], [-ua * b, -cross_a, -ca * b * b]]
    by_b = [[ub, ub * a, along_b], [-ub * a, -cb * a * a, -cross_b], [-along_b, -cross_b, -cb * b * b - 2.0 * c * b]]
    return np.array(turn), np.array([by_a, by_b])
