"""The body that a checkpoint, a manifest or a file of throws carries, so that no verb asks for it twice."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.files import path_of
from contact_curation.storage.manifest.file import FORMATS, read_manifest
from contact_curation.storage.parameters_file import is_checkpoint
from contact_curation.storage.throws_file import read_throws_body

ASSUMED = f"ContactNets' cube ({CONTACTNETS_CUBE.mass:g} kg, {1e3 * float(max(CONTACTNETS_CUBE.vertices[:, 0]) * 2.0):.0f} mm)"
"""What is assumed where no body is known."""


class CarriedBody(NamedTuple):
    """A body and the file that it comes from."""

    body: Body
    source: str


type GivenBody = Body | str | PathLike[str]
"""A body, or the path of a file that `Body.from_file` reads."""


def body_of(given: GivenBody) -> Body:
    """The body, or that of the file.

    Raises:
        InvalidValueError: it is neither a body nor a path.
        UnreadableInputError: as of `Body.from_file`.
    """
    return given if isinstance(given, Body) else Body.from_file(path_of("body", given, "a Body, or the path of its file"))


def carried_body(
    models: Sequence[Path] = (),
    manifest: Path | None = None,
    throws: Path | None = None,
    given: CarriedBody | None = None,
    known: Sequence[CarriedBody] = (),
) -> CarriedBody | None:
    """The body that files are about.

    Args:
        models: checkpoints; JSON files of a polytope carry none.
        manifest: of a ranking; older ones carry none.
        throws: as `design` writes them; likewise.
        given: what the user says it is; it wins by its name, and must have the numbers of the others.
        known: bodies of what is in memory.

    Returns:
        The body; None where no file carries one, and none is given.

    Raises:
        InvalidValueError: two of them are not the same body.
        UnreadableInputError: a file is not what it should be.
    """
    found = [] if given is None else [given]
    found += [CarriedBody(_of_checkpoint(path), str(path)) for path in models if is_checkpoint(path)]
    if manifest is not None and manifest.suffix in FORMATS and (body := _of_manifest(manifest)):
        found.append(CarriedBody(body, str(manifest)))
    if throws is not None and (body := read_throws_body(throws)):
        found.append(CarriedBody(body, str(throws)))
    found += known
    for other in found[1:]:
        if name := found[0].body.first_difference(other.body):
            remedy = f": leave out {given.source}" if given else ""
            raise InvalidValueError(
                f"body of {found[0].source}",
                f"{found[0].body.name!r}, not the {other.body.name!r} of {other.source} (other {name})",
                f"the same body{remedy}",
            )
    return found[0] if found else None


def _of_manifest(path: Path) -> Body | None:
    told = read_manifest(path).run.body
    try:
        return Body.from_mapping(told) if told else None
    except ContactCurationError as error:
        raise UnreadableInputError(path, f"its body cannot be used: {error}") from error


def _of_checkpoint(path: Path) -> Body:
    from contact_curation.storage.checkpoint_file import read_body  # imports torch, which takes over a second

    return read_body(path)
