"""The options for the body: a file, values that it does not contain, or a checkpoint or manifest that contains the body."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.cli.options.types import number_from_zero, place, positive_number
from contact_curation.cli.report import warn
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.body_description import BodyDescription, BodyOptions, read_description
from contact_curation.errors import InvalidValueError

BODY_HELP = (
    "the object: a YAML file like contact_curation/config/cube.yaml, a URDF, an MJCF, or a mesh (STL, OBJ, PLY, OFF) "
    "(default: that of a checkpoint, a manifest or a file of throws, where the verb is given one, else ContactNets' cube)"
)
DETAILS = ("mass", "density", "friction", "length_scale", "mesh_scale", "link", "body_name", "center_of_mass")


def add_body_option(parser: argparse.ArgumentParser, *others: str, details: bool = True) -> None:
    """Adds `--body`, with further names, and with `details` the options for values that the file does not contain."""
    parser.add_argument("--body", *others, dest="body", type=Path, metavar="FILE", help=BODY_HELP)
    if details:
        add_body_details(parser.add_argument_group("the object, where its file does not say (or keys of the YAML file)"))


def add_body_details(group: argparse._ArgumentGroup) -> None:
    """Adds the options for values that the file of a body does not contain."""
    weights = group.add_mutually_exclusive_group()
    weights.add_argument("--mass", type=positive_number, metavar="KG", help="mass; an inertia of the file is scaled with it")
    weights.add_argument("--density", type=positive_number, metavar="KG/M^3", help="in place of a mass, of filled geometry")
    group.add_argument("--friction", type=number_from_zero, metavar="MU", help="Coulomb coefficient to begin with")
    group.add_argument(
        "--length-scale",
        type=positive_number,
        metavar="M",
        help="unit of length of the loss (default: half the edge of a cube of the same volume)",
    )
    group.add_argument("--mesh-scale", type=positive_number, metavar="S", help="metres in a unit of the mesh: 0.001 for mm")
    group.add_argument("--link", metavar="NAME", help="of a URDF or MJCF with several links")
    group.add_argument("--body-name", metavar="NAME", help="in topics, frames and ids of tosses (default: by the file)")
    group.add_argument(
        "--center-of-mass", type=place, metavar="X,Y,Z", help="in the frame that the tracker follows [m]; the shape stays"
    )


def body_description(path: Path, arguments: argparse.Namespace) -> BodyDescription:
    """Reads the body of a file, with the values of the options.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    return read_description(path, _options(arguments))


def body_words(arguments: argparse.Namespace) -> list[str]:
    """The body options that were given, as words for another verb's command line."""
    given = {name: getattr(arguments, name, None) for name in ("body", *DETAILS)}
    center = given.pop("center_of_mass")
    options = {f"--{name.replace('_', '-')}": str(value) for name, value in given.items() if value is not None}
    words = [word for option in options.items() for word in option]
    return [*words, f"--center-of-mass={','.join(map(repr, map(float, center)))}"] if center is not None else words


def chosen_body(
    arguments: argparse.Namespace,
    *,
    models: Sequence[Path | None] = (),
    manifest: Path | None = None,
    throws: Path | None = None,
    said: bool = True,
) -> Body:
    """The body of the option's file, else that of a file that contains one, else ContactNets' cube, which is noted.

    Args:
        arguments: arguments with the options.
        models: checkpoints or JSON files; None for those that were not given.
        manifest: manifest of a ranking.
        throws: throws as `design` writes them.
        said: whether a line reports that the cube is assumed.

    Raises:
        ContactCurationError: a file cannot be used, or two files contain different bodies.
    """
    from contact_curation.pipeline.carried_body import ASSUMED, CarriedBody, carried_body

    given = None
    if arguments.body is not None:
        description = body_description(arguments.body, arguments)
        warn([f"{arguments.body}: {line}" for line in description.warnings])
        given = CarriedBody(Body.described(description), f"--body {arguments.body}")
    elif unused := [name for name in DETAILS[:-1] if getattr(arguments, name, None) is not None]:
        raise InvalidValueError(f"--{unused[0].replace('_', '-')}", "no --body", "--body FILE, which it belongs to")
    found = carried_body([path for path in models if path is not None], manifest, throws, given)
    if found is None and said:
        arguments.assumed = f"no --body given: assuming {ASSUMED}"  # reported at the end of the verb
    body = CONTACTNETS_CUBE if found is None else found.body
    center = getattr(arguments, "center_of_mass", None)
    return body if center is None or given is not None else body.about(center)


def _options(arguments: argparse.Namespace) -> BodyOptions:
    names: dict[str, str] = {**{name: name for name in DETAILS}, "mesh_scale": "scale", "body_name": "name"}
    told: dict[str, Any] = {own: getattr(arguments, name, None) for name, own in names.items()}
    if told["center_of_mass"] is not None:
        told["center_of_mass"] = np.array(told["center_of_mass"])
    return BodyOptions(**told)
