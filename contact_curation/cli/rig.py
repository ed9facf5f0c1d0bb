"""`rig INPUT...`: estimates the rig calibration from recorded tosses: the board's tilt and height, length scale, marker."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.reading import add_reading_options, inputs_of, stages_of
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.errors import NothingFoundError
from contact_curation.motion.calibration import FEWEST_TOSSES, NO_CORRECTION
from contact_curation.motion.survey.mass_centre import MassCentre
from contact_curation.motion.survey.rig import Estimate, RigEstimate, worth_correcting
from contact_curation.pipeline.diagnosis.diagnosis import concluded
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.findings.body import beside_size, moving_parts, other_frame, other_size
from contact_curation.pipeline.diagnosis.findings.rig import incline, moved
from contact_curation.pipeline.diagnosis.recording import read_recording
from contact_curation.pipeline.reading import ReadingConfig, center_of_mass_option, settings_of
from contact_curation.pipeline.wording import counted_tosses

NO_CORRECTION_NEEDED = "no correction needed: every interval holds 0, and the marker sits where it is described"


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Estimates from recorded tosses alone how the board is tilted and how high it is in the frame of the poses, the length "
        "scale, and where the marker sits in the body: bodies fall by their gravity and come to rest flat on the board. Falls "
        "and rests are looked for in the poses themselves: a rig that is far off would have every toss rejected. The last line "
        "is what other verbs take to correct the tosses. Intervals are 95 %."
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
        ContactCurationError: no fall in metres with z up was found, or too few throws fall or come to rest.
    """
    body, stages = chosen_body(arguments), stages_of(arguments, {})
    config = ReadingConfig(body, inputs_of(stages, gated=False))
    recordings = []
    with Progress("reading", "recordings", len(arguments.inputs)) as progress:
        for path in arguments.inputs:
            recordings.append(read_recording(path, config, sys.maxsize))
            progress.advance(1)
    evidence = Evidence(config, tuple(recordings))
    warnings = tuple(_warnings(evidence))
    if evidence.fall is None or not evidence.fall.sound:
        raise NothingFoundError(concluded(evidence).verdict, warnings)
    warn(warnings)
    found = evidence.estimated_rig(FEWEST_TOSSES)
    rig, one_board = beside_size(evidence, found.rig), evidence.board_move is None
    correction = beside_size(evidence, worth_correcting(found))
    correction = correction if evidence.tracked is None else evidence.tracked.rig  # which comes first
    settings = settings_of(correction) if stages["rig"] == NO_CORRECTION and one_board else ""
    rigid = evidence.departure is None
    seen = evidence.mass_centre if rigid else None
    centre = None if seen is None else seen.seen_from_described(rig, body.center_of_mass)
    move = "" if (moved := evidence.moved_centre(rig)) is None else center_of_mass_option(body.center_of_mass + moved.place)
    options = " ".join(one for one in (move, settings) if one)
    needed = bool(move) or evidence.tracked is not None or not (found.needs_none and one_board)
    if arguments.json:
        told = _document(found, warnings) | {"correction_needed": needed, "settings": options}
        print_json(told | {"mass_centre": _centre_document(centre, move)})
    else:
        print("\n".join((*_lines(found), _centre_line(centre, move, rigid), *_ways_to_correct(needed, options))))
    return 0


def _warnings(evidence: Evidence) -> Iterator[str]:
    for one in evidence.recordings:
        yield from (f"{one.path}: {line}" for line in (one.unreadable, one.no_topic, *one.losses) if line)
    found = (find(evidence) for find in (moved, moving_parts, other_frame, other_size, incline))
    yield from (one.line for one in found if one is not None)
    twice = sum(len(one.series) for one in evidence.recordings) - len(evidence.series)
    if twice:
        yield f"{twice} series of poses are in the inputs twice: each counts once"


def _document(found: RigEstimate, warnings: Sequence[str]) -> dict[str, Any]:
    height, turn, offset = _times(found.height, 1e3), found.marker_turn, found.marker_place
    return {
        "tosses": found.throws,
        "at_rest": found.rests,
        "in_the_air": found.falls,
        "normal": list(found.rig.normal),
        "tilt_degrees": found.tilt_interval._asdict(),
        "height_mm": height._asdict(),
        "scale": found.length_scale._asdict(),
        "marker": {
            "turn_degrees": [_times(one, float(np.degrees(1.0)))._asdict() for one in turn],
            "offset_mm": [_times(one, 1e3)._asdict() for one in offset],
        },
        "unclear": list(found.doubts),
        "warnings": list(warnings),
    }


def _centre_document(centre: MassCentre | None, option: str) -> dict[str, Any] | None:
    if centre is None:
        return None
    spans = [_times(one, 1e3) for one in centre.intervals]
    offset = [one._asdict() if np.isfinite(one.low) else None for one in spans]
    return {"flights": centre.flights, "offset_mm": offset, "option": option}


def _lines(found: RigEstimate) -> Iterator[str]:
    yield f"{counted_tosses(found.throws)}: {found.rests} come to rest, {found.falls} are long enough in the air"
    tilt, scale, height = found.tilt_interval, found.length_scale, _times(found.height, 1e3)
    normal = ", ".join(f"{value:.4f}" for value in found.rig.normal)
    yield (
        f"tilt    the board is tilted by {tilt.value:.2f} degrees ({tilt.low:.2f} to {tilt.high:.2f}) in the frame of the "
        f"poses: its normal is {normal}"
    )
    length = f"{abs(100.0 * (scale.value - 1.0)):.1f} % too {'short' if scale.value > 1.0 else 'long'}"
    yield f"scale   lengths are {length}: multiply them by {scale.value:.4f} ({scale.low:.4f} to {scale.high:.4f})"
    where = "under" if height.value < 0.0 else "over"
    yield (
        f"height  bodies at rest lie {abs(height.value):.1f} mm {where} the board "
        f"({height.low:.1f} to {height.high:.1f}), by the described vertices"
    )
    if found.rig.has_marker:
        turn = np.degrees(np.linalg.norm(found.rig.marker_turn))
        away = 1e3 * np.linalg.norm(found.rig.marker_offset)
        yield f"marker  the tracked frame is turned by {turn:.2f} degrees and {away:.1f} mm away from the described body's"
    else:
        yield "marker  the tracked frame is the described body's, as far as the rests tell"
    yield from (f"unclear {line}" for line in found.doubts)


def _centre_line(centre: MassCentre | None, option: str, rigid: bool) -> str:
    if not rigid:
        return "mass    bodies do not move as rigid ones in the air: neither their centre of mass nor the scale can be told"
    if centre is None:
        return "mass    too few throws turn in the air to tell where the centre of mass is"
    if not option:
        return f"mass    bodies in the air turn about the described centre of mass ({centre.flights} flights)"
    return f"mass    bodies in the air turn about a point {1e3 * centre.distance:.1f} mm from the described centre of mass"


def _ways_to_correct(needed: bool, options: str) -> Iterator[str]:
    if not needed:
        yield NO_CORRECTION_NEEDED
    elif options:
        yield f"options that correct the tosses in other commands: {options}"


def _times(one: Estimate, factor: float) -> Estimate:
    return Estimate(*(factor * value for value in one))
