"""`--body FILE`: which object was tossed."""

import argparse
from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE, Body

HELP = "the object, a YAML file like contact_curation/config/cube.yaml (default: ContactNets' cube)"


def add_body_option(parser: argparse.ArgumentParser, *others: str) -> None:
    """Adds the option; `others` are names that it has, too."""
    parser.add_argument("--body", *others, dest="body", type=Path, metavar="FILE", help=HELP)


def chosen_body(arguments: argparse.Namespace) -> Body:
    """The body of the option's file, or ContactNets' cube.

    Raises:
        UnreadableInputError: the file describes no body.
    """
    if arguments.body is None:
        return CONTACTNETS_CUBE
    from contact_curation.storage.body_file import read_body

    return read_body(arguments.body)
