"""`rig INPUT...`: what recorded tosses say of the rig that tracked them: how its board lies, and how long its metre is."""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from contact_curation.cli.body_option import chosen_body
from contact_curation.cli.progress import Progress
from contact_curation.cli.reading import InputReader, ReadingConfig
from contact_curation.cli.reading_options import add_reading_options, stages_of
from contact_curation.cli.report import add_json_option, counted_tosses, nothing_found, print_json, warn
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.rig import Rig, RigEvidence, evidence_of
from contact_curation.motion.toss import Toss
from contact_curation.storage.inputs import InputsConfig
from contact_curation.storage.known_tosses import KnownTosses

RESAMPLES, CONFIDENCE = 500, 0.95
"""Of the bootstrap over tosses."""


class Told(NamedTuple):
    """A number and its interval."""

    value: float
    low: float
    high: float


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Says by recorded tosses alone how the board lies in the frame of the poses, and how long the tracker's metre is: "
        "bodies come to rest flat on the board, and fall by their gravity. No gate is applied, since a rig that is far off "
        "would have every toss kept back. Intervals are 95 %, by the bootstrap over tosses."
    )
    add_reading_options(parser, ("poses", "segmenter"))
    add_json_option(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Reads all inputs, and says what they tell.

    Raises:
        ContactCurationError: too few tosses come to rest, or are long enough in the air.
    """
    body = chosen_body(arguments)
    stages = stages_of(arguments, {})
    inputs = InputsConfig(stages["poses"], stages["segmenter"], replace(stages["gates"], enabled=False))
    warnings: list[str] = []
    with Progress("reading", "tosses") as progress:
        tosses = _tosses(arguments.inputs, ReadingConfig(body, inputs), warnings, progress)
        evidence = evidence_of(tosses, body.polytope)
    if not len(evidence.ends):
        raise nothing_found(arguments.inputs, warnings, "no toss", "some that come to rest")
    warn(warnings)
    rig = evidence.rig(body.gravity)
    told = _told(evidence, body.gravity)
    if arguments.json:
        print_json(_document(evidence, rig, told, warnings))
    else:
        print("\n".join(_lines(evidence, rig, told)))
    return 0


def _tosses(paths: Sequence[Path], config: ReadingConfig, warnings: list[str], progress: Progress) -> Iterator[Toss]:
    """The tosses of all inputs, each once; what was left out is a line of warning."""
    known = KnownTosses()
    for path in paths:
        reader = InputReader(path, config)
        for toss in reader.tosses():
            if left_out := known.see(toss.toss_id, toss.digest(), str(path), whole=True).left_out:
                warnings.append(f"{left_out.where}: {left_out.why}")
            else:
                progress.advance()
                yield toss
        warnings += reader.reading().warnings


def _told(evidence: RigEvidence, gravity: float) -> dict[str, Told]:
    """By name: lean [deg], scale, and height of the faces at rest [mm]."""
    random, count = np.random.default_rng(0), len(evidence.ends)
    drawn = (evidence.drawn(random.integers(count, size=count)) for _ in range(RESAMPLES))
    resampled = np.array([found for one in drawn if (found := _statistics(one, gravity)) is not None])
    own = _statistics(evidence, gravity)
    assert own is not None
    ends = np.quantile(resampled, [0.5 - 0.5 * CONFIDENCE, 0.5 + 0.5 * CONFIDENCE], axis=0).T
    names = ("lean", "scale", "rest_height")
    return {
        name: Told(float(value), float(low), float(high)) for name, value, (low, high) in zip(names, own, ends, strict=True)
    }


def _statistics(evidence: RigEvidence, gravity: float) -> Array | None:
    """(3,) of what `_told` gives; None where the draw has too few tosses of a kind."""
    try:
        rig = evidence.rig(gravity)
    except InvalidValueError:
        return None
    return np.array([np.degrees(rig.lean), rig.scale, 1e3 * np.nanmedian(evidence.heights)])


def _document(evidence: RigEvidence, rig: Rig, told: dict[str, Told], warnings: Sequence[str]) -> dict[str, Any]:
    units = {"lean": "lean_degrees", "scale": "scale", "rest_height": "rest_height_mm"}
    return {
        "tosses": len(evidence.ends),
        "at_rest": rig.rests,
        "in_the_air": rig.falls,
        "normal": rig.normal.tolist(),
        **{units[name]: value._asdict() for name, value in told.items()},
        "warnings": list(warnings),
    }


def _lines(evidence: RigEvidence, rig: Rig, told: dict[str, Told]) -> Iterator[str]:
    lean, scale, height = told["lean"], told["scale"], told["rest_height"]
    yield f"{counted_tosses(len(evidence.ends))}: {rig.rests} come to rest, {rig.falls} are long enough in the air"
    normal = ", ".join(f"{value:.4f}" for value in rig.normal)
    yield (
        f"board   leans by {lean.value:.2f} degrees ({lean.low:.2f} to {lean.high:.2f}) in the frame of the poses: "
        f"its normal is {normal}"
    )
    off = 100.0 * (scale.value - 1.0)
    length = f"{abs(off):.1f} % {'short' if off > 0.0 else 'long'}"
    yield f"metre   {length}: multiply lengths with {scale.value:.4f} ({scale.low:.4f} to {scale.high:.4f})"
    where = "under" if height.value < 0.0 else "over"
    yield (
        f"height  bodies at rest lie {abs(height.value):.1f} mm {where} the board "
        f"({height.low:.1f} to {height.high:.1f}), by their corners as described"
    )
