"""The registry of models, a line each. A class is imported when it is used: a polytope is read and scored without torch."""

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from contact_curation.errors import UnknownNameError

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model


class ModelEntry(NamedTuple):
    """Module and class of a model, and properties that are needed without an import.

    Attributes:
        module: file in this folder.
        name: of the class.
        is_geometry: whether theta is a `ContactGeometry` and nothing else; such a model needs no torch to be read, scored,
            rolled out and shown, and has a theta before it is trained, the body as described.
    """

    module: str
    name: str
    is_geometry: bool = False


DEFAULT_MODEL = "polytope"

MODELS = {
    "polytope": ModelEntry("polytope", "PolytopeModel", is_geometry=True),
    "deep": ModelEntry("deep", "DeepModel"),
    "deepvertex": ModelEntry("deepvertex", "DeepvertexModel"),
    "end_to_end": ModelEntry("end_to_end", "EndToEndModel"),
}
"""By the names on the command line, in messages and in files."""


def model_entry(name: str) -> ModelEntry:
    """The line of a model.

    Raises:
        InvalidValueError: there is no such model.
    """
    if name not in MODELS:
        raise UnknownNameError("model", name, MODELS)
    return MODELS[name]


def model_class(name: str) -> "type[Model]":
    """The class of a model; imports torch.

    Raises:
        InvalidValueError: there is no such model.
    """
    entry = model_entry(name)
    found: type[Model] = getattr(import_module(f"{__package__}.{entry.module}"), entry.name)
    return found
