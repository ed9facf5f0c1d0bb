"""Theta as the scorer takes and keeps it: the bytes that ModelParameters carries, and the scorer that they make.

torch is imported for a network only: a polytope is scored without.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.kind import ModelKind
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry, geometry_of_bytes
from contact_curation.motion.toss import Toss
from contact_curation.storage.parameters_file import Parameters, read_theta

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model


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
    return theta_of_model(theta), body


def theta_of_model(model: "Model") -> ScoredTheta:
    """A model's: of a polytope its geometry, of a network all of it."""
    from contact_curation.contact.models.polytope import PolytopeModel
    from contact_curation.learning.checkpoints.stored_model import model_bytes

    data = bytes_of_geometry(model.geometry()) if isinstance(model, PolytopeModel) else model_bytes(model)
    return ScoredTheta(model.kind.value, data)


def scorer_of(theta: ScoredTheta, body: Body, config: ScoringConfig) -> TossScorer:
    """What scores tosses of a body at theta.

    Raises:
        InvalidValueError: an unknown model, or bytes that are none of it.
    """
    if theta.model == ModelKind.POLYTOPE:
        return Scorer(geometry_of_bytes(theta.data), body, config)
    if theta.model not in {kind.value for kind in ModelKind}:
        raise InvalidValueError("model of the parameters", repr(theta.model), ", ".join(kind.value for kind in ModelKind))
    return _network_scorer(theta, body, config)


def polytope_of(theta: ScoredTheta) -> ContactGeometry:
    """The polytope that theta is.

    Raises:
        InvalidValueError: it is a network's, whose motions are not predicted without it, or no theta.
    """
    if theta.model != ModelKind.POLYTOPE:
        raise InvalidValueError("model to design throws with", repr(theta.model), ModelKind.POLYTOPE.value)
    return geometry_of_bytes(theta.data)


def _network_scorer(theta: ScoredTheta, body: Body, config: ScoringConfig) -> TossScorer:
    from contact_curation.contact.models.polytope import PolytopeModel
    from contact_curation.information.network.scoring import NetworkScorer
    from contact_curation.learning.checkpoints.stored_model import model_of_bytes

    try:
        model = model_of_bytes(theta.data, "model_parameters", body)
    except UnreadableInputError as error:
        raise InvalidValueError("parameters", f"none ({error})", f"a {theta.model} for body {body.name}") from error
    if model.kind.value != theta.model or isinstance(model, PolytopeModel):
        raise InvalidValueError("model in the parameters", model.kind.value, theta.model)
    return NetworkScorer(model, config)  # type: ignore[arg-type]  # a model that is no polytope is a network
