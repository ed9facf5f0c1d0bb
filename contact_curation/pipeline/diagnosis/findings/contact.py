"""Contacts that a rigid body with one friction and no restitution does not describe, seen before anything is learned.

Bounds on accuracy hold for a model that is right; where one of these lines stands they say too little.
"""

import numpy as np

from contact_curation.motion.survey.sliding import Sliding, sliding
from contact_curation.motion.transitions import states_of
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.wording import counted_tosses

FEWEST = 8
"""Tosses, for a line about all of them."""

BOUNCING = 0.12
"""Median share of its approach speed with which a corner leaves the first impact: simulated cubes that do not bounce have at
most 0.02, with a restitution of 0.15 they have 0.19, the real one has 0.27."""

VARYING = 0.1
"""Standard deviation of frictions over tosses, relative to their median: the real cube's is 0.05."""


def bounces(evidence: Evidence) -> Finding | None:
    """First impacts that leave the board faster than a body without restitution does."""
    from contact_curation.learning.evaluation.without_model import rebounds  # PyTorch takes a second to import

    tosses, body = evidence.tosses, evidence.body
    if len(tosses) < FEWEST:
        return None
    states = [states_of(toss, body.length_scale) for toss in tosses]
    starts = np.concatenate([[0], np.cumsum([len(one) for one in states])])
    shares = rebounds(np.concatenate(states), starts, body)
    if len(shares) < FEWEST or (share := float(np.median(shares))) < BOUNCING:
        return None
    seen = f"corners leave first impacts with {share:.2f} of their speed (median of {counted_tosses(len(shares))})"
    return Finding(Severity.FACT, f"the body bounces: {seen}", "learn it, too: train --set training.restitution=true")


def friction_varies(evidence: Evidence) -> Finding | None:
    """Frictions that differ between tosses."""
    found = _sliding(evidence)
    if found is None or found.variation < VARYING:
        return None
    low, high = np.percentile(found.friction, [10, 90])
    spread = f"{low:.2f} to {high:.2f} in 8 of 10 tosses ({len(found.friction)} slid)"
    mend = "clean body and board; one coefficient describes their mean only"
    return Finding(Severity.WARNING, f"friction varies between tosses: {spread}", mend)


def friction(evidence: Evidence) -> Finding | None:
    """The friction of bodies that slide, beside the one that is described."""
    found = _sliding(evidence)
    if found is None:
        return None
    middle = float(np.median(found.friction))
    seen = f"{middle:.3f} (median of {counted_tosses(len(found.friction))} that slid)"
    return Finding(Severity.FACT, f"sliding friction: {seen}, described {evidence.body.friction:g}")


def _sliding(evidence: Evidence) -> Sliding | None:
    radius = float(np.linalg.norm(evidence.body.vertices, axis=1).max())
    found = sliding(evidence.tosses, radius, evidence.body.gravity)
    return found if len(found.friction) >= FEWEST else None
