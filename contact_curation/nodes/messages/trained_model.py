"""ModelParameters of any model; apart from the polytope's own, so that scoring a polytope needs no torch."""

from contact_curation_msgs.msg import ModelParameters

from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.information.network.scoring import NetworkScorer
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.checkpoints.stored_model import model_bytes, model_of_bytes
from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.nodes.messages.model_parameters import bytes_of_geometry


def theta_bytes(model: Model) -> bytes:
    """What ModelParameters carries: of a polytope its geometry, of a network all of it."""
    return bytes_of_geometry(model.geometry()) if isinstance(model, PolytopeModel) else model_bytes(model)


def model_message(model: Model, version: str, gradient_steps: int, stamped: Stamped) -> ModelParameters:
    """A model as the trainer publishes it."""
    return ModelParameters(
        format_version=ModelParameters.FORMAT_VERSION,
        header=header_message(stamped),
        body=model.body.name,
        model=model.kind.value,
        version=version,
        gradient_steps=gradient_steps,
        safetensors=theta_bytes(model),
    )


def network_scorer(kind: str, data: bytes, body: Body, config: ScoringConfig) -> NetworkScorer:
    """What scores tosses for the network in `data`.

    Raises:
        InvalidValueError: bytes that are no such network, or one for another body.
    """
    try:
        model = model_of_bytes(data, "model_parameters", body)
    except UnreadableInputError as error:
        raise InvalidValueError("parameters", f"none ({error})", f"a {kind} for body {body.name}") from error
    if model.kind.value != kind or isinstance(model, PolytopeModel):
        raise InvalidValueError("model in the parameters", model.kind.value, kind)
    return NetworkScorer(model, config)  # type: ignore[arg-type]  # a model that is no polytope is a network
