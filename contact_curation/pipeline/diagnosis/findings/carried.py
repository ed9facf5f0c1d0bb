"""Whether bodies that lie still move as what they are measured from does: transforms out of step with poses, or wrong ones."""

from contact_curation.motion.survey.carried import Wander
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity

WORTH, LARGEST = 1e-4, 5e-4
"""[m] Root mean square by which bodies that lie still move: less changes little, more is a fault."""

OF_NOISE, NOISIEST = 2.0, 3e-4
"""Times what poses scatter by in the camera, bodies that lie still scatter on the board where transforms do; [m] of a fault."""


def out_of_step(evidence: Evidence) -> Finding | None:
    """Stamps of transforms that are late or early against those of poses, such as joint states stamped when they are sent."""
    found = max(evidence.wanders, key=lambda one: one.by_lead, default=None)
    if found is None or found.by_lead < WORTH:
        return None
    side = "ahead of" if found.lead > 0.0 else "behind"
    what = (
        f"{_moves(found, found.by_lead)}: the transforms that move it are {1e3 * abs(found.lead):.2g} ms {side} the poses "
        f"by their stamps ({found.rests} rests)"
    )
    setting = f"poses.transforms_ahead={evidence.config.inputs.poses.transforms_ahead + found.lead:.4f}"
    remedy = "stamp images and joints with the times at which they were taken, by one clock"
    if len(evidence.carried) > 1:  # the setting would move the transforms of all frames
        return Finding(_severity(evidence, found.by_lead), what, remedy, other_poses=True)
    remedy = f"say --set {setting}, or {remedy}"
    return Finding(_severity(evidence, found.by_lead), what, remedy, settings=(setting,), other_poses=True)


def misplaced(evidence: Evidence) -> Finding | None:
    """A camera that is mounted otherwise than transforms say."""
    found = max(evidence.wanders, key=lambda one: one.by_place, default=None)
    if found is None or found.by_place < WORTH:
        return None
    what = (
        f"{_moves(found, found.by_place)}: it is mounted otherwise than transforms say, or gives wrong distances "
        f"({found.rests} rests)"
    )
    remedy = "calibrate the camera, and its place on what moves it (hand-eye)"
    return Finding(_severity(evidence, found.by_place), what, remedy, other_poses=True)


def scattering(evidence: Evidence) -> Finding | None:
    """Transforms that are noisier than the poses, of which interpolation makes what looks like a filter."""
    noisy = [one for one in evidence.scatters if one.on_board >= max(WORTH, OF_NOISE * one.in_carrier)]
    found = max(noisy, key=lambda one: one.on_board, default=None)
    if found is None:
        return None
    board, measured = (f"{1e3 * size:.2g} mm" for size in (found.on_board, found.in_carrier))
    what = (
        f"bodies that hardly move scatter by {board} on the board, and by {measured} in '{found.frame}': "
        "the transforms between it and the board are noisy"
    )
    remedy = "smooth them, for what carries a camera moves smoothly; send those of what stands still once, on /tf_static"
    return Finding(_severity(evidence, found.on_board, NOISIEST), what, remedy, other_poses=True)


def _moves(found: Wander, by: float) -> str:
    return f"bodies that lie still move by {1e3 * by:.2g} mm as '{found.frame}' does"


def _severity(evidence: Evidence, by: float, largest: float = LARGEST) -> Severity:
    return Severity.FAULT if by > largest or evidence.mostly_rejected else Severity.WARNING
