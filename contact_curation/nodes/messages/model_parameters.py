"""Translates ModelParameters, the theta of any model; only a model to be sent needs torch."""

from typing import TYPE_CHECKING, Any

from contact_curation_msgs.msg import ModelParameters

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.nodes.messages.headers import Stamped, check_format, header_message
from contact_curation.stages.scored_theta import ScoredTheta, theta_of_model

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model


def model_message(model: "Model", version: str, gradient_steps: int, stamped: Stamped) -> ModelParameters:
    """A model as the trainer publishes it."""
    return ModelParameters(
        format_version=ModelParameters.FORMAT_VERSION,
        header=header_message(stamped),
        body=model.body.name,
        model=model.kind,
        version=version,
        gradient_steps=gradient_steps,
        safetensors=theta_of_model(model).data,
    )


def theta_in(message: Any, body: Body) -> ScoredTheta:
    """Reads theta; its bytes are not looked into.

    Raises:
        InvalidValueError: the format is newer, or theta is for another body.
    """
    check_format(message)
    if message.body != body.name:
        raise InvalidValueError("body of the parameters", message.body, body.name)
    return ScoredTheta(message.model, bytes(message.safetensors))
