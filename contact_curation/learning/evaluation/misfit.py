"""Contacts that a rigid body with one friction and no restitution does not describe, seen in tosses without a fit.

Bounds on accuracy hold for a model that is right; where one of these lines stands they say too little.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import MODERATE_FRICTION
from contact_curation.contact.rollout import rollout
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.rebounds import rebounds
from contact_curation.motion.survey.sliding import Sliding, sliding
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, states_of, transitions_of

FEWEST, FEWEST_SLIDING = 8, 5
"""Tosses, for a line about all of them, and about those that slide, whose frictions are known one by one."""

BOUNCING = 0.07
"""By how much the median share of its approach speed with which a corner leaves the first impact is above that of the body as
described without restitution, whose corners can rise when the next one lands. See `benchmarks.learning.misfit_words`."""

DEEP = 0.12
"""How far corners go below where they rest, from which on a line says so [characteristic lengths]. Corners of the real cube go
0.026 deep, of the bouncing square 0.065, of bodies on MuJoCo's firm board up to 0.12 (`benchmarks.learning.misfit_words`)."""

RESTING = 8
"""Last frames of a toss, in which the body rests."""

NOISY = 3.0
"""Standard deviations at rest by which noise lowers the lowest of some hundred frames."""

VARYING = 0.1
"""Standard deviation of frictions over tosses, relative to their median: the real cube's is 0.05."""

NAMED = 5
"""Tosses that a line names, at most."""

SLIDING = 0.6
"""Share of the frames in which a body moves on the board whose contacts use up their friction. Where it is less, a fit learns a
friction that is 8 to 42 % too low (`benchmarks.learning.misfit_words`)."""

USED_UP = 0.9
"""Share of its friction that a sliding contact uses at least; the tracker's noise turns the rest."""

NEEDED, MOSTLY = 0.99, 0.5
"""Contacts that use this share of a model's friction need all of it; if they are at rest in more than the second share of such
frames, the friction is higher than the model's."""

GRIPPING = 1.2
"""A learned friction above the described one, and above a moderate one, by more than this factor should be described."""

DESCRIBE = (
    "; much friction is learned better where it is described: give --friction {0:.1f}, or friction: {0:.1f} in the object's "
    "file, and rank and train again"
)

BY_CHANCE = 0.01
"""Probability that any corner of a right model is as far from where it is known to be as a line says."""

LOADED, MOVING = 0.3, 0.05
"""A body moves on the board where the contacts carry so much of its weight, and a corner may be faster than this [m/s]; a
contact is at rest that is slower."""


def bounce_in_words(tosses: Sequence[Toss], body: Body) -> str:
    """How fast corners leave first impacts, if a body without restitution does not leave them so; else empty."""
    if len(tosses) < FEWEST:
        return ""
    states = [states_of(toss, body.length_scale) for toss in tosses]
    first, periods = np.stack([one[0] for one in states]), [toss.frame_period for toss in tosses]
    rigid = rollout(ContactGeometry.of_body(body).rigid(), body, first, [len(one) for one in states], periods)
    seen, without = rebounds(np.concatenate(states), rigid.starts, body), rebounds(rigid.states, rigid.starts, body)
    if min(len(seen), len(without)) < FEWEST:
        return ""
    share, own = float(np.median(seen)), float(np.median(without))
    if share - own < BOUNCING:
        return ""
    return (
        f"the body bounces: corners leave first impacts with {share:.2f} of their speed "
        f"({max(own, 0.0):.2f} without a restitution; medians of {len(seen)} tosses)"
    )


def softness_in_words(tosses: Sequence[Toss], body: Body) -> str:
    """How far corners go below where they rest, if a firm board would not let them; else empty."""
    if len(tosses) < FEWEST:
        return ""
    depth = impact_depth(tosses, body)
    if depth < DEEP * body.length_scale:
        return ""
    return (
        f"soft contacts: corners go {1e3 * depth:.1f} mm below where they rest (median of {len(tosses)} tosses; "
        f"expected {1e3 * DEEP * body.length_scale:.1f} mm at most)"
    )


def impact_depth(tosses: Sequence[Toss], body: Body) -> float:
    """How far the lowest corner goes below where the body rests, less what the tracker's noise does; median over tosses [m]."""
    lowest = [body.polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1) for toss in tosses]
    resting = [heights[-RESTING:] for heights in lowest]
    depths = [np.median(rest) - NOISY * rest.std() - heights.min() for rest, heights in zip(resting, lowest, strict=True)]
    return float(np.median(depths))


def variation_in_words(found: Sliding | None) -> str:
    """How far frictions of tosses differ, if they do; else empty."""
    if found is None or found.variation < VARYING:
        return ""
    low, high = np.percentile(found.friction, [10, 90])
    return f"friction varies between tosses: {low:.2f} to {high:.2f} in 8 of 10 tosses ({len(found.friction)} slid)"


def slides_apart_in_words(found: Sliding | None) -> str:
    """Which tosses do not slide as the others do, if some do not; else empty."""
    if found is None or not found.apart.any():
        return ""
    apart = sorted(np.flatnonzero(found.apart).tolist(), key=lambda at: -abs(found.friction[at] - found.median))
    named = ", ".join(f"{found.toss_ids[at]} ({found.friction[at]:.2f})" for at in apart[:NAMED])
    return (
        f"some tosses slide otherwise: {len(apart)} of {len(found.friction)} that slid slow down by another friction than the "
        f"{found.median:.2f} of the others: {named}{', ...' if len(apart) > NAMED else ''}"
    )


def sliding_of(tosses: Sequence[Toss], body: Body) -> Sliding | None:
    """Frictions of the tosses that slide; None of fewer than `FEWEST_SLIDING`, or where most become faster."""
    found = sliding(tosses, _reach(body), body.gravity)
    return found if len(found.friction) >= FEWEST_SLIDING and found.median > 0.0 else None


