"""What is to be known of recordings, sound or not: topics, rates, frames, falls, noise, motions, what they identify."""

import numpy as np

from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.pipeline.diagnosis.evidence import SYMBOLS, Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.theta import described_polytope, form_of
from contact_curation.pipeline.wording import counted, counted_tosses
from contact_curation.solver.cone_problem import MAX_CONTACTS

MOST_SCORED = 24
"""Tosses that are scored to say what they identify."""

HARDLY = 0.02
"""Of the best known vertex: a vertex with less information is hardly touched."""

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
    return _fact(f"tracking noise: {1e3 * evidence.survey.noise:.2g} mm from frame to frame")


def motions(evidence: Evidence) -> Finding | None:
    """How many there are."""
    if not evidence.poses:
        return None
    return _fact(f"motions: {len(evidence.outcomes)}, of which {counted_tosses(len(evidence.tosses))}")


def identifiable(evidence: Evidence) -> Finding | None:
    """What the tosses can tell of theta, by the Fisher information about each vertex, and about friction."""
    if len(evidence.tosses) < 2 or len(evidence.body.vertices) > MAX_CONTACTS:
        return None
    theta = described_polytope(evidence.body)
    scorer = Scorer(theta.geometry, theta.body, ScoringConfig(form=form_of(None, (theta,))))
    places = np.linspace(0, len(evidence.tosses) - 1, min(MOST_SCORED, len(evidence.tosses))).astype(int)
    scored = scorer.score([evidence.tosses[place] for place in places])
    factors = [np.asarray(one.factor, dtype=float) for one in scored if isinstance(one, TossInformation)]
    if not factors:
        return None
    information, names = np.sum([factor.T @ factor for factor in factors], axis=0), list(scorer.form.names())
    first = [names.index(f"vertices_normal[{vertex}][0]") for vertex in range(len(evidence.body.vertices))]
    known = [float(np.linalg.eigvalsh(information[at : at + 3, at : at + 3])[0]) for at in first]
    weak = [vertex for vertex, value in enumerate(known) if value < HARDLY * max(known)]
    sliding = (
        [float(np.square(factor[:, names.index("friction")]).sum()) for factor in factors] if "friction" in names else [0.0]
    )
    slid = sum(value > HARDLY * max(sliding) for value in sliding)
    few = f"{len(known) - len(weak)} of {len(known)} vertices (hardly {_listed(weak)})"
    vertices = few if weak else f"all {len(known)} vertices"
    friction = f"friction by {slid} of {len(factors)} tosses" if slid else "not friction, for no toss slides"
    return _fact(f"identifiable: {vertices}; {friction}; not mass, and the board's tilt and height only with the vertices")


def _listed(vertices: list[int]) -> str:
    return ", ".join(f"vertex {vertex}" for vertex in vertices[:MOST_LISTED]) + (", ..." if len(vertices) > MOST_LISTED else "")


def _fact(what: str) -> Finding:
    return Finding(Severity.FACT, what)
