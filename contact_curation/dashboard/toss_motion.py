"""A toss as measured and as predicted from its release, with the impulses at the parameters."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.rollout import rollout
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import periods_of, states_of, transitions_of

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model

SMALLEST_SHARE = 0.02
"""Impulses below this share of the toss's largest are not shown."""


@dataclass(frozen=True, eq=False)
class ShownTheta:
    """Theta of any model.

    Attributes:
        version: its digest.
        geometry: geometry of a polytope; None of a network.
        model: model of a network; None of a polytope, which needs no torch.
    """

    version: str
    geometry: ContactGeometry | None = None
    model: "Model | None" = None


@dataclass(frozen=True, eq=False)
class Impulses:
    """M impulses of the board on the body.

    Attributes:
        frames: (M,) numbers of the frames that they lead to.
        places: (M, 3) [m] in the board's frame.
        vectors: (M, 3) [N s] in the board's frame.
    """

    frames: NDArray[np.int64]
    places: Array
    vectors: Array


@dataclass(frozen=True, eq=False)
class TossMotion:
    """What the view of a toss shows; SI units, the board's frame.

    Attributes:
        toss: toss as measured.
        predicted: (T, 13) states from the measured release on; NaN from where they are not finite.
        impulses: by the loss's inner problem at theta; none for a network.
        vertices: (V, 3) [m] of the body as theta has it.
        version: version of theta.
    """

    toss: Toss
    predicted: Array
    impulses: Impulses
    vertices: Array
    version: str

    @property
    def position_error(self) -> float:
        """Mean distance of the predicted centre from the measured one [m]; NaN where the prediction is not finite."""
        return float(np.linalg.norm(self.predicted[:, :3] - self.toss.positions, axis=1).mean())


def motion_of(toss: Toss, body: Body, theta: ShownTheta, loss: LossConfig) -> TossMotion:
    """The motion of a toss.

    Raises:
        InvalidValueError: theta cannot be rolled out.
    """
    scale = body.length_scale
    start, periods = states_of(toss, scale)[:1], periods_of(toss)
    length = int(periods[-1]) + 1
    geometry = theta.geometry
    if geometry is None:
        assert theta.model is not None
        states = theta.model.roll_out(start, length, toss.frame_period).states
    else:
        states = rollout(geometry, body, start, length, toss.frame_period).states
    predicted = states[periods] * np.concatenate([np.full(3, scale), np.ones(4), np.full(3, scale), np.ones(3)])
    vertices = body.vertices if geometry is None else geometry.vertices_normal * scale
    return TossMotion(toss, predicted, impulses_of(toss, body, geometry, loss), vertices, theta.version)


def impulses_of(toss: Toss, body: Body, geometry: ContactGeometry | None, loss: LossConfig) -> Impulses:
    """The impulses of a toss at a polytope's parameters, over the transitions that are scored; unsolved ones have none."""
    if geometry is None:
        return Impulses(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    rows = as_described(transitions_of([toss], body.length_scale), geometry, body)
    found = evaluate(geometry, body, rows.before, rows.after, rows.dt, loss)
    axes = np.vstack([geometry.normal, geometry.tangents])  # (3, 3) friction included
    vectors = np.where(found.solved[:, None, None], found.impulses, 0.0) @ axes * body.length_scale  # (N, V, 3) [N s]
    sizes = np.linalg.norm(vectors, axis=2)
    transition, vertex = np.nonzero(sizes > SMALLEST_SHARE * max(float(sizes.max(initial=0.0)), np.finfo(float).tiny))
    corners = quaternions.rotate(rows.after[transition, 3:7], geometry.vertices_normal[vertex])
    places = (rows.after[transition, :3] + corners) * body.length_scale
    return Impulses(np.asarray(transition + 1), places, vectors[transition, vertex])
