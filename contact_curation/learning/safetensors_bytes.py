"""Named arrays and JSON documents as the bytes of one safetensors file; reading executes nothing.

The documents are strings of the header's metadata, beside them a digest of everything, so that a damaged file is told from a
whole one even where only numbers were damaged.
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

from contact_curation.errors import UnreadableInputError

FORMAT = "contact_curation.model/1"
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
    texts = {name: json.dumps(documents[name], sort_keys=True, allow_nan=False) for name in sorted(documents)}
    packed: bytes = safetensors.numpy.save(whole, {"format": FORMAT, "digest": _digest(whole, texts), **texts})
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
    if metadata.get("format") != FORMAT:
        raise UnreadableInputError(source, f"found format {str(metadata.get('format'))[:60]}, expected {FORMAT}")
    texts = {name: text for name, text in metadata.items() if name not in ("format", "digest")}
    if metadata.get("digest") != _digest(arrays, texts):
        raise UnreadableInputError(source, "is damaged: its content does not have the digest that it was written with")
    try:
        return Packed(arrays, {name: json.loads(text) for name, text in texts.items()})
    except (ValueError, RecursionError) as error:
        raise UnreadableInputError(source, f"holds no JSON in its header ({error})") from error


def _digest(arrays: Arrays, texts: Mapping[str, str]) -> str:
    shapes = {name: [array.dtype.str, *array.shape] for name, array in sorted(arrays.items())}
    state = hashlib.sha256(json.dumps([shapes, sorted(texts.items())]).encode())
    for name in sorted(arrays):
        state.update(np.ascontiguousarray(arrays[name]).tobytes())
    return state.hexdigest()
