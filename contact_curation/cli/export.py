"""`export INPUT... --manifest M --format F --out DIR`: writes the selected tosses of a ranking for other tools."""

import argparse
from pathlib import Path

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.reading import SHARED_STAGES, add_reading_options, inputs_of, stages_of
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.errors import InvalidValueError
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.wording import counted

KINDS = ("mcap", "contactnets", "lerobot")


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Writes the tosses that a ranking selected: as parts of their recordings, as ContactNets' files, or as a LeRobot "
        "dataset. Give the same inputs and options as for the ranking; no input is changed."
    )
    add_reading_options(parser, SHARED_STAGES)
    parser.add_argument(
        "--manifest", type=Path, required=True, metavar="FILE", help="manifest that `contact-curation rank` wrote"
    )
    parser.add_argument("--format", choices=KINDS, required=True, help="mcap: the recorded messages, byte for byte")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write, empty or not there yet")
    parser.add_argument("--per-toss", action="store_true", help="with --format mcap: a file per toss, not per recording")
    add_json_option(parser)
    parser.set_examples(
        "contact-curation export session.mcap --manifest manifest.parquet --format mcap --out selected",
        "contact-curation export session.mcap --manifest manifest.parquet --format lerobot --out dataset",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Exports the selected tosses and prints where each went.

    Raises:
        UnreadableInputError: the file is no manifest.
        InvalidValueError: a selected toss is in no input, the folder is not empty, or the format cannot hold the tosses.
    """
    from contact_curation.files import staged_folder
    from contact_curation.pipeline.export import export_job, export_tosses

    if arguments.per_toss and arguments.format != "mcap":
        raise InvalidValueError("--per-toss", f"--format {arguments.format}", "--format mcap")
    stages = stages_of(arguments, {})
    reading = ReadingConfig(chosen_body(arguments, manifest=arguments.manifest), inputs_of(stages))
    with staged_folder(arguments.out) as folder:
        job = export_job(arguments.inputs, reading, arguments.manifest, per_toss=arguments.per_toss)
        with Progress("reading", "tosses") as progress:
            exported = export_tosses(arguments.format, job, folder, progress.advance)
    warn(exported.warnings)
    if arguments.json:
        tosses = [
            {"toss_id": toss_id, "rank": job.rows[toss_id].rank, "place": place} for toss_id, place in exported.places.items()
        ]
        print_json({"out": str(arguments.out), "format": arguments.format, "tosses": tosses, "warnings": exported.warnings})
    else:
        files = counted(sum(1 for path in arguments.out.rglob("*") if path.is_file()), "file")
        print(f"{arguments.out}: {len(exported.places)} of {len(job.manifest.rows)} tosses, {files}")
    return 0
