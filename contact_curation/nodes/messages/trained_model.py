"""Makes ModelParameters messages of any model."""

from contact_curation_msgs.msg import ModelParameters

from contact_curation.contact.models.model import Model
from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.stages.scored_theta import theta_of_model


def model_message(model: Model, version: str, gradient_steps: int, stamped: Stamped) -> ModelParameters:
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
