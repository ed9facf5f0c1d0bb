"""What becomes of motions: rejections by reason with their size and sign, recordings that end too early, duplicates."""

import hashlib
import re
from collections import Counter, defaultdict

import numpy as np

from contact_curation.motion.toss import Toss
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.wording import counted_tosses, listed

NUMBER = r"(-?[\d.]+(?:e-?\d+)?)"
NUMBERS = re.compile(rf"found {NUMBER}(.*?)(?: (?:at|before) frame \d+)?, expected (?:at most|at least|within) {NUMBER}")
"""In the reasons of gates and segmenter: what was found, its unit, and the bound."""

FLIPPED = "orientations jump: flipped tags, or a symmetric body?"
HINTS = {
    "caught": "let the body come to rest on the board",
    "gap": "frames are missing in mid-toss: record at a steady rate",
    "end": "the recording ends, or pauses, before the body rests",
    "frames": "the body does not come to rest in sight",
    "lowest corner of the toss": "board height or body size off?",
    "depth in the board": "board height or body size off?",
    "acceleration in the air beyond gravity": "noise, jittering stamps or smoothed poses?",
    "displacement beside the velocity": "tracking outliers: poses jump",
    "turn beside the angular velocity": FLIPPED,
    "quaternion norm beside 1": "publish unit quaternions",
    "change of spin in the air": FLIPPED,
    "change of spin beyond what a contact's impulse gives": FLIPPED,
    "impulse that pulls down": "are poses lost, held or made up at impacts? publish nothing where the body is not seen",
    "impulse outside the friction cone": "more friction than described (give --friction), or do walls, hands, cables push?",
    "tilt at rest": "is the board tilted?",
    "height at rest": "board height or body size off?",
}
"""By the name of a reason."""

MANY = 0.2
"""Share of the motions that are rejected for one thing, from which on its hint is given though most motions are tosses."""

DEEP = ("lowest corner of the toss", "depth in the board")
SOFT = "bodies at rest lie on the board, so impacts press them into it: a firmer board? ContactNets' model has rigid contacts"
"""Hint for `DEEP` ones where height and size are right."""

DEEPEST, MADE_UP = 0.1, "poses jump, or are made up where the body is not seen: publish nothing there"
"""Share of the body's width that no board gives way by, and the hint for `DEEP` ones that are deeper."""

FALLEN = f"do bodies fall off the board? else {MADE_UP}"
"""Hint for those that are deeper than the body is wide."""

PAUSE = 0.5
"""[s] A longer gap is no loss of frames in mid-toss."""

PAUSED = "the recording pauses before the body rests flat on a described face"
"""Hint for gaps so long."""

MOST_PERIODS = 3
"""Of a gap that a setting may accept: two frames lost at once."""

RESTARTED = "stamps that start again in each recording tell no tosses apart: add the time at which each recording began"

FEW = 8
SAME_LENGTH = 1e-4
"""Poses that differ by less are the same in two recordings [m]."""


def rejected(evidence: Evidence) -> Finding | None:
    """Motions that are no sound tosses, by reason."""
    if not evidence.rejected:
        return None
    reasons = defaultdict(list)
    for one in evidence.rejected:
        name, _, rest = one.reasons[0].partition(":")
        reasons[name].append(rest)
    counts = Counter({name: len(lines) for name, lines in reasons.items()})
    parts = [f"{count} {name}{_sizes(reasons[name])}" for name, count in counts.most_common()]
    first = counts.most_common(1)[0][0]
    what = f"{len(evidence.rejected)} of {len(evidence.outcomes)} motions rejected: {'; '.join(parts)}"
    hint = HINTS.get(first, "")
    if first in DEEP and (evidence.rests_on_board or evidence.tosses):
        widths = _depth(first, reasons[first]) / np.ptp(evidence.body.vertices, axis=0).max()
        lying = (MADE_UP if widths > DEEPEST else SOFT) if evidence.rests_on_board else hint
        hint = FALLEN if widths > 1.0 else lying
    if not evidence.mostly_rejected:
        alike = sum(count for name, count in counts.items() if HINTS.get(name) == HINTS.get(first))
        return Finding(Severity.FACT, what, hint if alike >= MANY * len(evidence.outcomes) else "")
    if first == "gap" and float(np.median(_found(reasons[first]) or 0.0)) > PAUSE:
        hint = PAUSED
    setting = _wider_gap(reasons[first], evidence.config.inputs.segmenter.largest_gap) if first == "gap" else ""
    if not setting:
        return Finding(Severity.FAULT, what, hint)
    return Finding(Severity.FAULT, what, f"{hint}, or say --set {setting}: one transition spans a gap", settings=(setting,))


