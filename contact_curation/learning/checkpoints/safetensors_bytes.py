"""Named arrays and JSON documents as the bytes of one safetensors file; reading executes nothing.

The documents are text in the header's metadata, beside them a digest of everything, so that a damaged file is told from a whole
one even where only numbers were damaged.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import safetensors
import safetensors.numpy
from numpy.typing import NDArray

from contact_curation.errors import NewerVersionError, UnreadableInputError

NAME, VERSION = "contact_curation.model", 1
FORMAT = f"{NAME}/{VERSION}"
LARGEST_BYTES = 1 << 28
"""Far more than four copies of the largest network take."""

Arrays = Mapping[str, NDArray[Any]]


class Packed(NamedTuple):
    """What a file holds: arrays by name, and documents by name."""

    arrays: dict[str, NDArray[Any]]
    documents: dict[str, Any]


def pack(arrays: Arrays, documents: Mapping[str, object]) -> bytes:
    """The bytes of a file; the same content gives the same bytes."""
    whole = {name: np.ascontiguousarray(arrays[name]).reshape(arrays[name].shape) for name in sorted(arrays)}
    text = json.dumps(documents, sort_keys=True, allow_nan=False)
    header = json.dumps({"digest": _digest(whole, text), "documents": text})
    packed: bytes = safetensors.numpy.save(whole, {FORMAT: header})  # one entry: the library writes several in any order
    return packed


def unpack(data: bytes, source: Path | str) -> Packed:
    """The content of such bytes.

    Args:
        data: untrusted.
        source: where they come from, for the message.

    Raises:
        UnreadableInputError: they are too large, damaged, or something else.
    """
    if len(data) > LARGEST_BYTES:
        raise UnreadableInputError(source, f"holds {len(data)} bytes, expected at most {LARGEST_BYTES}")
    try:
        arrays = safetensors.numpy.load(data)
        metadata = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")]).get("__metadata__", {})
    except (safetensors.SafetensorError, ValueError, KeyError, RecursionError) as error:
        raise UnreadableInputError(source, f"is no safetensors file of numbers ({error})") from error
    if FORMAT not in metadata:
        for name, _, number in (key.rpartition("/") for key in metadata):
            if name == NAME and number.isdecimal() and int(number[:9]) > VERSION:
                raise NewerVersionError(source, "a checkpoint or a model", int(number[:9]), VERSION)
        raise UnreadableInputError(source, f"found metadata {', '.join(metadata)[:60] or 'of no kind'}, expected {FORMAT}")
    try:
        header = json.loads(metadata[FORMAT])
        digest, text = header["digest"], str(header["documents"])
        documents = dict(json.loads(text))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise UnreadableInputError(source, f"holds no JSON in its header ({error})") from error
    if digest != _digest(arrays, text):
        raise UnreadableInputError(source, "is damaged: its content does not have the digest that it was written with")
    return Packed(arrays, documents)


def _digest(arrays: Arrays, text: str) -> str:
    shapes = {name: [array.dtype.str, *array.shape] for name, array in sorted(arrays.items())}
    state = hashlib.sha256(json.dumps([shapes, text]).encode())
    for name in sorted(arrays):
        state.update(np.ascontiguousarray(arrays[name]).tobytes())
    return state.hexdigest()
