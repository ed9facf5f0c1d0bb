"""`check INPUT...`: diagnoses recordings."""

import argparse

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.reading import (
    SHARED_STAGES,
    add_reading_options,
    inputs_of,
    reading_words,
    stages_of,
)
from contact_curation.cli.options.types import positive_integer
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json
from contact_curation.pipeline.diagnosis import FEWEST_MESSAGES, MOST_MESSAGES, diagnose
from contact_curation.pipeline.reading import ReadingConfig

NOT_OK = 1


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Diagnoses recordings: prints the verdict in one line, then the reasons, the settings that correct what can be "
        "corrected, and the next command to type. Nothing is written. The exit status is "
        "0 if recordings are ok, else 1."
    )
    add_reading_options(parser, SHARED_STAGES)
    parser.add_argument(
        "--most",
        type=positive_integer,
        default=MOST_MESSAGES,
        metavar="N",
        help=f"look at the first N messages with the object's pose, of all inputs together (default {MOST_MESSAGES}; of "
        f"each at least {FEWEST_MESSAGES})",
    )
    add_json_option(parser)
    parser.set_examples(
        "contact-curation check session.mcap --body brick.yaml",
        "contact-curation check 'bags/*.mcap' --json",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Diagnoses the recordings and prints the result.

    Raises:
        ContactCurationError: an option that is not accepted, or a body that cannot be read.
    """
    config = ReadingConfig(chosen_body(arguments), inputs_of(stages_of(arguments, {})))
    paths = arguments.inputs
    with Progress("checking", "recordings", len(paths)) as progress:
        words, given = reading_words(arguments), arguments.given
        found = diagnose(paths, config, words=words, given=given, most_messages=arguments.most, advance=progress.advance)
    if arguments.json:
        print_json(found.document())
    else:
        print(found)
    return 0 if found.ok else NOT_OK
