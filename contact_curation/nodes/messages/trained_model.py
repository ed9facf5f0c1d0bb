"""ModelParameters of any model; apart from the polytope's own, so that scoring a polytope needs no torch."""

from contact_curation_msgs.msg import ModelParameters

from contact_curation.contact.model import Model
from contact_curation.contact.polytope_model import PolytopeModel
from contact_curation.learning.stored_model import model_bytes
from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.nodes.messages.model_parameters import bytes_of_geometry


def model_message(model: Model, version: str, gradient_steps: int, stamped: Stamped) -> ModelParameters:
    """A model as the trainer publishes it: a polytope by its geometry, a network by all its tensors."""
    data = bytes_of_geometry(model.geometry()) if isinstance(model, PolytopeModel) else model_bytes(model)
    return ModelParameters(
        header=header_message(stamped),
        body=model.body.name,
        model=model.kind.value,
        version=version,
        gradient_steps=gradient_steps,
        safetensors=data,
    )
