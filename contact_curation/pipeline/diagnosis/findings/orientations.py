"""Orientations in another order of numbers, and poses of the wrong frame in the wrong one.

A permuted quaternion is still one of norm 1 that moves smoothly; but a body at rest then seems to stand on nothing. Whatever
order lets the bodies lie flat is the right one.
"""

import numpy as np

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import survey
from contact_curation.motion.survey.one_frame import other_frame
from contact_curation.motion.survey.rests import faces
from contact_curation.motion.survey.series import PoseSeries
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.diagnosis.recording import Recording

FLAT, ASKEW = 4.0, 8.0
"""Degrees to the nearest face, of three rests in four, up to which bodies lie flat, and from which on they do not."""

RANK = 75
"""Percentile of the rests: with a mixed-up order some faces still look flat."""

FEWEST_RESTS = 3

CONSTANT = 1e-9
"""Of a quaternion: a tracker that sees turns does not repeat them so exactly."""

OTHERS = {
    "wxyz where xyzw is expected": lambda q: q[:, [1, 2, 3, 0]],
    "xyzw read backwards": lambda q: q[:, [3, 0, 1, 2]],
    "the inverse rotation, board to body": quaternions.conjugate,
}
"""By what is to be said of them, likelier ones first: what makes true wxyz of wxyz as read."""


def order(evidence: Evidence) -> Finding | None:
    """Quaternions that are mixed up."""
    found = off_flat(evidence)
    if found is None or found["as read"] < ASKEW:
        return None
    best = next((name for name in OTHERS if found.get(name, ASKEW) <= FLAT), None)
    if best is None:
        return None
    what = f"bodies at rest stand {found['as read']:.0f} degrees off their faces, and flat with another order: {best}?"
    remedy = "publish geometry_msgs/Quaternion as x, y, z, w of the turn from body to parent"
    return Finding(Severity.FAULT, what, remedy)


def constant(evidence: Evidence) -> Finding | None:
    """Positions of bodies that fall, with one orientation for all: of a tracker that sees no turns."""
    series = [one for _, one in evidence.series if len(one)]
    if not evidence.survey.throws or any(np.ptp(one.orientations_wxyz, axis=0).max() > CONSTANT for one in series):
        return None
    what = f"orientations never change in {evidence.poses} poses of bodies that fall: does the tracker see positions alone?"
    return Finding(Severity.FAULT, what, "record poses: contacts cannot be seen without the orientation")


def beside_positions(evidence: Evidence) -> Finding | None:
    """Positions that are mirrored or turned about the vertical while orientations are not: left-handed poses half converted."""
    body = evidence.body
    if evidence.tracked is not None or not evidence.rests_on_board:
        return None
    found = other_frame(evidence.tosses, body.vertices, body.inertia / body.mass, body.gravity)
    if found is None:
        return None
    turn = (180.0 - found.angle) % 360.0 - 180.0  # of positions, which lie in a frame that is turned the other way
    how = "mirrored" if found.mirrored else f"turned by {turn:+.0f} degrees about the vertical"
    what = (
        f"positions are {how} against orientations: read so, {found.impacts} impacts turn the body as they push it, with "
        f"{found.times:.1f} times smaller errors"
    )
    half = "of left-handed poses" if found.mirrored else "of poses"
    return Finding(Severity.FAULT, what, f"were positions {half} converted alone? give both in one frame")


def inverted(evidence: Evidence) -> Finding | None:
    """Poses of the tracker or the board in the body's frame."""
    if evidence.fall is not None and evidence.fall.axis and not _hardly_falls(evidence):
        return None
    turned = [_inverse(one) for recording in evidence.recordings for one in _raw(recording)]
    if not turned:
        return None
    found = survey(turned)
    size = 0.0 if found.gravity is None else float(np.linalg.norm(found.gravity))
    if len(found.throws) < max(FEWEST_RESTS, 2 * len(evidence.survey.throws)) or not 0.8 < size / evidence.body.gravity < 1.25:
        return None
    what = f"poses look inverted: turned round, bodies fall freely at {size:.2f} m/s^2 in {len(found.throws)} throws"
    return Finding(Severity.FAULT, what, "publish the body in the parent's frame, not the parent in the body's")


def _hardly_falls(evidence: Evidence) -> bool:
    """Whether what seems to fall is not accepted, and does not come to rest flat."""
    found = off_flat(evidence)
    return evidence.mostly_rejected and (found is None or found["as read"] > ASKEW)


def off_flat(evidence: Evidence) -> dict[str, float] | None:
    """Degrees between the vertical and the nearest face, of three rests in four, as read and in other orders."""
    found = evidence.survey
    if evidence.fall is None:
        return None
    read, raw = [], []
    for throw in found.throws:
        if throw.rest is None:
            continue
        recording, series = evidence.series[throw.flights[0].series]
        read.append(throw.rest.orientation_wxyz)
        raw.append(_measured_at(recording, int(series.stamps_ns[throw.rest.first])))
    if len(read) < FEWEST_RESTS:
        return None
    seen, given = np.array(read), np.array(raw)
    normals, _ = faces(evidence.body.polytope)
    result = {"as read": _off(seen, normals, found.up)}
    if np.isfinite(given).all():
        outer = quaternions.multiply(seen, quaternions.conjugate(given))  # parent to board
        for name, mend in OTHERS.items():
            result[name] = _off(quaternions.multiply(outer, mend(given)), normals, found.up)
    return result


def _off(orientations: Array, normals: Array, up: Array) -> float:
    down = -np.einsum("kij,i->kj", quaternions.to_matrix(orientations), up)
    return float(np.degrees(np.percentile(np.arccos(np.clip((down @ normals.T).max(axis=1), -1.0, 1.0)), RANK)))


def _measured_at(recording: Recording, stamp_ns: int) -> Array:
    """(4,) the orientation as measured at a stamp; NaN where there is none."""
    at = np.flatnonzero(recording.measured.stamps_ns == stamp_ns)
    return recording.measured.orientations_wxyz[at[0]] if at.size else np.full(4, np.nan)


def _raw(recording: Recording) -> list[PoseSeries]:
    """What was measured of the body in its own parent's frame, in order of stamps."""
    stamps = recording.measured.stamps_ns
    good = np.isfinite(recording.measured.positions).all(axis=1) & np.concatenate([[True], np.diff(stamps) > 0])[: len(stamps)]
    if good.sum() < 16 or np.any(np.diff(stamps[good]) <= 0):
        return []
    return [PoseSeries(stamps[good], recording.measured.positions[good], recording.measured.orientations_wxyz[good])]


def _inverse(series: PoseSeries) -> PoseSeries:
    back = quaternions.conjugate(series.orientations_wxyz)
    return PoseSeries(series.stamps_ns, -quaternions.rotate(back, series.positions), back)
