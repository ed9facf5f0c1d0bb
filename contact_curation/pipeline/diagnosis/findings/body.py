"""Whether the body that was thrown is the described one."""

from dataclasses import replace

import numpy as np

from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.motion.survey.rests import faces, rests_of
from contact_curation.motion.survey.rig import RigEstimate
from contact_curation.motion.survey.size import USUAL
from contact_curation.pipeline.diagnosis.evidence import DEPARTING, Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.diagnosis.findings.orientations import ASKEW, off_flat
from contact_curation.pipeline.diagnosis.findings.smoothing import smoothed
from contact_curation.pipeline.diagnosis.findings.stamps import closed_up

WIDE = 1.0
"""[m] What is described narrower is not described in millimetres."""

LARGEST = 20.0
"""Times its height at rest: a body that is described larger is described in another unit."""

BETTER = 0.01
"""By so much nearer must a wrong size be to what is seen than a wrong height of the board."""

UNEVEN = 0.0025
"""[m] Heights at rest that differ by more in the median are not those of the described faces."""

SMALLEST, WORTH_SIZE = 0.067, 0.02
"""Of its depth at rest: what a body of another size is higher or lower, at least; what is worth a line if faces agree on it."""

ABOVE, LOWEST = 1.5, 1.0
"""Times the distance of the farthest vertex: a centre at rest so far over the lowest of 100 poses is held, wherever the board
may be measured to be."""

ROUND = np.radians(30.0)
"""Faces whose normals are no further apart may stand for a round side: those of prisms with twelve sides or more."""

ROOM = 1.2
"""Times what rests between faces need: a body may rest farther off than those that are seen."""

BETTER_FIT = 3.0
"""Times: so much less must a wrong size leave of heights at rest than a wrong height of the board."""


def other_unit(evidence: Evidence) -> Finding | None:
    """A body that is described in millimetres."""
    if evidence.fall is None or not evidence.fall.sound:
        return None
    rests, width = rests_of(evidence.survey.throws, evidence.body.polytope), float(np.ptp(evidence.body.vertices, axis=0).max())
    if not len(rests):
        return None
    half, lies = float(np.median(rests.depths)), float(np.median(rests.places[:, 2]))
    if LARGEST * abs(lies) > half or width < WIDE:
        return None
    what = f"{evidence.body.name} is {width:.3g} m wide as described, and lies {lies:.2g} m high"
    return Finding(Severity.FAULT, what, "are its vertices in mm? expected metres")


def other_frame(evidence: Evidence) -> Finding | None:
    """A tracked frame whose axes are the described body's turned by right angles, or whose origin is elsewhere."""
    found = evidence.tracked
    if found is None:
        return None
    away = 1e3 * float(np.linalg.norm(found.rig.marker_offset))
    parts = [f"the described x, y, z are its {found.axes}"] if found.is_turned else []
    parts += [f"it is {away:.1f} mm away"] if away else []
    what = (
        f"the tracked frame is not that of {evidence.body.name} as described: {' and '.join(parts)} "
        f"(heights on the board fit {found.described / found.found:.0f} times better)"
    )
    return Finding(Severity.FAULT, what, "correct the --body file or the tracked frame, or poses by settings", rig=found.rig)


def round_side(evidence: Evidence) -> Finding | None:
    """Bodies that rest between faces which stand for a round side, as those of the prism that a cylinder becomes do."""
    polytope, off = evidence.body.polytope, off_flat(evidence)
    rests = rests_of(evidence.survey.throws, polytope)
    if evidence.tracked is not None or off is None or off["as read"] <= ASKEW or not evidence.mostly_rejected or not len(rests):
        return None
    up = rests.turns[:, 2]  # (K, 3) in the body's frame
    normals = np.unique(np.round(faces(polytope)[0], 6), axis=0)
    nearest = normals[np.argsort(up @ normals.T, axis=1)[:, :2]]  # (K, 2, 3)
    apart = np.arccos(np.clip((nearest[:, 0] * nearest[:, 1]).sum(axis=1), -1.0, 1.0))
    step = float(np.median(apart))
    if step > ROUND or np.radians(off["as read"]) > 0.5 * step + np.radians(ASKEW):
        return None
    heights = np.sort(up @ polytope.vertices.T, axis=1)
    flat = ROOM * float((heights[:, 2] - heights[:, 0]).max())
    what = (
        f"bodies rest up to {off['as read']:.0f} degrees off the faces of {evidence.body.name} as described, which are "
        f"{np.degrees(step):.3g} degrees apart and stand for a round side"
    )
    settings = (f"segmenter.flat_tolerance={flat:.2g}", f"gates.rest_tilt={ROOM * 0.5 * step:.2g}")
    return Finding(Severity.FAULT, what, "accept rests between them by settings", settings=settings)


