"""A polytope's theta as safetensors bytes: arrays by name and nothing else, so that reading them runs no code.

Keys are those of DESIGN 6: vertices_normal (V, 3), normal (3), vertices_tangent (V, 3), tangents (2, 3), friction included, and
where the ground is not through the origin pivot (3) and height (1); all in characteristic lengths. In the rigid form also
impulse_noise (2), growth and power.
"""

from dataclasses import astuple

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.errors import InvalidValueError
from contact_curation.solver.cone_problem import MAX_CONTACTS

REQUIRED = ("vertices_normal", "normal", "vertices_tangent", "tangents")
NOISE = "impulse_noise"
RESTITUTION = "restitution"
OPTIONAL = ("pivot", "height", NOISE, RESTITUTION)
LARGEST_BYTES = 1 << 20
"""Far more than the vertices of any body take."""
LARGEST_NUMBER = 1e6
"""[characteristic lengths]: of a vertex, or of the board's place; of a direction likewise."""


def geometry_of_bytes(data: bytes) -> ContactGeometry:
    """The polytope in safetensors bytes.

    Raises:
        InvalidValueError: bytes that are no safetensors, or arrays that are no polytope of at most `MAX_CONTACTS` vertices.
    """
    if len(data) > LARGEST_BYTES:
        raise InvalidValueError("parameters", f"{len(data)} bytes", f"at most {LARGEST_BYTES}")
    try:
        arrays = load(data)
    except (SafetensorError, KeyError, ValueError) as error:
        raise InvalidValueError("parameters", f"no safetensors ({error})", "arrays as safetensors bytes") from error
    if not set(REQUIRED) <= set(arrays) <= {*REQUIRED, *OPTIONAL}:
        expected = f"{', '.join(REQUIRED)} and optionally {', '.join(OPTIONAL)}"
        raise InvalidValueError("parameters", f"arrays {', '.join(sorted(arrays)) or 'none'}", expected)
    numbers = {name: np.asarray(array, dtype=float) for name, array in arrays.items()}
    height, noise = numbers.pop("height", np.zeros(1)), numbers.pop(NOISE, np.zeros(0))
    restitution = numbers.pop(RESTITUTION, None)
    if height.size != 1:
        raise InvalidValueError("height", f"shape {height.shape}", "one number")
    if restitution is not None and restitution.size != 1:
        raise InvalidValueError(RESTITUTION, f"shape {restitution.shape}", "one number")
    if noise.shape not in ((0,), (2,)):
        raise InvalidValueError(NOISE, f"shape {noise.shape}", "two numbers")
    for name, values in {**numbers, "height": height}.items():
        if not (np.abs(values) <= LARGEST_NUMBER).all():
            raise InvalidValueError(name, "a number that is not finite or too large", f"at most {LARGEST_NUMBER:g}")
    if len(numbers["vertices_normal"]) > MAX_CONTACTS:
        raise InvalidValueError("vertices of the parameters", len(numbers["vertices_normal"]), f"at most {MAX_CONTACTS}")
    return ContactGeometry(
        **numbers,
        height=float(height.ravel()[0]),
        noise=ImpulseNoise(*noise.tolist()) if noise.size else None,
        restitution=None if restitution is None else float(restitution.ravel()[0]),
    )


def bytes_of_geometry(geometry: ContactGeometry) -> bytes:
    """A polytope as safetensors bytes; `geometry_of_bytes` gives it back bit for bit."""
    arrays = {name: np.ascontiguousarray(getattr(geometry, name)) for name in (*REQUIRED, "pivot")}
    arrays["height"] = np.array([geometry.height])
    if geometry.noise is not None:
        arrays[NOISE] = np.array(astuple(geometry.noise))
    if geometry.restitution is not None:
        arrays[RESTITUTION] = np.array([geometry.restitution])
    return bytes(save(arrays))
