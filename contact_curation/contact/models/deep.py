"""Deep: a polytope and, on top of it, networks that bend its gaps and their tangential counterparts.

    phi(q)   = phi_poly(q)   + 0.05 NN_n(x, vec R)        12-256-256-V tanh
    phi_t(q) = phi_t,poly(q) + 0.05 NN_t(x, vec R)        12-256-256-2V tanh

It is the equation that the paper gives for its "DeepVertex", and what ContactNets' code calls ``deep`` (method.md 1.1, A1); for
a cube and the contactnets form it has the published 144,465 parameters.

The networks see x in characteristic lengths in the board's frame, as ContactNets' do. So, unlike the polytope, the model knows
where on the board the body is and where it points: nothing makes it invariant to translations and turns of the board, and it
must be used in the frame in which it was trained.
"""

from collections.abc import Mapping
from typing import Self

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.descent import DescentTask, KernelDescent
from contact_curation.contact.compiled.network_descent import DescentParts, network_descent
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.defaults import ModelDefaults
from contact_curation.contact.models.explicit_parameters import ExplicitParameters
from contact_curation.contact.models.model import ContactModel, Rows, setting
from contact_curation.contact.models.polytope import PolytopeModel, below_centroid, initial_geometry
from contact_curation.contact.models.stream_network import LayerTrace, StreamNetwork, pose_inputs, twist_tangents
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.torch_contacts import Contacts, Frames
from contact_curation.contact.torch_loss import scale_regularizer
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array

NETWORK_SHARE = 0.05
"""What the networks' outputs are multiplied with."""

HIDDEN = (256, 256)


class DeepModel(ContactModel):
    """A polytope bent by two networks; they are zero, and the model is its polytope, until they are initialised or loaded.

    Args:
        geometry: the polytope to begin with.
        body: mass, inertia and gravity.
        form: which numbers of the polytope are trained.

    Raises:
        InvalidValueError: as `PolytopeModel`, or the form is rigid: residuals of a network are of one variance.
    """

    kind = "deep"
    defaults = ModelDefaults(batch=64)

    def __init__(self, geometry: ContactGeometry, body: Body, form: Form) -> None:
        super().__init__(body)
        if form is Form.RIGID:
            raise InvalidValueError("form of the polytope in a deep model", form.value, "physical or contactnets")
        self.polytope = PolytopeModel(geometry, body, form)
        self.normal_network = StreamNetwork((12, *HIDDEN, geometry.vertex_count))
        self.tangent_network = StreamNetwork((12, *HIDDEN, 2 * geometry.vertex_count))

    @classmethod
    def initial(cls, body: Body, form: Form, data: Rows, rng: np.random.Generator) -> Self:
        return cls(initial_geometry(body, form, below_centroid(data), rng), body, form).initialise(rng)

    @classmethod
    def blank(cls, settings: Mapping[str, str], body: Body) -> Self:
        return cls(ContactGeometry.of_body(body), body, setting(settings, "form", Form))

    def initialise(self, rng: np.random.Generator) -> Self:
        """The networks as published, from `rng`."""
        self.normal_network.initialise(rng)
        self.tangent_network.initialise(rng)
        return self

    def contacts(self, frames: Frames, tape: list[LayerTrace] | None = None) -> Contacts:
        """As `ContactModel.contacts`; a tape takes the layers of the normal's network, then those of the tangents'."""
        poses = [(frames.rotations, frames.positions), (frames.rotations_next, frames.positions_next)]
        inputs = torch.stack([pose_inputs(*pose) for pose in poses], dim=1)  # (B, 2, 12)
        bends, jacobians = self._bends(inputs, frames.rotations, tape)
        plain = self.polytope.contacts(frames)
        return Contacts(plain.gaps + bends[:, 0], plain.gaps_next + bends[:, 1], plain.jacobians + jacobians)

    def contacts_at(self, rotations: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
        bends, bent = self._bends(pose_inputs(rotations, positions)[:, None], rotations, None)
        gaps, jacobians = self.polytope.contacts_at(rotations, positions)
        return gaps + bends[:, 0], jacobians + bent

    def settings(self) -> dict[str, str]:
        return self.polytope.settings()

    def regularizer(self, jacobians: Tensor) -> Tensor:
        return scale_regularizer(jacobians)

    def explicit_parameters(self) -> ExplicitParameters:
        return self.polytope.explicit_parameters()

    def place(self) -> Array:
        return self.polytope.place()

    def kernel_descent(self, task: DescentTask) -> KernelDescent | None:
        """The kernel knows the polytope's published form."""
        if self.polytope.form is not Form.CONTACTNETS:
            return None
        geometry = self.polytope.geometry()
        return network_descent(
            DescentParts(self.kind, self.body, geometry, self.networks, NETWORK_SHARE, polytope="polytope"), task
        )

    def _bends(self, inputs: Tensor, rotations: Tensor, tape: list[LayerTrace] | None) -> tuple[Tensor, Tensor]:
        """What the networks add to gaps (B, S, V) at inputs (B, S, 12), and to Jacobians (B, V, 3, 6) at the first."""
        tangents = twist_tangents(rotations)
        gaps, by_twist = self.normal_network(inputs, tangents, tape)  # (B, S, V), (B, 6, V)
        _, sideways = self.tangent_network(inputs[:, :1], tangents, tape)  # (B, 6, 2V)
        rows = torch.cat([by_twist[..., None], sideways.unflatten(-1, (-1, 2))], dim=-1)  # (B, 6, V, 3)
        return NETWORK_SHARE * gaps, NETWORK_SHARE * rows.permute(0, 2, 3, 1)
