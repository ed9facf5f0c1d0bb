"""Theta as the scorer takes and keeps it: the bytes that ModelParameters carries, and the scorer that they make.

torch is imported for a network only: a polytope is scored without.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.kind import ModelKind
from contact_curation.errors import InvalidValueError
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.nodes.messages.model_parameters import bytes_of_geometry, geometry_of_bytes
from contact_curation.storage.parameters_file import Parameters, read_theta


class ScoredTheta(NamedTuple):
    """Theta of any model.

    Attributes:
        model: its kind's name.
        data: safetensors; a polytope's geometry, or all of a network.
    """

    model: str
    data: bytes


class TossScorer(Protocol):
    """What scores tosses, for a polytope or a network."""

    @property
    def version(self) -> str:
        """Of theta."""

    @property
    def blocks(self) -> tuple[ParameterBlock, ...]:
        """Of theta's parameters."""

    def score(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        """What each toss teaches."""


def theta_of_geometry(geometry: ContactGeometry) -> ScoredTheta:
    """A polytope's."""
    return ScoredTheta(ModelKind.POLYTOPE.value, bytes_of_geometry(geometry))


def read_scored_theta(path: Path, body: Body) -> tuple[ScoredTheta, Body]:
    """Theta in a JSON file, or in a checkpoint of any model, and the body that it is for.

    Raises:
        UnreadableInputError, InvalidValueError: the file holds no theta.
    """
    theta = read_theta(path, body)
    if isinstance(theta, Parameters):
        return theta_of_geometry(theta.geometry), theta.body
    from contact_curation.nodes.messages.trained_model import theta_bytes

    return ScoredTheta(theta.kind.value, theta_bytes(theta)), body


def scorer_of(theta: ScoredTheta, body: Body, config: ScoringConfig) -> TossScorer:
    """What scores tosses of a body at theta.

    Raises:
        InvalidValueError: an unknown model, or bytes that are none of it.
    """
    if theta.model == ModelKind.POLYTOPE:
        return Scorer(geometry_of_bytes(theta.data), body, config)
    if theta.model not in {kind.value for kind in ModelKind}:
        raise InvalidValueError("model of the parameters", repr(theta.model), ", ".join(kind.value for kind in ModelKind))
    from contact_curation.nodes.messages.trained_model import network_scorer

    return network_scorer(theta.model, theta.data, body, config)
