"""A model as bytes and back: its tensors, its kind and settings, and the constants of the body that it is for."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.registry import model_class
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.checkpoints.safetensors_bytes import Packed, pack, unpack

LAST, BEST = "model/", "best/"
"""What the names of a model's tensors begin with: those it had last, and those of its lowest held-out loss where they count."""

MALFORMED = (KeyError, TypeError, ValueError, AttributeError, OverflowError, InvalidValueError)
"""What reading a document of another form than ours can end in."""


def model_bytes(model: Model, notes: dict[str, str] | None = None) -> bytes:
    """A model alone, without a training.

    Args:
        model: of any kind.
        notes: whatever else the reader should know.
    """
    return pack(named(LAST, model.tensors()), {"model": description(model), "notes": notes or {}})


def model_of_bytes(data: bytes, source: Path | str, body: Body | None = None, last: bool = False) -> Model:
    """The model in the bytes of a model or of a checkpoint.

    Args:
        data: untrusted.
        source: where they come from, for the message.
        body: which it must be for; None takes the body as stored.
        last: the last parameters of a checkpoint even where the best count.

    Raises:
        UnreadableInputError: no such bytes, or a model for another body.
    """
    return model_of_packed(unpack(data, source), source, body, last)


def body_of_bytes(data: bytes, source: Path | str) -> Body:
    """The body that a model or a checkpoint is for; errors as of `model_of_bytes`."""
    try:
        return Body.from_mapping(unpack(data, source).documents["model"]["body"])
    except MALFORMED as error:
        raise UnreadableInputError(source, f"holds no model ({type(error).__name__}: {error})") from error


def notes_of_bytes(data: bytes, source: Path | str) -> dict[str, str]:
    """The notes that were stored with a model or a checkpoint."""
    notes = unpack(data, source).documents.get("notes", {})
    if not isinstance(notes, dict):
        raise UnreadableInputError(source, f"found notes of type {type(notes).__name__}, expected named texts")
    return {str(name): str(text) for name, text in notes.items()}


def model_of_packed(packed: Packed, source: Path | str, body: Body | None, last: bool) -> Model:
    """As `model_of_bytes`, once they are read."""
    tensors = named_back(LAST, packed.arrays) if last else named_back(BEST, packed.arrays) or named_back(LAST, packed.arrays)
    try:
        told = packed.documents["model"]
        kind, settings = model_class(told["kind"]), {str(name): str(value) for name, value in told["settings"].items()}
        own = Body.from_mapping(told["body"])
        _check_body(own, body, source)
        return kind.of_tensors(settings, tensors, body or own)
    except MALFORMED as error:
        raise UnreadableInputError(source, f"holds no model ({type(error).__name__}: {error})") from error


def description(model: Model) -> dict[str, object]:
    """What `model_of_packed` needs beside the tensors."""
    return {"kind": model.kind, "settings": model.settings(), "body": model.body.to_mapping()}


def named(prefix: str, arrays: dict[str, Array]) -> dict[str, NDArray[Any]]:
    """The arrays with a prefix to their names."""
    return {prefix + name: array for name, array in arrays.items()}


def named_back(prefix: str, arrays: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The arrays that have the prefix, without it."""
    return {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}


def _check_body(found: Body, expected: Body | None, source: Path | str) -> None:
    if expected is not None and (other := found.first_difference(expected)):
        raise UnreadableInputError(
            source,
            f"is for the body {found.name!r}, whose {other} differs from that of the body {expected.name!r} in use: give the "
            "body that it is for; a command without --body takes it from the file",
        )
