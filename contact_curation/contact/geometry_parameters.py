"""The polytope's parameters theta: contact vertices, plane and friction (method.md 1.1), in characteristic lengths.

    phi_i(q)  = n . (R p_i + x - pivot) - height        gap of vertex i, 1
    phi_t,i(q) = T (R p^t_i + x)                         its place on the board times friction, 2

The friction coefficient is inside T. Pivot and height are zero in the 57-parameter form; the centred form uses them.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

UPWARD: Array = np.array([0.0, 0.0, 1.0])

INITIAL_NOISE = 0.4
"""Standard deviation of the published initialisation, in half widths and as a share of the friction (method.md 1.1)."""

INITIAL_RESTITUTION, RESTITUTION_SPREAD = 0.2, 0.4
"""Where one that is learned begins, and the standard deviation of what is known of it beforehand."""


@dataclass(frozen=True, eq=False)
class ContactGeometry:
    """A polytope over a plane.

    Attributes:
        vertices_normal: (V, 3) p_i in the body's frame, V >= 1.
        normal: (3,) n in the board's frame; its length scales the gap.
        vertices_tangent: (V, 3) p^t_i in the body's frame.
        tangents: (2, 3) T in the board's frame, friction coefficient included.
        pivot: (3,) point of the board about which n tilts.
        height: gap of the pivot, negated.
        noise: how the residuals' variance grows with impacts, of a theta in the rigid form (`parameter_form`); None for others,
            whose residuals all count as of one variance.
        restitution: e, from 0 to 1: the share of the speed of approach with which a contact parts; None where impacts do not
            bounce and nothing is learned of it. Only the rigid form has it.
    """

    vertices_normal: Array
    normal: Array
    vertices_tangent: Array
    tangents: Array
    pivot: Array = field(default_factory=lambda: np.zeros(3))
    height: float = 0.0
    noise: ImpulseNoise | None = None
    restitution: float | None = None

    def __post_init__(self) -> None:
        count = np.shape(self.vertices_normal)[0] if np.ndim(self.vertices_normal) == 2 else 0
        if count < 1:
            raise InvalidValueError("vertices_normal", f"shape {np.shape(self.vertices_normal)}", "(V, 3) with V >= 1")
        points = (count, 3)
        shapes = {"vertices_normal": points, "normal": (3,), "vertices_tangent": points, "tangents": (2, 3), "pivot": (3,)}
        for name, shape in shapes.items():
            value = np.ascontiguousarray(getattr(self, name), dtype=float)
            if value.shape != shape:
                raise InvalidValueError(name, f"shape {value.shape}", f"{shape}")
            if not np.isfinite(value).all():
                raise InvalidValueError(name, "a value that is not finite", "finite numbers")
            object.__setattr__(self, name, value)
        if not np.isfinite(self.height):
            raise InvalidValueError("height", self.height, "a finite number")
        if self.restitution is not None and not 0.0 <= self.restitution <= 1.0:
            raise InvalidValueError("restitution", self.restitution, "a number from 0 to 1")
        if not self.normal.any():
            raise InvalidValueError("normal", "the zero vector", "a direction")

    @staticmethod
    def of_body(body: Body) -> "ContactGeometry":
        """The body as its user described it, on the plane z = 0."""
        vertices = body.scaled_vertices
        return ContactGeometry(vertices, UPWARD, vertices, body.friction * np.eye(2, 3))

    @property
    def has_own_friction_vertices(self) -> bool:
        """Whether friction acts at other points than those that touch."""
        return not np.array_equal(self.vertices_normal, self.vertices_tangent)

    @property
    def friction(self) -> float:
        """The friction coefficient: the geometric mean where directions differ.

        A contact pushes with n l_n + T^T l_t, |l_t| <= l_n, so that friction is |T| / |n|.
        """
        return float(np.sqrt(np.linalg.svd(self.tangents, compute_uv=False).prod()) / np.linalg.norm(self.normal))

    def as_body(self, described: Body) -> Body:
        """A body with these vertices and this friction; all else is as described."""
        return replace(described, vertices=described.length_scale * self.vertices_normal, friction=self.friction)

    @property
    def is_rigid(self) -> bool:
        """Whether it is a theta of the rigid form, whose spin precesses in the air as that of a rigid body (method.md 1.2)."""
        return self.noise is not None

    def rigid(self) -> "ContactGeometry":
        """As a theta of the rigid form: with the usual noise of impacts where none was learned yet."""
        return self if self.noise else replace(self, noise=ImpulseNoise())

    @property
    def vertex_count(self) -> int:
        """V."""
        return int(self.vertices_normal.shape[0])

    @property
    def kernel_size(self) -> int:
        """Q: by how many numbers the kernel differentiates (contact/parameter_form.py)."""
        return 6 * self.vertex_count + 10 + (self.restitution is not None)

    def gaps(self, states: Array) -> Array:
        """Gaps phi (..., V) of states (..., 13)."""
        normal_in_body = np.einsum("...ji,j->...i", quaternions.to_matrix(states[..., 3:7]), self.normal)
        offset = (states[..., :3] - self.pivot) @ self.normal - self.height
        return np.asarray(normal_in_body @ self.vertices_normal.T + offset[..., None])
