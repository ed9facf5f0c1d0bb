"""Theta from whatever file a user names: a polytope's JSON, or a checkpoint of any model.

torch takes over a second to import; it is imported to read a checkpoint only.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from contact_curation.contact.body import Body
from contact_curation.errors import UnreadableInputError
from contact_curation.storage.parameters_file import Parameters, read_parameters

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model

CHECKPOINT = ".safetensors"


def is_checkpoint(path: Path) -> bool:
    """Whether a file is read as a checkpoint; any other is read as JSON."""
    return path.suffix == CHECKPOINT


def read_theta(path: Path, body: Body) -> "Parameters | Model":
    """A polytope's numbers out of JSON, or the model of a checkpoint.

    Args:
        path: of the file.
        body: which a checkpoint must be for, and which completes what JSON leaves out.

    Raises:
        UnreadableInputError, InvalidValueError: the file holds neither.
    """
    if not is_checkpoint(path):
        try:
            return read_parameters(path, body)
        except UnreadableInputError as error:
            if not path.is_file():
                raise
            why = str(error).removeprefix(f"{path}: ")
            raise UnreadableInputError(path, f"{why}; or a checkpoint, a {CHECKPOINT} file") from error
    from contact_curation.storage.checkpoint_file import read_model

    return read_model(path, body)
