"""`import contactnets DIR` and `import poses FILE...`: write other data as the bag that a rig would have recorded."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path

from contact_curation.cli.options.body import add_body_option, chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.types import positive_number
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.errors import InvalidValueError
from contact_curation.pipeline.division import spans_of
from contact_curation.pipeline.wording import counted


def add_options(verb: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    verb.description = "Writes other data as the bag that a rig would have recorded of it, for `check`, `rank` and the nodes."
    sources = verb.add_subparsers(title="data", metavar="DATA", required=True)
    parser = sources.add_parser(
        "contactnets",
        help="ContactNets' tosses (.pt files) as a TagSLAM bag",
        description="Writes ContactNets' tosses as the bag that a TagSLAM rig would have recorded of them: odometry of the "
        "body in the map, and the board's place. The frames just before and after each toss are made up and belong to no toss.",
    )
    parser.add_argument("input", type=Path, metavar="DIR", help="folder of N.pt files, or one file")
    parser.add_argument("--tosses", metavar="NUMBERS", help="numbers of the files to import: 0-399, or 3,7-9 (default all)")
    _add_common_options(parser, run)
    parser.set_examples(
        "contact-curation import contactnets contactnets/tosses_processed --out tosses.mcap",
        "contact-curation import contactnets tosses_processed --tosses 0-399 --out learning.mcap",
    )
    poses = sources.add_parser(
        "poses",
        help="poses over time in files of text, or in Parquet, as motion capture and pose estimators write them",
        description="Writes poses over time, rows of text or of Parquet, as the bag that a tracker would have recorded. Names "
        "tell the columns: time, x, y, z, qx, qy, qz, qw, in any order, or such as pose.position.x; without names they "
        "are in this order (TUM's trajectories). Times are in s, ms, us or ns; lengths in m, or in mm if the header says so.",
    )
    poses.add_argument("input", type=Path, metavar="FILE", nargs="+", help="a table of poses; several follow each other")
    poses.add_argument("--rate", type=positive_number, metavar="HZ", help="poses in a second, of files without times")
    poses.add_argument("--up", choices=("x", "y", "z"), default="z", help="axis of the poses' frame that points up (default z)")
    poses.add_argument(
        "--angles",
        type=_angle_order,
        metavar="ORDER",
        help="of orientations as three angles about x, y, z (roll, pitch, yaw): the order in which they turn, as in SciPy's "
        "Rotation.from_euler, xyz to zyx about fixed axes or XYZ to ZYX about the body's; or rotvec, a rotation vector",
    )
    poses.add_argument("--angle-unit", choices=("deg", "rad"), help="unit of angles, where their names do not say it")
    _add_common_options(poses, run_poses)
    poses.set_examples(
        "contact-curation import poses mocap.csv --body brick.yaml --out session.mcap",
        "contact-curation import poses throws/*.txt --rate 120 --out throws.mcap",
    )
    verb.set_examples(
        "contact-curation import contactnets contactnets/tosses_processed --out tosses.mcap",
        "contact-curation import poses mocap.csv --body brick.yaml --out session.mcap",
    )


def _angle_order(text: str) -> str:
    """Reads the order of three angles, for argparse."""
    from contact_curation.storage.datasets.orientations import ORDERS

    if text not in ORDERS:
        raise argparse.ArgumentTypeError(f"found {text}, expected one of {', '.join(ORDERS)}")
    return text


def _add_common_options(parser: OneLineParser, runs: Callable[[argparse.Namespace], int]) -> None:
    """Adds the options that all kinds of data have."""
    parser.add_argument(
        "--out", type=Path, required=True, metavar="BAG.mcap", help="bag to write; without .mcap a rosbag2 folder"
    )
    add_overwrite_option(parser)
    add_body_option(parser)
    add_json_option(parser)
    parser.set_defaults(run=runs)


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


def run_poses(arguments: argparse.Namespace) -> int:
    """Writes the bag and prints a summary."""
    from contact_curation.storage.datasets.orientations import AngleConvention
    from contact_curation.storage.datasets.pose_bag import import_poses
    from contact_curation.storage.datasets.pose_columns import TUM

    check_outputs(overwrite=arguments.overwrite, out=arguments.out)
    angles = AngleConvention(arguments.angles or "", arguments.angle_unit or "")
    with Progress("importing", "files") as bar:
        report = import_poses(
            arguments.input,
            arguments.out,
            chosen_body(arguments, said=False),
            arguments.rate,
            arguments.up,
            advance=lambda share: bar.advance(share=share),
            angles=angles,
        )
    unnamed = [f"{name}: columns have no names, taken as {', '.join(TUM)}" for name in report.unnamed]
    warn([*report.left_out, *unnamed, *report.assumed])
    if arguments.json:
        print_json({"out": str(arguments.out), **asdict(report)})
    else:
        print(
            f"{arguments.out}: {counted(report.recordings, 'recording')}, {report.poses} poses in {report.seconds:.1f} s "
            f"({report.rate:.4g} Hz){_moved(report.moved_by, report.recordings)}"
        )
    return 0


def _moved(by: Sequence[float], recordings: int) -> str:
    """By how much the times of recordings were moved [s], and why."""
    if not by:
        return ""
    least, most = (f"{round(one(by), 3):.12g}" for one in (min, max))
    spans = least if least == most else f"{least} to {most}"
    why = "they began at 0" if recordings == 1 else "they began at 0, or before the recording before them ended"
    return f"; times of {counted(len(by), 'recording')} moved by {spans} s: {why}"


def _chosen(spec: str) -> Callable[[int], bool]:
    spans = spans_of(spec)
    if spans is None:
        raise InvalidValueError("--tosses", spec, "numbers such as 0-399 or 3,7-9")
    return lambda number: any(first <= number <= last for first, last in spans)
