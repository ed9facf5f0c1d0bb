"""Free fall: whether anything falls, in which unit, and along which axis."""

import numpy as np

from contact_curation.motion.survey.series import PoseSeries
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity

SLOWEST_THROW = 0.3
"""[m/s] What moves no faster was not thrown."""

STANDING, FARTHEST = 0.02, 0.02
"""[m/s, m] What moves no faster, and comes no further, did not move."""

PUSHED, STRUCK = 1.2, 12.0
"""Times gravity: hands and arms stay below the first, impacts of poses that are not smoothed lie above the second."""

SUDDEN = 0.4
"""Share of the largest speed that an impact changes within a frame: so slow ones do not reach `STRUCK`."""

FEWEST_ALIKE, ALIKE = 4, 0.1
"""Throws that come to rest, at least, and the share by which the accelerations of half of all differ at most, for falls with
gravity in no unit."""


def nothing_moves(evidence: Evidence) -> Finding | None:
    """An object that lies there."""
    if not evidence.poses or evidence.survey.largest_speed > STANDING or _farthest(evidence) > FARTHEST:
        return None
    speed = evidence.survey.largest_speed
    remedy = "record while it is thrown, and check that --topic is the object's"
    return Finding(Severity.FAULT, f"the object never moved (largest speed {speed:.2f} m/s in {evidence.poses} poses)", remedy)


def other_unit(evidence: Evidence) -> Finding | None:
    """Poses in millimetres, inches, ..."""
    fall = evidence.fall
    if fall is None or fall.unit == "metres":
        return None
    span = max(float(np.ptp(one.positions, axis=0).max()) for one in evidence.survey.series if len(one))
    what = f"positions span {span:.0f} and fall at {fall.size:.0f} per s^2: {fall.unit}?"
    return Finding(Severity.FAULT, f"{what} expected metres and {evidence.body.gravity:g} m/s^2", "publish poses in metres")


def other_axis(evidence: Evidence) -> Finding | None:
    """A frame whose z is not up."""
    fall = evidence.fall
    if fall is None or fall.axis == "-z":
        return None
    if fall.axis == "z":
        what = f"bodies accelerate upwards ({fall.size:+.1f} m/s^2 along z): is the board frame z-down?"
    elif fall.axis:
        what = f"bodies fall along {fall.axis}, not along -z: is z up in the board's frame?"
    else:
        what = f"bodies fall {fall.angle:.0f} degrees away from -z: are poses given in a camera's or a map's frame?"
    remedy = "give poses in a frame with z up on the board, or name one with --board-frame"
    return Finding(Severity.FAULT, what, remedy)


def other_clock(evidence: Evidence) -> Finding | None:
    """Bodies that fall alike and are stopped by impacts, but with gravity in no unit: times by a wrong rate, or lengths."""
    if evidence.fall is not None or evidence.gravity is None or evidence.is_too_noisy:
        return None
    throws, size = evidence.survey.throws, float(np.linalg.norm(evidence.gravity))
    off = [float(np.linalg.norm(one.acceleration - evidence.gravity)) for one in throws if one.rest is not None]
    alike = sum(one < ALIKE * size for one in off)
    if alike < max(FEWEST_ALIKE, 0.5 * len(throws)) or _hardest_of(evidence) < _struck(evidence, size):
        return None
    lengths = size / evidence.body.gravity
    by = f"{max(lengths, 1.0 / lengths) ** 0.5:.2g} times", f"{max(lengths, 1.0 / lengths):.2g} times"
    times, longer = ("short", "long") if lengths > 1.0 else ("long", "short")
    either = f"times are about {by[0]} too {times}, or lengths {by[1]} too {longer}"
    what = f"bodies fall at {size:.3g} per s^2, which is gravity in no unit, expected {evidence.body.gravity:g} m/s^2: {either}"
    return Finding(Severity.FAULT, what, "give the true times or the tracker's true rate, or the true size of its markers")


def no_fall(evidence: Evidence) -> Finding | None:
    """Bodies that move, and never fall freely."""
    if not evidence.poses or evidence.fall is not None or nothing_moves(evidence) is not None or evidence.is_too_noisy:
        return None
    if other_clock(evidence) is not None:
        return None
    gravity, hardest = evidence.body.gravity, _hardest_of(evidence)
    speed = f"largest speed {evidence.survey.largest_speed:.2g} m/s"
    if evidence.survey.largest_speed > SLOWEST_THROW and PUSHED * gravity < hardest < _struck(evidence, gravity):
        what = f"nothing falls freely, and impacts are as soft as {hardest / gravity:.1f} g ({speed}): poses look smoothed"
        return Finding(Severity.FAULT, what, "record raw poses, without a filter, and give header.stamp the time of exposure")
    if not evidence.mostly_rejected:
        what = f"falls are too short to measure gravity by ({speed}): unit, scale and board are not checked"
        return Finding(Severity.WARNING, what, "throw or drop it from 5 cm or higher")
    what = f"no free fall in {evidence.poses} poses ({speed}): the body was carried and never let go"
    return Finding(Severity.FAULT, what, "throw or drop it from 5 cm or higher, in sight of the tracker until it rests")


def _farthest(evidence: Evidence) -> float:
    """How far most poses of a series are apart, at most, in the unit that they came in."""
    spans = [np.ptp(np.percentile(one.positions, [2, 98], axis=0), axis=0).max() for one in evidence.survey.series if len(one)]
    return float(max(spans, default=0.0))


def _struck(evidence: Evidence, gravity: float) -> float:
    """What impacts of poses that are not smoothed lie above, in units of the poses per s^2."""
    return min(STRUCK * gravity, SUDDEN * evidence.survey.largest_speed / evidence.period)


def _hardest_of(evidence: Evidence) -> float:
    """The largest of all series."""
    return max((_hardest(one) for one in evidence.survey.series), default=0.0)


def _hardest(series: PoseSeries) -> float:
    """The largest change of velocity from frame to frame, over the frame period, but for a few outliers."""
    if len(series) < 8:
        return 0.0
    changes = np.linalg.norm(np.diff(series.positions, n=2, axis=0), axis=1) / series.period**2
    even = np.abs(np.diff(series.steps)) < 0.5 * series.period
    return float(np.percentile(changes[even], 99.9)) if even.any() else 0.0
