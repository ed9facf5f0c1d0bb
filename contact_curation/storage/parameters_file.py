"""Reads theta from a file: a polytope's parameters in JSON, or a checkpoint of any model.

The JSON object, in characteristic units, as `rank` and `score` take it:

    {"vertices_normal": Vx3, "normal": 3, "vertices_tangent": Vx3, "tangents": 2x3}     the tangents contain the friction

and, if they differ from the body's, "mass" [kg], "inertia" [kg times squared characteristic length; a number, 3, or 3x3] and
"length_scale" [m], the characteristic length itself.

torch takes over a second to import; it is imported for checkpoints only.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.body_values import LARGEST, is_measurable
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import check_version, read_json
from contact_curation.geometry.numbers import has_other
from contact_curation.geometry.quaternions import Array

if TYPE_CHECKING:
    from contact_curation.contact.models.model import Model


REQUIRED = ("vertices_normal", "normal", "vertices_tangent", "tangents")
OPTIONAL = ("mass", "inertia", "length_scale")
VERSION = 1
"""Newest version of the JSON format; a file without the key "version" has the first version."""
LARGEST_BYTES = 1 << 20
"""Largest accepted file [bytes], far more than 64 vertices take."""


class Parameters(NamedTuple):
    """A theta and its body."""

    geometry: ContactGeometry
    body: Body


def read_parameters(path: Path, body: Body) -> Parameters:
    """Reads the parameters of a polytope from a JSON file.

    Args:
        path: path of the JSON file.
        body: body whose mass, inertia and length scale are used if the file has none.

    Raises:
        UnreadableInputError: the file does not exist, or contains no JSON object.
        InvalidValueError: a key is missing or unknown, or has an invalid value.
    """
    return parameters_from_mapping(_json_object(path), body, str(path))


def parameters_from_mapping(data: dict[str, Any], body: Body, name: str) -> Parameters:
    """Makes parameters from parsed JSON, as `read_parameters` does from a file; error messages begin with `name`."""
    _check_keys(data, name)
    points = (len(body.vertices), 3)
    vertices_normal, vertices_tangent = (_numbers(data, key, name, points) for key in ("vertices_normal", "vertices_tangent"))
    normal, tangents = _numbers(data, "normal", name, (3,)), _numbers(data, "tangents", name, (2, 3))
    if not normal.any():
        raise InvalidValueError(f"{name}: normal", "the zero vector", "a direction")
    return Parameters(ContactGeometry(vertices_normal, normal, vertices_tangent, tangents), _body_with(data, body, name))


def _json_object(path: Path) -> dict[str, Any]:
    data = read_json(path, LARGEST_BYTES, f"a JSON object with {_accepted()}")
    if not isinstance(data, dict):
        raise UnreadableInputError(path, f"holds a JSON {type(data).__name__}, expected an object with {_accepted()}")
    check_version(path, "parameters", data.pop("version", 1), VERSION)
    return data


def _accepted() -> str:
    return f"the keys {', '.join(REQUIRED)} (optionally {', '.join(OPTIONAL)})"


def _check_keys(data: dict[str, Any], name: str) -> None:
    missing = [key for key in REQUIRED if key not in data]
    unknown = sorted(set(data) - {*REQUIRED, *OPTIONAL})
    if missing or unknown:
        found = [f"no {', '.join(missing)}"] * bool(missing) + [f"unknown {', '.join(unknown)[:80]}"] * bool(unknown)
        raise InvalidValueError(name, " and ".join(found), _accepted())


def _numbers(data: dict[str, Any], key: str, name: str, *shapes: tuple[int, ...]) -> Array:
    """The array under `key`, which must have one of the accepted shapes; texts and booleans are refused."""
    expected = "finite numbers, " + " or ".join("x".join(map(str, shape)) or "a single one" for shape in shapes)
    try:
        array = np.asarray(data[key])
    except ValueError as error:
        raise InvalidValueError(f"{name}: {key}", "rows of different lengths", expected) from error
    if array.dtype.kind not in "iuf" or has_other(data[key]):
        raise InvalidValueError(f"{name}: {key}", repr(data[key])[:60], expected)
    if array.shape not in shapes:
        raise InvalidValueError(f"{name}: {key}", f"shape {array.shape}", expected)
    if not np.isfinite(array).all():
        raise InvalidValueError(f"{name}: {key}", "a value that is not finite", expected)
    if np.abs(array).max(initial=0.0) > LARGEST:
        raise InvalidValueError(f"{name}: {key}", f"{np.abs(array).max():.3g}", f"{expected}, at most {LARGEST:g}")
    return array.astype(float)


def _body_with(data: dict[str, Any], body: Body, name: str) -> Body:
    """The body with the mass, inertia and length scale of the file."""
    mass = _positive(data, "mass", name) if "mass" in data else body.mass
    length_scale = _positive(data, "length_scale", name) if "length_scale" in data else body.length_scale
    inertia = _inertia(data, name) * length_scale**2 if "inertia" in data else body.inertia
    return replace(body, mass=mass, length_scale=length_scale, inertia=inertia)


def _positive(data: dict[str, Any], key: str, name: str) -> float:
    value = float(_numbers(data, key, name, ()))
    if not is_measurable(value):
        raise InvalidValueError(f"{name}: {key}", value, "a positive number")
    return value


def _inertia(data: dict[str, Any], name: str) -> Array:
    """The inertia (3, 3) in kg times squared characteristic length."""
    given = _numbers(data, "inertia", name, (), (3,), (3, 3))
    inertia = given if given.ndim == 2 else np.diag(np.broadcast_to(given, 3))
    if not np.allclose(inertia, inertia.T) or np.linalg.eigvalsh(inertia).min() <= 0.0:
        raise InvalidValueError(f"{name}: inertia", given.tolist(), "a positive definite matrix")
    return inertia


CHECKPOINT = ".safetensors"


def is_checkpoint(path: Path) -> bool:
    """Whether a file is read as a checkpoint; any other is read as JSON."""
    return path.suffix == CHECKPOINT


def read_theta(path: Path, body: Body) -> "Parameters | Model":
    """Reads a polytope's parameters from JSON, or the model of a checkpoint.

    Args:
        path: path of the file.
        body: body of the checkpoint, which must be the same; for JSON it completes missing values.

    Raises:
        UnreadableInputError, InvalidValueError: the file contains neither, or is for another body.
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
