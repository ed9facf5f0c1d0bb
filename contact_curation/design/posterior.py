"""Thetas that the known tosses leave open, to predict the information of a throw (method.md 5).

The motion of a throw depends on theta so much that a search finds throws which tell a lot at one theta and much less at its
neighbours, half a millimetre away. So the gain of a throw is stated over executions that move by thetas of their own, from

    N(theta, B (n / (n - 1) sum_i s_i s_i^T + sigma^4 A_p) B)        B = (H + sigma^2 A_p)^-1,   H = sum_i F_i

with F_i and s_i the information and score of toss i of n, scores about their mean, A_p what is known before any toss, and
sigma^2 their dispersion, n / (n - 1) sum_i s_i^T B s_i / tr(B H). It is the sandwich over tosses (method.md 2.8), in no
direction wider than before any toss. F of a motion is taken at theta itself, since that is where its toss will be scored.
"""

from collections.abc import Sequence

import numpy as np

from contact_curation.contact.geometry_parameters import INITIAL_NOISE, ContactGeometry
from contact_curation.contact.parameter_form import Form, ParameterForm, moved_geometry
from contact_curation.design.predicted_information import Particle
from contact_curation.geometry.quaternions import Array
from contact_curation.information.record import TossInformation
from contact_curation.information.subspace import identifiable_subspace, sandwich_covariance

FEWEST = 4
"""Tosses whose scores say how much they vary."""

LEAST = 1e-16
"""Variance in a direction that is known exactly, so that the covariance has a root."""

QUIETEST = 1e-12
"""Least sigma^2, as a share of the information: of copies of one toss the scores do not vary."""

ROUNDS = 3
"""In which sigma^2 settles."""


def posterior_draws(particle: Particle, known: Sequence[TossInformation], count: int, seed: int) -> tuple[ContactGeometry, ...]:
    """Thetas drawn about a particle's, in mirrored pairs.

    Args:
        particle: theta.
        known: information of tosses at it.
        count: an even number.
        seed: of the draws.

    Returns:
        `count` thetas; none where fewer than `FEWEST` tosses are known, or theta has no physical form.
    """
    form = particle.scorer.form
    if len(known) < FEWEST or form.form is Form.CONTACTNETS:
        return ()
    root = np.linalg.cholesky(_covariance(known, form))
    half = np.random.default_rng(seed).standard_normal((count // 2, form.size)) @ root.T
    return tuple(moved_geometry(particle.geometry, form, step) for draw in half for step in (draw, -draw))


def _covariance(known: Sequence[TossInformation], form: ParameterForm) -> Array:
    """(P, P) of theta."""
    information = np.sum([info.fisher() for info in known], axis=0)
    scores = np.array([info.score_sum for info in known])
    scores = np.sqrt(len(known) / (len(known) - 1.0)) * (scores - scores.mean(axis=0))
    before = np.eye(form.size) / INITIAL_NOISE**2
    size = float(np.trace(information)) * INITIAL_NOISE**2
    if not size > 0.0:
        return np.asarray(np.eye(form.size) * INITIAL_NOISE**2)
    variance = 1.0
    for _ in range(ROUNDS):
        white = identifiable_subspace(information + variance * before).whitening
        variance = max(float(((scores @ white) ** 2).sum() / np.trace(white.T @ information @ white)), QUIETEST * size)
    bread = identifiable_subspace(information + variance * before)
    sandwich = sandwich_covariance(bread, np.concatenate([scores, variance * np.sqrt(before)]))
    variances, directions = np.linalg.eigh(sandwich)
    return np.asarray(directions * np.clip(variances, LEAST, INITIAL_NOISE**2) @ directions.T)
