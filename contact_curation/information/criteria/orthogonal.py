"""orthogonal: tosses whose scores point in different directions (method.md 1.8), on toss scores s = sum_t g_t.

pivoted: R = S; repeat: pick the longest row of R, take its direction out of all rows. This is QR with column pivoting on S^T,
greedy volume maximisation. Once every direction is used up it starts again with the original lengths.
max-cosine: start with the longest score; then the toss whose largest |cosine| with the picked ones is smallest. A diagnostic.
literal: the same with raw |inner products|, as the paper prints it. It prefers tosses that say nothing (method.md E15, 0.5) and
is here for the record only.
"""

from collections.abc import Sequence

import numpy as np

from contact_curation.errors import UnknownNameError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.criterion import Criterion, Need, RankingConfig, register
from contact_curation.information.pool import Indices, Pool
from contact_curation.information.ranking import Selection, greedy_selection
from contact_curation.information.subspace import pool_subspace
from contact_curation.information.ties import first_of_the_best

VARIANTS = ("pivoted", "max-cosine", "literal")

USED_UP = 1e-10
"""What is left of the scores below this share of the longest is rounding: every direction has been picked."""


def toss_scores(pool: Pool, *, centre: bool = False) -> Array:
    """Toss scores (K, P).

    Args:
        pool: K tosses.
        centre: whether every transition's score is taken relative to the pool's mean score.
    """
    scores = pool.toss_scores
    if not centre:
        return scores
    counts = pool.scored_transitions
    return np.asarray(scores - np.outer(counts, scores.sum(axis=0) / max(int(counts.sum()), 1)))


def select_orthogonal(scores: Array, top: int, variant: str = "pivoted") -> Selection:
    """Up to `top` tosses with scores in different directions.

    Args:
        scores: (K, P) toss scores, in the order of the ids.
        top: how many tosses to select.
        variant: one of `VARIANTS`.

    Raises:
        InvalidValueError: there is no such variant.
    """
    lengths = np.linalg.norm(scores, axis=1)
    longest = float(lengths.max())
    scaled = scores / longest if longest > 0.0 else scores
    count = min(top, len(scores))
    if variant == "pivoted":
        picks, gains, final = _pivoted(scaled, count)
        return greedy_selection(picks, longest * gains, lengths, longest * final)
    if variant == "max-cosine":
        silent = lengths == 0.0
        directions = scores / np.where(silent, 1.0, lengths)[:, None]
        picks, gains, final = _least_aligned(directions, lengths, silent.astype(float), count)
        return greedy_selection(picks, gains, lengths, final)
    if variant == "literal":
        picks, gains, final = _least_aligned(scaled, lengths, np.zeros(len(scores)), count)
        return greedy_selection(picks, longest**2 * gains, lengths, longest**2 * final)
    raise UnknownNameError("orthogonal variant", variant, VARIANTS)


def _pivoted(scores: Array, count: int) -> tuple[Indices, Array, Array]:
    """Picks (k,), the length of each that was new (k,), and the new length of every toss in the end (K,)."""
    left = np.ones(len(scores), dtype=np.bool_)
    rest = scores.copy()
    lengths = np.linalg.norm(rest, axis=1)
    picks, gains = [], []
    for _ in range(count):
        if np.where(left, lengths, 0.0).max() <= USED_UP:
            rest = scores.copy()
            lengths = np.linalg.norm(rest, axis=1)
        pick = first_of_the_best(np.where(left, lengths, -1.0))
        picks.append(pick)
        gains.append(float(lengths[pick]))
        left[pick] = False
        if lengths[pick] > 0.0:
            direction = rest[pick] / lengths[pick]
            rest -= np.outer(rest @ direction, direction)
            lengths = np.linalg.norm(rest, axis=1)
    return np.array(picks), np.array(gains), lengths


def _least_aligned(vectors: Array, lengths: Array, worst: Array, count: int) -> tuple[Indices, Array, Array]:
    """Picks (k,), minus the largest |inner product| of each with the earlier ones (k,), and that of every toss in the end (K,).

    `worst` (K,) is what it starts from: 0, or 1 for a toss without a score, whose direction is unknown.
    """
    left = np.ones(len(vectors), dtype=np.bool_)
    picks, gains = [], []
    for step in range(count):
        pick = first_of_the_best(np.where(left, -worst if step else lengths, -np.inf))
        picks.append(pick)
        gains.append(-float(worst[pick]))
        left[pick] = False
        worst = np.maximum(worst, np.abs(vectors @ vectors[pick]))
    return np.array(picks), np.array(gains), -worst


def _select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
    return select_orthogonal(_together([_configured_scores(pool, config) for pool in pools]), config.top, config.variant)


def _configured_scores(pool: Pool, config: RankingConfig) -> Array:
    scores = toss_scores(pool, centre=config.centre)
    return np.asarray(scores @ pool_subspace(pool, config.cut).whitening) if config.whiten else scores


def _together(scores: Sequence[Array]) -> Array:
    """Toss scores (K, sum of P) side by side, each particle's divided by its root mean square length."""
    if len(scores) == 1:
        return scores[0]
    lengths = [float(np.sqrt((each * each).sum(axis=1).mean())) or 1.0 for each in scores]
    return np.concatenate([each / length for each, length in zip(scores, lengths)], axis=1)


ORTHOGONAL = register(
    Criterion(
        "orthogonal",
        "length of the toss's score",
        "characteristic units",
        _select,
        needs=frozenset({Need.THETA, Need.EXACT_SCORES}),
        choices={"variant": VARIANTS},
    )
)
