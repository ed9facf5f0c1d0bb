"""The polytope as a model to train, in either form of theta (METHOD 1.1).

``contactnets`` trains the published 57 numbers and needs a regulariser that keeps the normal's scale in place
(`scale_regularizer`); ``physical`` trains vertices, the tilt of a unit normal about a pivot, one friction coefficient by its
logarithm, and the ground's height.
"""

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.models.model import BatchLoss, ContactModel, Rows
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.contact.scale_regularizer import scale_excess
from contact_curation.contact.tilted_plane import tilted_plane
from contact_curation.contact.torch_contacts import Contacts, Frames, Theta, contacts_of, gaps_at, jacobians_at
from contact_curation.contact.torch_loss import polytope_losses
from contact_curation.geometry.quaternions import Array

INITIAL_NOISE = 0.4
"""Standard deviation of the published initialisation, in half widths and as a share of the friction (METHOD 1.1)."""


class PolytopeModel(ContactModel):
    """A polytope over a plane.

    Args:
        geometry: theta to begin with.
        body: mass, inertia and gravity.
        form: which numbers are trained.

    Raises:
        InvalidValueError: the physical form is wanted of a geometry that is not (`parameter_form.is_physical`).
    """

    kind = ModelKind.POLYTOPE

    def __init__(self, geometry: ContactGeometry, body: Body, form: Form) -> None:
        super().__init__(body)
        parameter_form(geometry, form)  # refuses what has no such form
        self.form = form
        theta = Theta.of(geometry)
        self.vertices_normal = torch.nn.Parameter(theta.vertices_normal)
        self.vertices_tangent = torch.nn.Parameter(theta.vertices_tangent)
        self.register_buffer("pivot", theta.pivot)
        if form is Form.CONTACTNETS:
            self.normal = torch.nn.Parameter(theta.normal)
            self.tangents = torch.nn.Parameter(theta.tangents)
            self.register_buffer("height", theta.height)
            return
        friction = theta.tangents[0].norm()
        self.log_friction = torch.nn.Parameter(friction.log())
        self.tilt = torch.nn.Parameter(torch.zeros(2, dtype=torch.float64))
        self.height = torch.nn.Parameter(theta.height)
        self.register_buffer("frame", torch.cat([theta.normal[None], theta.tangents / friction]))

    def theta(self) -> Theta:
        """The polytope, differentiable by the parameters."""
        pivot, height = self.get_buffer("pivot"), torch.as_tensor(self.height)
        if self.form is Form.CONTACTNETS:
            return Theta(self.vertices_normal, self.normal, self.vertices_tangent, self.tangents, height, pivot)
        normal, tangents = tilted_plane(self.tilt, self.log_friction, self.get_buffer("frame"))
        return Theta(self.vertices_normal, normal, self.vertices_tangent, tangents, height, pivot)

    def geometry(self) -> ContactGeometry:
        """The polytope's numbers."""
        return self.theta().geometry()

    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        theta = self.theta()
        losses, solved = polytope_losses(theta, self.body, *rows, config)
        return BatchLoss(losses, solved, self._regularizer(theta))

    def contacts(self, frames: Frames) -> Contacts:
        return contacts_of(self.theta(), frames)

    def contacts_at(self, rotations: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        theta = self.theta()
        return gaps_at(theta, rotations, positions), jacobians_at(theta, rotations)

    def settings(self) -> dict[str, str]:
        return {"form": self.form.value}

    @property
    def rubs_elsewhere(self) -> bool:
        """Whether friction acts at other vertices than those that the gaps depend on."""
        return not torch.equal(self.vertices_normal, self.vertices_tangent)

    def rubbing_where_it_touches(self) -> "PolytopeModel":
        """The same with friction at the vertices of the gaps, as of a rigid body; those of its own are forgotten.

        Where the two were learned apart, it predicts motion better (docs/results.md).
        """
        geometry = self.geometry()
        return PolytopeModel(replace(geometry, vertices_tangent=geometry.vertices_normal), self.body, self.form)

    def _regularizer(self, theta: Theta) -> Tensor:
        if self.form is Form.PHYSICAL:
            return torch.zeros((), dtype=torch.float64)
        return len(theta.vertices_normal) * scale_excess(theta.normal, theta.tangents)  # the same at every contact


def initial_geometry(
    body: Body, form: Form, pivot: Array, rng: np.random.Generator, noise: float = INITIAL_NOISE
) -> ContactGeometry:
    """ContactNets' random initialisation about the body as described (METHOD 1.1).

    Args:
        body: whose corners and friction are known up to noise.
        form: in the physical one the normal tilts by the noise [rad] and friction is noisy by a factor.
        pivot: (3,) of the plane z = 0, about which the physical form's ground tilts; amid the data, tilt and height keep apart.
        rng: where the noise comes from; the same seed gives the same vertices in both forms.
        noise: standard deviation, in characteristic lengths and as a share of friction.
    """
    corners = body.scaled_vertices
    own, tangent = (corners + noise * rng.standard_normal(corners.shape) for _ in range(2))
    if form is Form.CONTACTNETS:
        normal = UPWARD + noise * rng.standard_normal(3)
        return ContactGeometry(own, normal, tangent, body.friction * (np.eye(2, 3) + noise * rng.standard_normal((2, 3))))
    model = PolytopeModel(ContactGeometry(own, UPWARD, tangent, body.friction * np.eye(2, 3), pivot), body, form)
    with torch.no_grad():
        for value in (model.tilt, model.log_friction, model.height):
            value.add_(torch.as_tensor(noise * rng.standard_normal(tuple(value.shape))))
    return model.geometry()
