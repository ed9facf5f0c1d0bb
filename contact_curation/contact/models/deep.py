"""Deep: a polytope and, on top of it, networks that bend its gaps and their tangential counterparts.

    phi(q)   = phi_poly(q)   + 0.05 NN_n(x, vec R)        12-256-256-V tanh
    phi_t(q) = phi_t,poly(q) + 0.05 NN_t(x, vec R)        12-256-256-2V tanh

It is the equation that the paper gives for its "DeepVertex", and what ContactNets' code calls ``deep`` (METHOD 1.1, A1); for a
cube and the contactnets form it has the published 144,465 parameters.

The networks see x in characteristic lengths in the board's frame, as ContactNets' do. So, unlike the polytope, the model knows
where on the board the body is and where it points: nothing makes it invariant to translations and turns of the board, and it
must be used in the frame in which it was trained.
"""

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.models.model import BatchLoss, ContactModel, Rows, over_finite_rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.pose_streams import pose_inputs, twist_tangents
from contact_curation.contact.models.stream_network import LayerTrace, StreamNetwork
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.scale_regularizer import scale_regularizer
from contact_curation.contact.torch_contacts import Contacts, Frames
from contact_curation.contact.torch_loss import contact_losses

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
        InvalidValueError: as `PolytopeModel`.
    """

    kind = ModelKind.DEEP

    def __init__(self, geometry: ContactGeometry, body: Body, form: Form) -> None:
        super().__init__(body)
        self.polytope = PolytopeModel(geometry, body, form)
        self.normal_network = StreamNetwork((12, *HIDDEN, geometry.vertex_count))
        self.tangent_network = StreamNetwork((12, *HIDDEN, 2 * geometry.vertex_count))

    def initialise(self, rng: np.random.Generator) -> "DeepModel":
        """The networks as published, from `rng`."""
        self.normal_network.initialise(rng)
        self.tangent_network.initialise(rng)
        return self

    def batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        return over_finite_rows(rows, lambda finite: self._batch_loss(finite, config))

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

    def _batch_loss(self, rows: Rows, config: LossConfig) -> BatchLoss:
        frames = Frames.of(self.body, *rows)
        contacts = self.contacts(frames)
        losses, solved = contact_losses(contacts, frames, config)
        return BatchLoss(losses, solved, scale_regularizer(contacts.jacobians[solved]))

    def _bends(self, inputs: Tensor, rotations: Tensor, tape: list[LayerTrace] | None) -> tuple[Tensor, Tensor]:
        """What the networks add to gaps (B, S, V) at inputs (B, S, 12), and to Jacobians (B, V, 3, 6) at the first."""
        tangents = twist_tangents(rotations)
        gaps, by_twist = self.normal_network(inputs, tangents, tape)  # (B, S, V), (B, 6, V)
        _, sideways = self.tangent_network(inputs[:, :1], tangents, tape)  # (B, 6, 2V)
        rows = torch.cat([by_twist[..., None], sideways.unflatten(-1, (-1, 2))], dim=-1)  # (B, 6, V, 3)
        return NETWORK_SHARE * gaps, NETWORK_SHARE * rows.permute(0, 2, 3, 1)
