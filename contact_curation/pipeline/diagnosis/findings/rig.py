"""Level, height and length scale of the rig, and the marker in the body: what settings can correct."""

import numpy as np

from contact_curation.motion.scales import size_of
from contact_curation.motion.survey.inertia import shape_of
from contact_curation.motion.survey.rig import RigEstimate, worth_correcting
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.diagnosis.findings.body import beside_size, other_shape, other_size
from contact_curation.pipeline.reading import center_of_mass_option
from contact_curation.pipeline.wording import counted_tosses

LARGEST_TILT, LARGEST_HEIGHT, LARGEST_SCALE = 0.75, 0.0025, 0.025
"""Degrees, m, share: what is more is a fault; what is less but certain is worth settings."""

WORTH_TILT, WORTH_HEIGHT, WORTH_SCALE = 0.2, 0.0008, 0.008
"""What is worth a line."""

LARGEST_INCLINE, WORTH_INCLINE = 2.0, 0.75
"""Degrees between the board's normal and gravity: friction of bodies that slide is 5 % too low at 1, 16 % at 3."""

SURE = 4.0
"""Standard errors of the mean acceleration, over throws."""

LARGEST_MOVE = 0.2
"""Of a body's size: by so much more is its centre of mass away from where it is described in a fault."""

WORTH_INERTIA = 0.05
"""Of the mean moment of inertia: likewise."""

MEND = "measure the rig again, or correct poses by settings"


def height(evidence: Evidence) -> Finding | None:
    """A board over or under the height that its frame says."""
    rig = _rig(evidence)
    if rig is None or other_size(evidence) is not None:
        return None
    found = rig.height
    if abs(found.value) < WORTH_HEIGHT or found.holds_none:
        return None
    where = "under" if found.value < 0.0 else "over"
    what = f"bodies at rest lie {1e3 * abs(found.value):.1f} mm {where} the board ({_range(1e3 * found.low, 1e3 * found.high)})"
    if evidence.tosses and abs(found.value) > np.ptp(evidence.body.vertices, axis=0).max():  # tosses rest on the board
        severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
        on_it = f"{what}, and {counted_tosses(len(evidence.tosses))} on it: do bodies fall off the board?"
        return Finding(severity, on_it, "record throws that stay on it")
    return _finding(evidence, rig, abs(found.value) > LARGEST_HEIGHT, f"{what}: board height or body size off?")


def moved(evidence: Evidence) -> Finding | None:
    """A board, or a camera over it, that was moved between two throws."""
    move = evidence.board_move
    if move is None:
        return None
    throws = evidence.survey.throws
    flight = throws[move.throw].flights[0]
    stamp, name = evidence.survey.series[flight.series].stamps_ns[flight.first], evidence.series[flight.series][0].name
    when = f"from throw {move.throw + 1} of {len(throws)} on ({stamp / NANOSECONDS:.1f} s, {name})"
    step = f"{1e3 * abs(move.higher):.1f} mm {'higher' if move.higher > 0.0 else 'lower'}"
    what = f"{when} bodies lie {step} than before, and {np.degrees(move.tilt):.1f} degrees tilted against it"
    mend = "was the board or a camera moved? no settings correct both parts: record anew, or take each by itself"
    return Finding(Severity.FAULT, what, mend)


def tilt(evidence: Evidence) -> Finding | None:
    """A board that is tilted in the frame of the poses."""
    rig = _rig(evidence)
    if rig is None or rig.tilt_degrees < WORTH_TILT or all(one.holds_none for one in rig.tilt):
        return None
    what = f"the board is tilted by {rig.tilt_degrees:.2f} degrees in the frame of the poses"
    return _finding(evidence, rig, rig.tilt_degrees > LARGEST_TILT, what)


def incline(evidence: Evidence) -> Finding | None:
    """A board that is not level: bodies fall askew to the normal of what they come to rest on."""
    rig, gravity = _rig(evidence), evidence.gravity
    if rig is None or gravity is None:
        return None
    across = np.array([throw.acceleration for throw in evidence.survey.throws]) @ (np.eye(3) - np.outer(rig.rig.up, rig.rig.up))
    error = float(np.linalg.norm(across.std(axis=0, ddof=1)) / np.sqrt(len(across)))
    length = float(np.linalg.norm(gravity))
    aside = float(np.linalg.norm(gravity + (length * rig.rig.up)))
    angle = float(np.degrees(aside / length))
    if angle < WORTH_INCLINE or aside < SURE * error:
        return None
    what = f"gravity is {angle:.1f} degrees askew to the board: bodies slide down it, and their friction is learned wrong"
    severity = Severity.FAULT if angle > LARGEST_INCLINE else Severity.WARNING
    return Finding(severity, what, "level the board; no setting corrects this")


