"""`--held-out SPEC`: numbers as 400-569, a share as 0.2, a file of ids, or none."""

import argparse
import re
from pathlib import Path

from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.storage.manifest.file import FORMATS, read_manifest

NOTHING = "none"
NUMBERS = re.compile(r"\d{1,9}(-\d{1,9})?(,\d{1,9}(-\d{1,9})?)*", re.ASCII)
SHARE = re.compile(r"0?\.\d+", re.ASCII)
LARGEST_FILE = 1 << 26
"""Bytes; a million ids take half of it."""


def add_held_out_option(parser: argparse._ArgumentGroup, default: str) -> None:
    """Adds the option; `default` says what holds without it."""
    parser.add_argument(
        "--held-out",
        metavar="SPEC",
        help="numbers of tosses (400-569, or 3,7-9: of a file by its name, in a recording from 0), a share (0.2) by a digest "
        f"of their ids, a file with an id a line, a manifest (its kept tosses), or none ({default})",
    )


def held_out_rule(spec: str) -> HeldOutRule:
    """What a specification holds out.

    Raises:
        InvalidValueError: it is nothing of what is accepted.
        UnreadableInputError: it names a file that holds no ids.
    """
    if spec == NOTHING:
        return HeldOutRule()
    spans = spans_of(spec)
    if spans is not None:
        return HeldOutRule(spans=spans)
    if SHARE.fullmatch(spec):
        return HeldOutRule(share=float(spec))
    path = Path(spec)
    if not (spec and path.exists()):
        expected = "numbers such as 400-569, a share such as 0.2, none, or the name of a file with ids"
        raise InvalidValueError("--held-out", spec, expected)
    return HeldOutRule(ids=_ids_in(path))


def spans_of(spec: str) -> tuple[tuple[int, int], ...] | None:
    """First and last numbers, both included, of `400-569` or `3,7-9`; None where it is no numbers."""
    return tuple(_span(part) for part in spec.split(",")) if NUMBERS.fullmatch(spec) else None


def _span(text: str) -> tuple[int, int]:
    first, _, last = text.partition("-")
    return int(first), int(last or first)


def _ids_in(path: Path) -> frozenset[str]:
    if path.suffix in FORMATS:
        return frozenset(row.toss_id for row in read_manifest(path).selected)
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
        lines = data.decode().splitlines()
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UnreadableInputError(path, "holds no text, expected an id a line") from error
    ids = frozenset(line.strip() for line in lines) - {""}
    if len(data) > LARGEST_FILE or not ids:
        raise UnreadableInputError(path, f"holds {len(data)} bytes and {len(ids)} ids, expected an id a line")
    return ids
