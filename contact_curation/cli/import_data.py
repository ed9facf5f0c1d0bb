"""`import contactnets DIR --out BAG.mcap`: writes public data as the bag that a rig would have recorded."""

import argparse
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from contact_curation.cli.options.body import add_body_option, chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.errors import InvalidValueError
from contact_curation.pipeline.division import spans_of


def add_options(verb: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    verb.description = "Writes public data as the bag that a rig would have recorded of it, for `rank` and the nodes to read."
    sources = verb.add_subparsers(title="data", metavar="DATA", required=True)
    parser = sources.add_parser(
        "contactnets",
        help="ContactNets' tosses (.pt files) as a TagSLAM bag",
        description="Writes ContactNets' tosses as the bag that a TagSLAM rig would have recorded of them: odometry of the "
        "body in the map, and the board's place. The frames just before and after each toss are made up and belong to no toss.",
    )
    parser.add_argument("input", type=Path, metavar="DIR", help="folder of N.pt files, or one file")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="BAG.mcap", help="bag to write; without .mcap a rosbag2 folder"
    )
    add_overwrite_option(parser)
    parser.add_argument("--tosses", metavar="NUMBERS", help="numbers of the files to import: 0-399, or 3,7-9 (default all)")
    add_body_option(parser)
    add_json_option(parser)
    for each in (verb, parser):
        each.set_examples(
            "contact-curation import contactnets contactnets/tosses_processed --out tosses.mcap",
            "contact-curation import contactnets tosses_processed --tosses 0-399 --out learning.mcap",
        )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Writes the bag and prints a summary."""
    from contact_curation.storage.datasets.tagslam_bag import import_contactnets

    check_outputs(overwrite=arguments.overwrite, out=arguments.out)
    chosen = None if arguments.tosses is None else _chosen(arguments.tosses)
    with Progress("importing", "files") as bar:
        report = import_contactnets(
            arguments.input,
            arguments.out,
            chosen_body(arguments, said=False),
            chosen=chosen,
            advance=lambda share: bar.advance(share=share),
        )
    warn([*(f"skipped {line}" for line in report.skipped), *report.inexact])
    if arguments.json:
        print_json({"out": str(arguments.out), **asdict(report)})
    else:
        print(
            f"{arguments.out}: {report.tosses} tosses, {report.frames} frames, {len(report.skipped)} files skipped; "
            f"{report.timed_steps} of {report.steps} periods recovered for certain"
        )
    return 0


def _chosen(spec: str) -> Callable[[int], bool]:
    spans = spans_of(spec)
    if spans is None:
        raise InvalidValueError("--tosses", spec, "numbers such as 0-399 or 3,7-9")
    return lambda number: any(first <= number <= last for first, last in spans)
