"""`body FILE`: prints, draws or writes an object, as its file describes it or as a checkpoint learned it."""

import argparse
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from contact_curation.cli.options.body import DETAILS, add_body_details, body_description
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.types import PathEndingIn
from contact_curation.cli.report import add_json_option, print_json
from contact_curation.contact.body import Body
from contact_curation.contact.body_description import BodyDescription, checked
from contact_curation.contact.body_writers import FORMATS
from contact_curation.dashboard.figures.body import BodyPicture, save_body_figure
from contact_curation.errors import InvalidValueError
from contact_curation.files import as_word
from contact_curation.geometry.polytopes import corners_of
from contact_curation.storage.body_file import body_paths, write_body
from contact_curation.storage.parameters_file import is_checkpoint


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Says what was understood of an object. Its file is YAML like contact_curation/config/cube.yaml, URDF, MJCF, or a mesh "
        "(STL, OBJ, PLY, OFF), which YAML may name, too: `mesh: brick.stl`, `mass: 0.3`, `friction: 0.2`, `scale: 0.001`. "
        "Of a checkpoint of a polytope it is the learned object. With --out it is drawn, or written for a simulator. "
        "Vertices are given about the centre of mass, in the axes of the file."
    )
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="file that describes the object, or a .safetensors checkpoint that learned it"
    )
    add_body_details(parser.add_argument_group("where the file does not say"))
    parser.add_argument(
        "--out",
        type=PathEndingIn(".png", *FORMATS),
        metavar="OUT",
        help="figure of the object (.png), or the object as MJCF (.xml), URDF (.urdf, and its mesh as .obj) or YAML (.yaml)",
    )
    add_overwrite_option(parser)
    add_json_option(parser)
    parser.set_examples(
        "contact-curation body brick.yaml --out brick.png",
        "contact-curation body brick.stl --mesh-scale 0.001 --mass 0.3 --friction 0.2",
        "contact-curation body robot.urdf --link base_link --json",
        "contact-curation body cube.safetensors --out cube.xml",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads the file, prints what was understood, and draws or writes it.

    Raises:
        ContactCurationError: the file describes no body, or an output cannot be written.
    """
    out: Path | None = arguments.out
    for path in [] if out is None else body_paths(out):
        check_outputs(overwrite=arguments.overwrite, out=path)
    found = _learned(arguments) if is_checkpoint(arguments.file) else _Object(body_description(arguments.file, arguments))
    body, drawn = Body.described(found.description), out is not None and out.suffix not in FORMATS
    left_out: tuple[str, ...] = ()
    if out is not None and drawn:
        save_body_figure(BodyPicture(body.name, body.vertices, body.center_of_mass, body.mass, body.inertia), out)
    elif out is not None:
        left_out = write_body(out, body, restitution=found.restitution, overwrite=True)
    if arguments.json:
        written = [str(path) for path in body_paths(out)] if out is not None and not drawn else []
        print_json({**_document(body, found, left_out), "figure": str(out) if drawn else None, "written": written})
    else:
        print("\n".join(_lines(body, found)))
        if out is not None:
            print("\n".join(_output_lines(out, drawn, body, left_out)))
    return 0


class _Object(NamedTuple):
    """An object as described or learned.

    Attributes:
        description: with all of its values.
        restitution: that was learned; None for none.
    """

    description: BodyDescription
    restitution: float | None = None


def _learned(arguments: argparse.Namespace) -> _Object:
    """The object that a checkpoint learned, with the values that it does not learn as its body has them."""
    from contact_curation.pipeline.learned_model import load_model  # imports torch, which takes over a second

    if given := [name for name in DETAILS if getattr(arguments, name) is not None]:
        expected = "none beside a checkpoint, which has its body"
        raise InvalidValueError(f"--{given[0].replace('_', '-')}", getattr(arguments, given[0]), expected)
    model = load_model(arguments.file)
    body = model.learned_body()
    values = {field.name: getattr(body, field.name) for field in fields(body)}
    notes = [
        "learned: vertices, friction" + ("" if model.restitution is None else ", restitution") + "; as described: all else"
    ]
    if model.model.has_own_friction_vertices:
        notes.append("friction was learned at vertices of its own: those of the gaps are shown")
    count = len(corners_of(body.vertices))
    description = BodyDescription(**values, hull_count=count, error=0.0, source=str(arguments.file), notes=tuple(notes))
    return _Object(checked(description), model.restitution)


def _document(body: Body, found: _Object, left_out: Sequence[str]) -> dict[str, Any]:
    description = found.description
    return {
        **body.to_mapping(),
        "restitution": found.restitution,
        "hull_corners": description.hull_count,
        "approximation_mm": 1e3 * description.error,
        "source": description.source,
        "notes": [*description.notes, *left_out],
        "warnings": list(description.warnings),
    }


def _lines(body: Body, found: _Object) -> Iterator[str]:
    description = found.description
    size = " x ".join(f"{value:.4g}" for value in 1e3 * np.ptp(body.vertices, axis=0))
    yield f"{description.source}: {body.name}"
    yield f"shape         {len(body.vertices)} vertices, {size} mm"
    yield f"mass          {body.mass:.4g} kg"
    moments = " ".join(f"{value:.3g}" for value in np.linalg.eigvalsh(body.inertia))
    yield f"inertia       principal moments {moments} kg m^2"
    yield f"friction      {body.friction:.4g}"
    if found.restitution is not None:
        yield f"restitution   {found.restitution:.4g}"
    yield f"length scale  {body.length_scale:.4g} m"
    yield from (f"note: {line}" for line in description.notes)
    yield from (f"warning: {line}" for line in description.warnings)


def _output_lines(out: Path, drawn: bool, body: Body, left_out: Sequence[str]) -> Iterator[str]:
    if drawn:
        yield f"figure: {out}"
        return
    yield from (f"note: {line}" for line in left_out)
    yield f"object: {' '.join(str(path) for path in reversed(body_paths(out)))}"
    scale = [] if out.suffix == ".yaml" else ["--length-scale", repr(body.length_scale)]
    yield f"next: {shlex.join(['contact-curation', 'body', as_word(out), *scale])}"
