"""Contacts that the usual model does not describe, seen before anything is learned; and the friction of bodies that slide."""

import numpy as np

from contact_curation.learning.evaluation.misfit import slides_apart_in_words, variation_in_words
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.wording import counted_tosses

FAR = 1.5
"""How many times the described friction is that of sliding bodies, or the reverse, where tosses are scored at a wrong one."""


def bounces(evidence: Evidence) -> Finding | None:
    """First impacts that leave the board faster than a body without restitution does."""
    seen = evidence.bounce
    return Finding(Severity.FACT, seen, "learn it, too: train --set training.restitution=true") if seen else None


def gives_way(evidence: Evidence) -> Finding | None:
    """Corners that sink in farther than a rigid body's on a firm board."""
    seen = evidence.softness
    mend = "a firmer board, or a body that is not larger than its corners say; models here are rigid"
    return Finding(Severity.WARNING, seen, mend) if seen else None


def friction_varies(evidence: Evidence) -> Finding | None:
    """Frictions that differ between tosses."""
    seen = variation_in_words(evidence.sliding)
    mend = "clean body and board; one coefficient describes their mean only"
    return Finding(Severity.WARNING, seen, mend) if seen else None


def slides_apart(evidence: Evidence) -> Finding | None:
    """Tosses that do not slide as the others do."""
    seen = slides_apart_in_words(evidence.sliding)
    mend = "did a hand, a cable or another object push, did the board move, or is it of two materials? leave such tosses out"
    return Finding(Severity.WARNING, seen, mend) if seen else None


def friction(evidence: Evidence) -> Finding | None:
    """The friction of bodies that slide, beside the one that is described."""
    found = evidence.sliding
    if found is None:
        return None
    slid, described = float(np.median(found.friction)), evidence.body.friction
    line = f"sliding friction: {slid:.3f} (median of {counted_tosses(len(found.friction))} that slid), described {described:g}"
    if max(slid, described) < FAR * min(slid, described):
        return Finding(Severity.FACT, line)
    return Finding(Severity.WARNING, line, f"describe it so: --friction {slid:.2g}")
