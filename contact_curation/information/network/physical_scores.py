"""Scores by the parameters of the polytope inside a deep model: its shape, friction and ground (METHOD 2.7).

A deep model's gaps and Jacobians are its polytope's plus its networks', so that slopes by the sum are slopes by the polytope's
own contacts. There are a few dozen parameters, with names and units, and everything that holds for a polytope's information
holds.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import ParameterForm, parameter_form
from contact_curation.contact.torch_contacts import Frames, Theta, contacts_of
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import sheared
from contact_curation.information.record import ParameterBlock


@dataclass(frozen=True, eq=False)
class PhysicalScores:
    """The polytope of a model, at its theta.

    Attributes:
        theta: it.
        form: how it is parameterised.
    """

    theta: Theta
    form: ParameterForm

    @staticmethod
    def of(polytope: PolytopeModel) -> "PhysicalScores":
        geometry = polytope.geometry()
        return PhysicalScores(Theta.of(geometry), parameter_form(geometry, polytope.form))

    @cached_property
    def blocks(self) -> tuple[ParameterBlock, ...]:
        """Of the form's parameters."""
        edges = np.cumsum([0, *(block.size for block in self.form.blocks)]).tolist()
        return tuple(ParameterBlock(block.name, *span) for block, span in zip(self.form.blocks, pairwise(edges)))

    def rows(self, frames: Frames, slopes: tuple[Tensor, ...], centroid: Array) -> Array:
        """Scores (n, B, P), the ground's tilt taken about `centroid` (3,), from slopes (n, B, ...) by contacts."""
        each = self.theta.vector().repeat(len(frames.dt), 1).requires_grad_()  # (B, Q)
        contacts = contacts_of(self.theta.with_vector(each), frames)
        (found,) = torch.autograd.grad(contacts, each, slopes, is_grads_batched=True)
        rows = found.numpy() @ self.form.chart
        axes = self.form.tilt_axes
        if not axes.size:
            return np.asarray(rows)
        return sheared(rows, self.blocks, axes @ (centroid - self.theta.pivot.numpy()))
