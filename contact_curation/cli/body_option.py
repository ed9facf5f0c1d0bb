"""`--body FILE`: which object was tossed."""

import argparse
from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE, Body


def add_body_option(parser: argparse.ArgumentParser) -> None:
    """Adds the option."""
    parser.add_argument(
        "--body", type=Path, metavar="FILE", help="the object, a YAML file like config/cube.yaml (default: ContactNets' cube)"
    )


def chosen_body(arguments: argparse.Namespace) -> Body:
    """The body of the option's file, or ContactNets' cube.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    if arguments.body is None:
        return CONTACTNETS_CUBE
    from contact_curation.storage.body_file import read_body

    return read_body(arguments.body)