def other_shape(evidence: Evidence) -> Finding | None:
    """Bodies that come to rest on none of the described faces, or higher on some than others.

    Tosses end flat on a described face. Where most motions are tosses, what is still for a moment off every face rolls; what is
    still in the air is held.
    """
    if evidence.tracked is not None or round_side(evidence) is not None or _held_in_the_air(evidence):
        return None
    found = off_flat(evidence)
    if found is not None and found["as read"] > ASKEW and evidence.mostly_rejected:
        what = f"bodies at rest stand {found['as read']:.0f} degrees off every face of {evidence.body.name} as described"
    elif evidence.rig is not None and evidence.rig.left_over > UNEVEN and _size_by_faces(evidence, evidence.rig) is None:
        uneven = 1e3 * evidence.rig.left_over
        what = f"bodies lie at heights that differ by {uneven:.0f} mm from face to face of {evidence.body.name} as described"
    else:
        return None
    return Finding(Severity.FAULT, what, "is it the right --body, and are the tags in its frame?")


def _held_in_the_air(evidence: Evidence) -> bool:
    """Whether most bodies are still far over the lowest poses: none of their vertices can touch the board."""
    found = evidence.survey
    heights = [float(throw.rest.position @ found.up) for throw in found.throws if throw.rest is not None]
    if not heights:
        return False
    lowest = float(np.percentile(np.concatenate([one.positions @ found.up for one in found.series]), LOWEST))
    return float(np.median(heights)) - lowest > ABOVE * float(np.linalg.norm(evidence.body.vertices, axis=1).max())


def other_size(evidence: Evidence) -> Finding | None:
    """A body larger or smaller than described, where heights at rest agree on it with those on edges, or face with face."""
    rig, size = evidence.rig, evidence.size
    if rig is None or evidence.tracked is not None:
        return None
    by_faces = _size_by_faces(evidence, rig)
    off = (by_faces or 1.0 + rig.height.value / float(np.median(rig.rest_depths))) - 1.0
    large = abs(off) >= SMALLEST
    on_edges = large and size is not None and abs(size - 1.0 - off) + BETTER <= abs(size - USUAL)
    on_faces = by_faces is not None and abs(off) >= WORTH_SIZE and not rig.height.holds_none
    if not (on_edges or on_faces):
        return None
    width = float(np.ptp(evidence.body.vertices, axis=0).max())
    larger = "larger" if off > 0.0 else "smaller"
    what = (
        f"the body is {100.0 * abs(off):.0f} % {larger} than {evidence.body.name} as described ({1e3 * width:.0f} mm wide), "
        f"at rest and {'on its edges' if on_edges else 'on one face as on others'}"
    )
    remedy = "measure the body and correct its --body file"
    if evidence.mass_centre is None:  # too few flights to see what bodies turn about
        remedy += ", or record more throws: the same is seen of a marker beside the body"
    return Finding(Severity.FAULT if large else Severity.WARNING, what, remedy)


def beside_size(evidence: Evidence, rig: RigCalibration) -> RigCalibration:
    """What is left of a rig, where a body of another size explains the heights, which settings would hide."""
    return rig if other_size(evidence) is None else replace(rig, height=0.0, marker_offset=NO_CORRECTION.marker_offset)


def moving_parts(evidence: Evidence) -> Finding | None:
    """Bodies none of whose points falls on a parabola in the air, as the centre of mass of a rigid one does."""
    found = evidence.departure
    if found is None or smoothed(evidence) is not None or closed_up(evidence) is not None:
        return None
    what = (
        f"bodies do not move as rigid ones in the air: no point of theirs falls on a parabola, the nearest is "
        f"{1e3 * found.size:.2g} mm off, {found.times:.1f} times its scatter (median of {found.flights} flights, expected "
        f"{DEPARTING:g} at most)"
    )
    mend = "moving parts, a load, a body that bends? models are rigid; if nothing moves, calibrate the tracker over its view"
    return Finding(Severity.FAULT if evidence.mostly_rejected else Severity.WARNING, what, mend)


def _size_by_faces(evidence: Evidence, rig: RigEstimate) -> float | None:
    """The size over the described one, if heights at rest go with the depth of the face: no board's do, and none sinks in."""
    rests = rests_of(evidence.survey.throws, evidence.body.polytope)
    heights = rig.rig.scale * (rests.places - rig.rig.centre) @ rig.rig.normal
    size, higher = float(np.median(heights / rests.depths)), np.median(heights - rests.depths)
    by_size, by_board = (np.abs(heights - one).mean() for one in (size * rests.depths, rests.depths + higher))
    return size if BETTER_FIT * by_size < by_board else None
