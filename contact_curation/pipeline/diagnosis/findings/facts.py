"""What is to be known of recordings, sound or not: topics, rates, frames, falls, noise, motions, what they identify."""

import numpy as np

from contact_curation.dashboard.vertex_uncertainty import vertex_uncertainty
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import pool_of
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.pipeline.diagnosis.evidence import SYMBOLS, Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.diagnosis.findings import contact
from contact_curation.pipeline.theta import described_polytope, form_of
from contact_curation.pipeline.wording import counted, counted_tosses
from contact_curation.solver.cone_problem import MAX_CONTACTS

MOST_SCORED = 24
"""Tosses that are scored to say what they identify."""

HARDLY = 0.1
"""Of the characteristic length, or of the friction coefficient: what is told no better is hardly told."""

MOST_LISTED = 3


def topics(evidence: Evidence) -> Finding | None:
    """What was taken as the body's poses."""
    sources = {one.source.body for one in evidence.recordings if one.source is not None}
    if not sources:
        return None
    named = ", ".join(f"{name} ({kind})" for name, kind in sorted(sources)[:MOST_LISTED])
    poses = sum(len(one.measured) for one in evidence.recordings)
    return _fact(f"poses of {evidence.body.name}: {poses} on {named}")


def frames(evidence: Evidence) -> Finding | None:
    """The frames they are given in, and how the board was found."""
    found = [one for one in evidence.recordings if one.source is not None and one.parents]
    if not found:
        return None
    first = found[0]
    assert first.source is not None
    parents = " and ".join(f"'{name}'" for name in sorted(first.parents))
    board = f"the board is '{first.source.board_frame}'" if first.source.board_frame else "taken as given on the board"
    return _fact(f"frames: poses in {parents}, {board}")


def stamps(evidence: Evidence) -> Finding | None:
    """Rate, length, and how far header stamps are from log times."""
    if not np.isfinite(evidence.period):
        return None
    length = sum(float(series.times[-1]) for one in evidence.recordings for series in one.series if len(series))
    late = [
        np.median(one.measured.logged_ns - one.measured.stamps_ns) * 1e-9 for one in evidence.recordings if len(one.measured)
    ]
    behind = f", logged {float(np.median(late)):.3g} s after their header stamps" if late else ""
    return _fact(f"stamps: {1.0 / evidence.period:.4g} Hz over {length:.3g} s{behind}")


def free_fall(evidence: Evidence) -> Finding | None:
    """How bodies fall."""
    fall = evidence.fall
    if fall is None:
        return None
    throws = evidence.survey.throws
    rests = sum(throw.rest is not None for throw in throws)
    unit = SYMBOLS.get(fall.unit, "units")
    seen = f"{counted(len(throws), 'throw')} at {fall.size:.4g} {unit}/s^2 along {fall.axis or 'no axis'}"
    return _fact(f"free fall: {seen}, expected {evidence.body.gravity:g} along -z; {rests} come to rest")


def board(evidence: Evidence) -> Finding | None:
    """How level and how high the board is, and the length scale."""
    rig = evidence.rig
    if rig is None:
        return None
    away, low, high = (1e3 * value for value in (rig.height.value, rig.height.low, rig.height.high))
    height = f"bodies at rest {away:+z.1f} mm from it ({low:z.1f} to {high:z.1f})"
    return _fact(f"board: tilted by {rig.tilt_degrees:.2f} degrees, {height}; length scale {1.0 + rig.scale.value:.4f}")


def noise(evidence: Evidence) -> Finding | None:
    """How much positions scatter."""
    if evidence.fall is None or not evidence.fall.sound:
        return None
    taken = max(one.tracker.position for one in evidence.recordings)
    bounds = f", so bounds are those for {taken:.2g} times the noise of ContactNets' rig" if taken > 1.0 else ""
    return _fact(f"tracking noise: {round(1e3 * evidence.survey.noise, 6):.2g} mm from frame to frame{bounds}")


def motions(evidence: Evidence) -> Finding | None:
    """How many there are."""
    if not evidence.poses:
        return None
    return _fact(f"motions: {len(evidence.outcomes)}, of which {counted_tosses(len(evidence.tosses))}")


def identifiable(evidence: Evidence) -> Finding | None:
    """How accurately vertices and friction can be estimated: Cramer-Rao bounds, which hold for a model that is right."""
    if len(evidence.tosses) < 2 or len(evidence.body.vertices) > MAX_CONTACTS:
        return None
    theta = described_polytope(evidence.body)
    scorer = Scorer(theta.geometry, theta.body, ScoringConfig(form=form_of(None, (theta,))))
    places = np.linspace(0, len(evidence.tosses) - 1, min(MOST_SCORED, len(evidence.tosses))).astype(int)
    scored = [one for one in scorer.score([evidence.tosses[place] for place in places]) if isinstance(one, TossInformation)]
    if not scored:
        return None
    pool = pool_of(scored)
    sure = vertex_uncertainty(pool, pool.ids)
    accuracies = 1e3 * evidence.body.length_scale * sure.largest  # (V,) [mm]
    weak = np.flatnonzero(sure.largest > HARDLY)
    told = [accuracy for vertex, accuracy in enumerate(accuracies.tolist()) if vertex not in weak]
    which = "all" if not len(weak) else f"{len(told)} of"
    parts = [f"{which} {len(accuracies)} vertices to {max(told):.2g} mm"] if told else []
    if sure.friction < HARDLY:
        friction = evidence.body.friction
        parts.append(f"the friction coefficient ({friction:.2g}) to {friction * sure.friction:.1g}")
    best = (
        f"{', '.join(parts)} at best (Cramer-Rao bound, one standard deviation of a model that is right)"
        if parts
        else "neither vertices nor friction"
    )
    of = (
        "these tosses"
        if len(scored) == len(evidence.tosses)
        else f"{len(scored)} of the {counted_tosses(len(evidence.tosses))}"
    )
    lines = [f"to be estimated from {of}: {best}; mass and inertia stay as described"]
    if len(weak):
        places_mm = 1e3 * evidence.body.vertices[weak[:MOST_LISTED]]
        more = ", ..." if len(weak) > MOST_LISTED else ""
        lines.append(
            f"throws that land on {', '.join(_place(each) for each in places_mm)}{more} mm have information about the others"
        )
    if not sure.friction < HARDLY:
        lines.append("throws that slide have information about friction")
    if contact.bounces(evidence) or contact.gives_way(evidence) or contact.friction_varies(evidence):
        lines.append("the model that these bounds hold for is not right here (see above): expect more")
    return _fact("; ".join(lines))


def _place(millimetres: Array) -> str:
    return f"({', '.join(f'{each:.0f}' for each in millimetres)})"


def _fact(what: str) -> Finding:
    return Finding(Severity.FACT, what)
