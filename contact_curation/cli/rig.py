"""`rig INPUT...`: estimates the rig calibration from tosses: the board's tilt and height, and the tracker's length scale."""

import argparse
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.reading import add_reading_options, inputs_of, stages_of
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig, Interval
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration, RigMeasurements, measurements_of
from contact_curation.pipeline.reading import ReadingConfig, settings_of
from contact_curation.pipeline.tosses import read_tosses
from contact_curation.pipeline.wording import counted_tosses

BOOTSTRAP = BootstrapConfig(resamples=500)
"""Over tosses."""


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Estimates the rig calibration from recorded tosses alone: bodies come to rest flat on the board, which gives its tilt "
        "and height in the frame of the poses, and they fall by gravity, which gives the tracker's length scale. No gate is "
        "applied, since a rig that is far off would have every toss rejected. The last line holds the options that correct "
        "the tosses in all other commands. Intervals are 95 %, by the bootstrap over tosses."
    )
    add_reading_options(parser, ("poses", "segmenter", "rig"))
    add_json_option(parser)
    parser.set_examples(
        "contact-curation rig session.mcap --body brick.yaml",
        "contact-curation rig day1.mcap day2.mcap --json",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads all inputs and prints the calibration.

    Raises:
        ContactCurationError: too few tosses come to rest, or are long enough in the air.
    """
    body = chosen_body(arguments)
    stages = stages_of(arguments, {})
    inputs = inputs_of(stages, gated=False)
    with Progress("reading", "tosses") as progress:
        tosses = read_tosses(arguments.inputs, ReadingConfig(body, inputs), advance=progress.advance).check_some("no toss")
    warn(tosses.warnings)
    evidence = measurements_of(tosses.in_order_of_ids, body.polytope)
    rig = evidence.calibration(body.gravity)
    told = _told(evidence, body.gravity)
    settings = settings_of(rig) if stages["rig"] == NO_CORRECTION else ""
    if arguments.json:
        print_json(_document(evidence, rig, told, settings, tosses.warnings))
    else:
        print("\n".join(_lines(evidence, rig, told, settings)))
    return 0


def _told(evidence: RigMeasurements, gravity: float) -> dict[str, Interval]:
    """By name: tilt [deg], scale, and height of the faces at rest [mm]."""
    own, count = _statistics(evidence, gravity), len(evidence.ends)
    draws = np.random.default_rng(BOOTSTRAP.seed).integers(count, size=(BOOTSTRAP.resamples, count))
    resampled = [_statistics(evidence.resampled(places), gravity) for places in draws]
    outside = 0.5 * (1.0 - BOOTSTRAP.confidence)
    low, high = np.nanquantile(resampled, [outside, 1.0 - outside], axis=0)
    told = (Interval(*map(float, each)) for each in zip(own, low, high, strict=True))
    return dict(zip(("tilt", "scale", "rest_height"), told, strict=True))


def _statistics(evidence: RigMeasurements, gravity: float) -> Array:
    """(3,) of what `_told` gives; NaN where the tosses are too few of a kind."""
    try:
        rig = evidence.calibration(gravity)
    except InvalidValueError:
        return np.full(3, np.nan)
    return np.array([np.degrees(rig.tilt), rig.scale, 1e3 * np.nanmedian(evidence.heights)])


def _document(
    evidence: RigMeasurements, rig: RigCalibration, told: dict[str, Interval], settings: str, warnings: Sequence[str]
) -> dict[str, Any]:
    units = {"tilt": "tilt_degrees", "scale": "scale", "rest_height": "rest_height_mm"}
    return {
        "tosses": len(evidence.ends),
        "at_rest": int(evidence.rests.sum()),
        "in_the_air": int(evidence.falls.sum()),
        "normal": list(rig.normal),
        **{units[name]: value._asdict() for name, value in told.items()},
        "settings": settings,
        "warnings": list(warnings),
    }


def _lines(evidence: RigMeasurements, rig: RigCalibration, told: dict[str, Interval], settings: str) -> Iterator[str]:
    tilt, scale, height = told["tilt"], told["scale"], told["rest_height"]
    rests, falls = int(evidence.rests.sum()), int(evidence.falls.sum())
    yield f"{counted_tosses(len(evidence.ends))}: {rests} come to rest, {falls} are long enough in the air"
    normal = ", ".join(f"{value:.4f}" for value in rig.normal)
    yield (
        f"tilt    the board is tilted by {tilt.value:.2f} degrees ({tilt.low:.2f} to {tilt.high:.2f}) in the frame of the "
        f"poses: its normal is {normal}"
    )
    off = 100.0 * (scale.value - 1.0)
    length = f"{abs(off):.1f} % too {'short' if off > 0.0 else 'long'}"
    yield f"scale   lengths are {length}: multiply them by {scale.value:.4f} ({scale.low:.4f} to {scale.high:.4f})"
    where = "under" if height.value < 0.0 else "over"
    yield (
        f"height  bodies at rest lie {abs(height.value):.1f} mm {where} the board "
        f"({height.low:.1f} to {height.high:.1f}), by the described vertices"
    )
    if settings:
        yield f"options that correct the tosses in other commands: {settings}"
