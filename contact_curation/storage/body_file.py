"""Writes a body as a file that simulators and `--body` read: MJCF, URDF with its mesh, or YAML."""

from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.contact.body_writers import FORMATS, MESH, written_body
from contact_curation.errors import InvalidValueError
from contact_curation.files import write_atomically
from contact_curation.geometry.numbers import number
from contact_curation.storage.outputs import sealed
from contact_curation.storage.saved_path import saved_path


def body_paths(path: Path) -> list[Path]:
    """The files that describe a body: the mesh of a URDF, and the file itself, which is written last."""
    return [path.with_suffix(MESH), path] if path.suffix == ".urdf" else [path]


def write_body(path: str | Path, body: Body, *, restitution: float | None = None, overwrite: bool = False) -> tuple[str, ...]:
    """Writes a body as MJCF (``.xml``), URDF (``.urdf``, with its mesh beside it as ``.obj``) or YAML (``.yaml``).

    The shape is the convex hull of the body's vertices, in the frame that the tracker follows: read as `body`, the file
    describes the same body.

    Args:
        path: of the file.
        body: the object, such as that of `LearnedModel.learned_body`.
        restitution: of its impacts, such as `LearnedModel.restitution`, for the notes; None where it is not known.
        overwrite: whether to replace any file that is there; without it, only one that was written so and not edited since.

    Returns:
        What the format has no place for, one line each; the file has the same lines as comments.

    Raises:
        InvalidValueError: another ending, a restitution that is not from 0 to 1, a file is there that must not be replaced, or
            the file cannot be written.

    Examples:
        >>> cc.write_body("cube.yaml", body)
        ()
        >>> cc.write_body("cube.xml", body)
        ('length scale 0.0524 m is not in the file: the format has none',)
    """
    if not isinstance(body, Body):
        raise InvalidValueError("body", repr(body), "a Body, such as Body.from_file reads")
    if restitution is not None:
        restitution = number("restitution", restitution)
        if not 0.0 <= restitution <= 1.0:
            raise InvalidValueError("restitution", restitution, "a number from 0 to 1")
    path = saved_path(path, FORMATS, overwrite=overwrite)
    for beside in body_paths(path)[:-1]:
        saved_path(beside, (MESH,), overwrite=overwrite)
    written = written_body(body, path.suffix, path.stem, restitution)
    for ending, text in written.texts.items():
        write_atomically(path.with_suffix(ending), sealed(text.encode(), ending))
    return written.notes