def never_at_rest(evidence: Evidence) -> Finding | None:
    """Throws that are seen to fall, and not to come to rest."""
    throws = evidence.survey.throws
    moving = sum(throw.rest is None for throw in throws)
    if evidence.fall is None or 2 * moving <= len(throws):
        return None
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    what = f"{moving} of {len(throws)} throws do not come to rest in sight: caught, out of view, or cut off"
    return Finding(severity, what, "record until the body lies still for half a second")


def none_found(evidence: Evidence) -> Finding | None:
    """No motion at all, though bodies fall."""
    if evidence.outcomes or not evidence.poses:
        return None
    what = f"found no toss in {evidence.poses} poses, though {len(evidence.survey.throws)} falls are seen"
    return Finding(Severity.FAULT, what, "let the body fall from 5 cm or higher over the board, and lie still before and after")


def duplicates(evidence: Evidence) -> Finding | None:
    """Tosses that are in the recordings twice, under one id or several."""
    seen: dict[str, str] = {}
    again = []
    for recording in evidence.recordings:
        for one in recording.outcomes:
            if isinstance(one, Toss):
                shape = _shape(one)
                if shape in seen:
                    again.append(f"{one.toss_id} of {recording.name} as in {seen[shape]}")
                seen.setdefault(shape, recording.name)
    if not again:
        return None
    accepted = sum(isinstance(one, Toss) for recording in evidence.recordings for one in recording.outcomes)
    what = f"{counted_tosses(len(again))} of {accepted} are duplicates: {listed(again)}"
    return Finding(Severity.WARNING, what, "give each recording once: held-out tosses must not be learned from")


def same_ids(evidence: Evidence) -> Finding | None:
    """Different tosses under one id, of which all but the first are left out: ids hold the first header stamp."""
    seen: dict[str, str] = {}
    accepted, again = 0, []
    for recording in evidence.recordings:
        for one in recording.outcomes:
            if isinstance(one, Toss):
                accepted += 1
                if seen.setdefault(one.toss_id, one.digest()) != one.digest():
                    again.append(f"{one.toss_id} of {recording.name}")
    if not again:
        return None
    severity = Severity.FAULT if 2 * len(again) > accepted else Severity.WARNING
    what = f"{len(again)} of {counted_tosses(accepted)} start with the header stamp of another one and are left out"
    return Finding(severity, f"{what}: {listed(again)}", RESTARTED)


def few(evidence: Evidence) -> Finding | None:
    """Fewer tosses than say anything."""
    if not 0 < len(evidence.tosses) < FEW or evidence.mostly_rejected:
        return None
    if not all(one.whole for one in evidence.recordings):
        return None
    what = f"only {counted_tosses(len(evidence.tosses))}"
    return Finding(Severity.WARNING, what, f"record {FEW} or more: fewer leave vertices or friction open")


def _wider_gap(lines: list[str], largest: float) -> str:
    """The setting that accepts most gaps; empty where more frames are lost at once than tell what happened between them.

    Args:
        lines: what the segmenter says of gaps.
        largest: that it accepts, in frame periods.
    """
    gaps = [largest * float(match.group(1)) / float(match.group(3)) for line in lines if (match := NUMBERS.search(line))]
    periods = round(float(np.median(gaps))) if gaps else 0
    return f"segmenter.largest_gap={periods + 0.5}" if 0 < periods <= MOST_PERIODS else ""


def _found(lines: list[str]) -> list[float]:
    """The numbers that were found."""
    return [float(match.group(1)) for line in lines if (match := NUMBERS.search(line))]


def _depth(name: str, lines: list[str]) -> float:
    """The median depth under the board that one of `DEEP` reasons found [m]."""
    found = float(np.median(_found(lines) or 0.0))
    return found if name == "depth in the board" else -1e-3 * found  # which is a height in mm


def _sizes(lines: list[str]) -> str:
    """The median of what was found, without signs where they differ, in its unit, and the bound."""
    numbers = [match for line in lines if (match := NUMBERS.search(line))]
    if not numbers:
        return ""
    found = np.array(_found(lines))
    median = np.median(found if np.ptp(np.sign(found)) == 0.0 else np.abs(found))
    bound = float(numbers[0].group(3))
    digits = 3 if f"{median:.3g}" != f"{bound:.3g}" else 5
    return f" ({median:.{digits}g}{numbers[0].group(2)} in the median, allowed {bound:.{digits}g})"


def _shape(toss: Toss) -> str:
    """A digest of how a toss moves, whatever its stamps and its place."""
    moved = np.rint((toss.positions - toss.positions[0]) / SAME_LENGTH).astype(np.int64)
    return hashlib.sha256(moved.tobytes()).hexdigest()