def length_scale(evidence: Evidence) -> Finding | None:
    """Lengths that are too short or too long: a wrong size of tags, or a clock that runs wrong."""
    rig = _rig(evidence)
    if rig is None or abs(rig.scale.value) < WORTH_SCALE or rig.scale.holds_none:
        return None
    fall = evidence.fall.size if evidence.fall is not None else 0.0
    length = "short" if rig.scale.value > 0.0 else "long"
    what = (
        f"bodies fall at {fall:.2f} m/s^2: lengths are {100.0 * abs(rig.scale.value):.1f} % too {length}, or the clock is off"
    )
    return _finding(evidence, rig, abs(rig.scale.value) > LARGEST_SCALE, what)


def marker(evidence: Evidence) -> Finding | None:
    """A tracked frame that is not the described body's."""
    rig = _rig(evidence)
    if rig is None or not rig.rig.has_marker or other_size(evidence) is not None:
        return None
    turn = float(np.degrees(np.linalg.norm(rig.rig.marker_turn)))
    away = 1e3 * float(np.linalg.norm(rig.rig.marker_offset))
    parts = [f"turned by {turn:.1f} degrees"] if turn else []
    parts += [f"{away:.1f} mm away"] if away else []
    what = f"the tracked frame is {' and '.join(parts)} from the described body's"
    return _finding(evidence, rig, turn > LARGEST_TILT or away > 1e3 * LARGEST_HEIGHT, what)


def mass_centre(evidence: Evidence) -> Finding | None:
    """Bodies that turn about another point than the described centre of mass."""
    rig, body = _rig(evidence), evidence.body
    centre = None if rig is None else evidence.moved_centre(beside_size(evidence, rig.rig))
    if centre is None:
        return None
    place = body.center_of_mass + centre.place
    what = (
        f"bodies in the air turn about a point {1e3 * centre.distance:.1f} mm from the described centre of mass "
        f"(by {centre.flights} flights)"
    )
    word = center_of_mass_option(place)
    severity = Severity.FAULT if centre.distance > LARGEST_MOVE * size_of(body.vertices) else Severity.WARNING
    return Finding(severity, what, f"add {word}, or correct the --body file", options=(word,))


def inertia(evidence: Evidence) -> Finding | None:
    """Bodies whose spin changes in the air otherwise than the described moments of inertia make it."""
    rig, found, body = _rig(evidence), evidence.inertia, evidence.body
    if rig is None or found is None or not found.differs_from(body.inertia):
        return None
    off = np.abs(found.values - shape_of(body.inertia))
    if off.max() < WORTH_INERTIA:
        return None
    numbers, names = (3, "xx : yy : zz") if off[3:].max() < WORTH_INERTIA else (6, "xx : yy : zz : xy : xz : yz")
    seen, described = (
        " : ".join(f"{value:z.2f}" for value in shape[:numbers]) for shape in (found.values, shape_of(body.inertia))
    )
    what = (
        f"bodies in the air turn as with moments of inertia ({names}) of {seen}, described {described} "
        f"(by {found.flights} flights)"
    )
    matrix = found.matrix * np.trace(body.inertia) / 3.0
    rows = [matrix.diagonal()] if np.abs(found.values[3:]).max() < WORTH_INERTIA else list(matrix)
    told = ", ".join("[" + ", ".join(f"{value:.3g}" for value in row) + "]" for row in rows)
    return Finding(Severity.WARNING, what, f"correct the --body file, inertia: {told if len(rows) == 1 else f'[{told}]'}")


def _rig(evidence: Evidence) -> RigEstimate | None:
    return None if evidence.tracked is not None or other_shape(evidence) is not None else evidence.rig


def _finding(evidence: Evidence, rig: RigEstimate, large: bool, what: str) -> Finding:
    correction = beside_size(evidence, worth_correcting(rig))
    return Finding(Severity.FAULT if large else Severity.WARNING, what, MEND, rig=correction)


def _range(low: float, high: float) -> str:
    return f"{low:.1f} to {high:.1f}"
