"""Theta as the scorer takes and keeps it: the bytes that ModelParameters carries, and the scorer that they make.

torch is imported for a network only: a polytope is scored without.
"""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.registry import DEFAULT_MODEL, MODELS
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.information.network.model_scorer import TossScorer, scorer_of_model
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry, geometry_of_bytes
from contact_curation.storage.parameters_file import Parameters, read_theta
from contact_curation.storage.stores.state import States

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


OF_BODY = "body of theta"
"""What the digest of the body is kept under that the theta in a store is of."""


def forget_theta_of_another_body(states: States, body: Body, *keys: str) -> None:
    """Empties the values under some keys of a store, if they are of another body; those of an unknown body stay."""
    own, known = body.digest.encode(), states.load(OF_BODY)
    if known != own:
        states.save({OF_BODY: own} | ({} if known is None else dict.fromkeys(keys, b"")))


def theta_of_geometry(geometry: ContactGeometry) -> ScoredTheta:
    """A polytope's."""
    return ScoredTheta(DEFAULT_MODEL, bytes_of_geometry(geometry))


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
    from contact_curation.learning.checkpoints.stored_model import model_bytes

    geometry = model.geometry()
    return ScoredTheta(model.kind, model_bytes(model) if geometry is None else bytes_of_geometry(geometry))


def scorer_of(theta: ScoredTheta, body: Body, config: ScoringConfig) -> TossScorer:
    """What scores tosses of a body at theta.

    Raises:
        InvalidValueError: an unknown model, or bytes that are none of it.
    """
    if theta.model not in MODELS:
        raise InvalidValueError("model of the parameters", repr(theta.model), ", ".join(MODELS))
    if MODELS[theta.model].is_geometry:
        return Scorer(geometry_of_bytes(theta.data), body, config)
    return _network_scorer(theta, body, config)


def polytope_of(theta: ScoredTheta) -> ContactGeometry:
    """The polytope that theta is.

    Raises:
        InvalidValueError: it is a network's, whose motions are not predicted without it, or no theta.
    """
    if theta.model not in MODELS or not MODELS[theta.model].is_geometry:
        raise InvalidValueError("model to design throws with", repr(theta.model), DEFAULT_MODEL)
    return geometry_of_bytes(theta.data)


def _network_scorer(theta: ScoredTheta, body: Body, config: ScoringConfig) -> TossScorer:
    from contact_curation.learning.checkpoints.stored_model import model_of_bytes

    try:
        model = model_of_bytes(theta.data, "model_parameters", body)
    except UnreadableInputError as error:
        raise InvalidValueError("parameters", f"none ({error})", f"a {theta.model} for body {body.name}") from error
    if model.kind != theta.model:
        raise InvalidValueError("model in the parameters", model.kind, theta.model)
    return scorer_of_model(model, config)
