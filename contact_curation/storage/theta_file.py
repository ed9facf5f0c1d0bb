"""A polytope's theta from a JSON file or from a checkpoint."""

from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.errors import UnreadableInputError
from contact_curation.storage.parameters_file import Parameters, read_parameters

CHECKPOINT = ".safetensors"


def read_theta(path: Path, body: Body) -> Parameters:
    """The polytope in a file.

    Args:
        path: a checkpoint if it ends in .safetensors, else JSON.
        body: which a checkpoint must be for; in JSON it is completed.

    Raises:
        UnreadableInputError: no such file, or one of another model.
        InvalidValueError: see `read_parameters`.
    """
    if path.suffix != CHECKPOINT:
        return read_parameters(path, body)
    from contact_curation.contact.polytope_model import PolytopeModel  # torch takes over a second, which JSON need not wait for
    from contact_curation.storage.checkpoint_file import read_model

    model = read_model(path, body)
    if not isinstance(model, PolytopeModel):
        raise UnreadableInputError(path, f"holds the model {model.kind.value}, expected a polytope")
    return Parameters(model.geometry(), model.body)
