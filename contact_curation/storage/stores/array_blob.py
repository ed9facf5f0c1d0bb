"""Named arrays as one blob: a JSON list of what is in it, then the raw little-endian numbers. Nothing is ever executed.

uint32 length of the list | [[name, dtype, shape], ...] as JSON | the arrays, one behind the other
"""

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError

LENGTH = struct.Struct("<I")
DTYPES = ("<f8", "<i8", "<f4")
"""float64, int64 and float32: all that records hold."""


def arrays_to_blob(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """The blob of `arrays`; equal arrays in equal order give equal bytes.

    Raises:
        InvalidValueError: an array is of another dtype than `DTYPES`.
    """
    listed, parts = [], []
    for name, array in arrays.items():
        dtype = array.dtype.newbyteorder("<").str
        if dtype not in DTYPES:
            raise InvalidValueError(f"dtype of {name}", array.dtype, "float64, int64 or float32")
        listed.append([name, dtype, list(array.shape)])
        parts.append(np.ascontiguousarray(array, dtype=dtype).tobytes())
    head = json.dumps(listed, separators=(",", ":")).encode()
    return b"".join([LENGTH.pack(len(head)), head, *parts])


def arrays_from_blob(blob: bytes) -> dict[str, Any]:
    """The arrays of a blob, writable and in the machine's byte order.

    Raises:
        InvalidValueError: `blob` is not what `arrays_to_blob` gave.
    """
    arrays: dict[str, Any] = {}
    try:
        (length,) = LENGTH.unpack_from(blob)
        position = LENGTH.size + length
        for name, dtype, shape in json.loads(blob[LENGTH.size : position]):
            if dtype not in DTYPES or any(size < 0 for size in shape):
                raise ValueError(f"{name} of type {dtype} and shape {shape}")
            count = math.prod(shape)
            values = np.frombuffer(blob, dtype, count, position)
            arrays[name] = values.astype(values.dtype.newbyteorder("=")).reshape(shape)
            position += values.nbytes
    except (struct.error, ValueError, TypeError) as error:
        raise InvalidValueError("array blob", error, "a list of arrays and their numbers") from error
    if position != len(blob):
        raise InvalidValueError("array blob", f"{len(blob)} bytes", f"{position} bytes")
    return arrays