def sliding_in_words(found: Sliding | None, friction: float, interval: float) -> str:
    """How tosses slide, if not with a learned friction; else empty.

    Args:
        found: their frictions.
        friction: learned.
        interval: half width of its 95 % interval by the fit alone.
    """
    if found is None or abs(found.median - friction) <= interval + found.median_interval:
        return ""
    return (
        f"bodies that slide slow down by a friction of {found.median:.3f} (median of {len(found.friction)} tosses), the "
        f"model's is {friction:.3f}: impacts decide a fit, and their friction is another one, or contacts are soft; the "
        "interval contains both"
    )


def sticking_in_words(data: Transitions, geometry: ContactGeometry | None, body: Body, found: Sliding | None) -> str:
    """How seldom contacts slide, if so seldom that the learned friction is or may be too low; else empty.

    Nothing is said against bodies that slide with no more friction: contacts of a model that is wrong otherwise stick, too.

    Args:
        data: that it was learned from, as theta describes it (`information.impacts.as_described`).
        geometry: learned, to the optimum; None otherwise, and for a network.
        body: that moves.
        found: frictions of the tosses that slide; None where they are not known.
    """
    if geometry is None or len(data.toss_ids) < FEWEST:
        return ""
    use = friction_use(data, geometry, body)
    if use is None or use.sliding >= SLIDING:
        return ""
    friction = geometry.friction
    if found is not None and found.median <= friction:
        return ""
    describe = ""
    if friction > GRIPPING * max(body.friction, MODERATE_FRICTION):
        describe = DESCRIBE.format(np.ceil(10.0 * friction) / 10.0)
    higher = "so the friction is" if use.at_rest > MOSTLY else "in others they stick or roll, where the friction may be"
    return (
        f"friction hardly used up: contacts slide in {100.0 * use.sliding:.0f} % of the frames that move on the board "
        f"(expected {100.0 * SLIDING:.0f} % at least), {higher} higher than the {friction:.2f} that is learned{describe}"
    )


def displaced_in_words(known: Array, learned: Array, known_to: float) -> str:
    """How far corners are from where they are known to be, if too far for chance; else empty.

    Where a model does not fit, its corners leave the known ones for that reason.

    Args:
        known: (V, 3) corners as described [m].
        learned: (V, 3) [m].
        known_to: standard deviation of each number [m].
    """
    from scipy.special import ndtri  # takes a quarter of a second to import

    farthest = float(np.abs(learned - known).max())
    most = float(-ndtri(0.5 * BY_CHANCE / known.size))
    if farthest <= most * known_to:
        return ""
    return (
        f"corners were learned up to {1e3 * farthest:.1f} mm from where they are known to {1e3 * known_to:g} mm (expected "
        f"{1e3 * most * known_to:.1f} mm at most): they are not known so exactly, or the model does not fit these tosses"
    )


class FrictionUse(NamedTuple):
    """How far contacts use up the friction of a model in the frames that move on the board.

    Attributes:
        sliding: share of the frames whose contacts use it up.
        at_rest: of those whose contacts need all of it, the share whose contacts do not move along the board all the same.
    """

    sliding: float
    at_rest: float


def friction_use(data: Transitions, geometry: ContactGeometry, body: Body) -> FrictionUse | None:
    """None without frames that move on the board; a body that rolls or tumbles over a corner moves, and does not slide."""
    impulses = evaluate(geometry, body, data.before, data.after, data.dt).impulses
    loads, tangential = impulses[:, :, 0], np.linalg.norm(impulses[:, :, 1:], axis=2).sum(axis=1)
    normal = loads.sum(axis=1)
    along, spins = (np.linalg.norm(data.before[:, part], axis=1) for part in (slice(7, 9), slice(10, 13)))
    speeds = np.hypot(body.length_scale * along, _reach(body) * spins)
    moving = (normal > LOADED * body.mass * body.scaled_gravity * data.dt) & (speeds > MOVING)
    if not moving.any():
        return None
    needed = moving & (tangential > NEEDED * normal)
    after = data.after[needed]
    turning = np.cross(after[:, np.newaxis, 10:13], geometry.vertices_tangent)  # (N, V, 3)
    slips = after[:, np.newaxis, 7:10] + quaternions.rotate(after[:, np.newaxis, 3:7], turning)
    mean_slips = (loads[needed] * np.linalg.norm(slips[:, :, :2], axis=2)).sum(axis=1) / normal[needed]
    at_rest = float(np.mean(body.length_scale * mean_slips < MOVING)) if needed.any() else 0.0
    return FrictionUse(float(np.mean(tangential[moving] > USED_UP * normal[moving])), at_rest)


def _reach(body: Body) -> float:
    """Distance of its farthest corner from its centre [m]."""
    return float(np.linalg.norm(body.vertices, axis=1).max())


def misfits(tosses: Sequence[Toss], body: Body, geometry: ContactGeometry | None, *, bounces: bool) -> tuple[str, ...]:
    """What a model of some tosses lacks, one line each. Where it lacks a bounce, its friction is wrong for that reason.

    Args:
        tosses: that it is learned from.
        body: as described.
        geometry: learned, to the optimum; None otherwise, and for a network.
        bounces: whether the model has a restitution.
    """
    bounce = "" if bounces else bounce_in_words(tosses, body)
    data, slid = as_described(transitions_of(tosses, body.length_scale), geometry, body), sliding_of(tosses, body)
    lines = (
        bounce,
        softness_in_words(tosses, body),
        variation_in_words(slid),
        slides_apart_in_words(slid),
        "" if bounce else sticking_in_words(data, geometry, body, slid),
    )
    return tuple(line for line in lines if line)
