"""`body FILE`: prints what was understood of an object: its shape, its mass properties, and unusual values."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.cli.options.body import add_body_details, body_description
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.types import PathEndingIn
from contact_curation.cli.report import add_json_option, print_json
from contact_curation.contact.body import Body
from contact_curation.contact.body_description import BodyDescription
from contact_curation.dashboard.figures.body import BodyPicture, save_body_figure


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Says what was understood of an object. Its file is YAML like contact_curation/config/cube.yaml, URDF, MJCF, or a mesh "
        "(STL, OBJ, PLY, OFF), which YAML may name, too: `mesh: brick.stl`, `mass: 0.3`, `friction: 0.2`, `scale: 0.001`. "
        "Vertices are given about the centre of mass, in the axes of the file."
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="file that describes the object")
    add_body_details(parser.add_argument_group("where the file does not say"))
    parser.add_argument("--out", type=PathEndingIn(".png"), metavar="FIGURE.png", help="figure of the object to draw")
    add_overwrite_option(parser)
    add_json_option(parser)
    parser.set_examples(
        "contact-curation body brick.yaml --out brick.png",
        "contact-curation body brick.stl --mesh-scale 0.001 --mass 0.3 --friction 0.2",
        "contact-curation body robot.urdf --link base_link --json",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads the file, prints what was understood, and draws it.

    Raises:
        ContactCurationError: the file describes no body, or the figure cannot be written.
    """
    check_outputs(overwrite=arguments.overwrite, out=arguments.out)
    found = body_description(arguments.file, arguments)
    body = Body.described(found)
    if arguments.out:
        save_body_figure(BodyPicture(body.name, body.vertices, body.center_of_mass, body.mass, body.inertia), arguments.out)
    if arguments.json:
        print_json({**_document(body, found), "figure": str(arguments.out) if arguments.out else None})
    else:
        print("\n".join(_lines(body, found)))
        if arguments.out:
            print(f"figure: {arguments.out}")
    return 0


def _document(body: Body, found: BodyDescription) -> dict[str, Any]:
    return {
        **body.to_mapping(),
        "hull_corners": found.hull_count,
        "approximation_mm": 1e3 * found.error,
        "source": found.source,
        "notes": list(found.notes),
        "warnings": list(found.warnings),
    }


def _lines(body: Body, found: BodyDescription) -> Iterator[str]:
    size = " x ".join(f"{value:.4g}" for value in 1e3 * np.ptp(body.vertices, axis=0))
    yield f"{found.source}: {body.name}"
    yield f"shape         {len(body.vertices)} vertices, {size} mm"
    yield f"mass          {body.mass:.4g} kg"
    moments = " ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(body.inertia))
    yield f"inertia       principal moments {moments} kg m^2"
    yield f"friction      {body.friction:g}"
    yield f"length scale  {body.length_scale:.4g} m"
    yield from (f"note: {line}" for line in found.notes)
    yield from (f"warning: {line}" for line in found.warnings)
