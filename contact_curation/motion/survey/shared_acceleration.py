"""The acceleration that bodies in the air share, and the windows of poses that have it.

A body in the air has one acceleration, whatever its pose, in every toss; hands and arms that carry it do not repeat theirs so
closely. The acceleration that most windows (survey/series.py) have is gravity, in the unit and the axes of the poses. In much
noise windows of one fall differ: they are then looked for further away, so that those with the same error do not stand for all.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.series import SPAN, LocalFits, PoseSeries

NEAR = 0.08
"""Share of its length: windows whose accelerations differ by less have the same one."""

NEAR_SHARED = 2.0 * NEAR
"""Likewise, of the one that most have."""

BENT = 0.05
"""A parabola fits where what is left of the window is at most this share of its bulge, or 3 times the noise."""

CLEAR = 6.0
"""Times the noise: the bulge of a window that says anything of an acceleration."""

MOST_COMPARED = 1500
"""Windows whose accelerations are compared with each other."""

IMPACT = 2.0
"""Times `BENT`: a fall ends in windows that fit no parabola, which what a hand or an arm does seldom does."""

NOISY = 1.3
"""Times the noise: what it leaves of a window seldom is more."""

TOGETHER = 0.6
"""Flights that follow one another within this time [s] are bounces of one throw."""

ALIKE, NOISIEST = 2.5, 0.5
"""Where noise hides which windows are alike: standard deviations per axis by which they may differ; and the largest share that
this may be of their acceleration, or rests look like falls."""


def shared_acceleration(series: Sequence[PoseSeries], fits: Sequence[LocalFits], noise: float) -> Array | None:
    """(3,) the acceleration that most stretches of time have in common; None where hardly two windows are alike."""
    for before in (_before_impact, _before_the_end):
        kept = [_fitting(fit, noise) & before(fit, noise) for fit in fits]
        rows = [fit.accelerations[mask] for fit, mask in zip(fits, kept, strict=True)]
        stretches = [_stretches(*each) for each in zip(range(len(fits)), series, fits, kept, strict=True)]
        shared = _most_alike(np.concatenate(rows), np.concatenate(stretches)) if rows else None
        if shared is not None and is_hidden(shared, scatter := noise_scatter(series, fits, noise), NEAR):
            shared = _most_alike(np.concatenate(rows), np.concatenate(stretches), scatter)
        if shared is not None:
            return shared
    return None


def noise_scatter(series: Sequence[PoseSeries], fits: Sequence[LocalFits], noise: float) -> float:
    """By how much noise may set apart windows that are alike."""
    found = [fit.noises(one.period)[1] for one, fit in zip(series, fits, strict=True) if len(fit.first)]
    return ALIKE * noise * float(np.median(found)) if found else 0.0


def is_hidden(shared: Array, scatter: float, near: float = NEAR_SHARED) -> bool:
    """Whether noise moves windows further than a share of the acceleration that they have in common, yet falls can be told."""
    length = float(np.linalg.norm(shared))
    return near * length < scatter < NOISIEST * length


def falling(series: PoseSeries, fit: LocalFits, shared: Array, noise: float) -> NDArray[np.bool_]:
    """(W,) windows with the shared acceleration; noise must not choose those that it bends further."""
    length, off = float(np.linalg.norm(shared)), np.linalg.norm(fit.accelerations - shared, axis=1)
    scatter = noise_scatter([series], [fit], noise)
    if is_hidden(shared, scatter):
        return np.asarray((off < scatter) & (fit.residuals < max(BENT * length * SPAN**2 / 8.0, 3.0 * noise)))
    return np.asarray((off < NEAR_SHARED * length) & _fitting(fit, noise))


def _fitting(fit: LocalFits, noise: float) -> NDArray[np.bool_]:
    """(W,) windows that are parabolas, and bent enough to say so."""
    bulge = np.linalg.norm(fit.accelerations, axis=1) * SPAN**2 / 8.0
    return np.asarray((bulge > CLEAR * noise) & (bulge > 0.0) & (fit.residuals < np.maximum(BENT * bulge, 3.0 * noise)))


def _stretches(place: int, series: PoseSeries, fit: LocalFits, kept: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(N, 2) series and stretch of time of its windows: what lies in one of them may be one slide, or one pull of a hand."""
    spans = (series.times[fit.first[kept]] / TOGETHER).astype(np.int64)
    return np.stack([np.full(len(spans), place), spans], axis=1)


def _most_alike(found: Array, stretches: NDArray[np.int64], least: float = 0.0) -> Array | None:
    """(3,) of accelerations (N, 3) the one that most windows and most stretches (N, 2) have; None where hardly two are alike.

    Its length counts, too: slides, and what an arm does alike every time, are slower than falls. Those are alike, too, that
    differ by less than `least`.
    """
    if len(found) < 3:
        return None
    some = np.linspace(0, len(found) - 1, min(len(found), MOST_COMPARED)).astype(int)
    found, names = found[some], np.unique(stretches[some], axis=0, return_inverse=True)[1].ravel()
    lengths = np.linalg.norm(found, axis=1)
    apart = np.linalg.norm(found[:, np.newaxis] - found[np.newaxis], axis=2)
    alike = apart < np.maximum(NEAR * lengths, least)[:, np.newaxis]
    seen = (alike @ np.eye(names.max() + 1)[names] > 0.0).sum(axis=1)
    windows = alike.sum(axis=1)
    best = int(np.argmax(seen * windows * lengths))
    if windows[best] < 3:
        return None
    return np.asarray(np.median(found[alike[best]], axis=0))


def _before_impact(fit: LocalFits, noise: float) -> NDArray[np.bool_]:
    """(W,) windows behind which, within twice their length, one fits no parabola, and not for noise alone."""
    if not len(fit.first):
        return np.zeros(0, dtype=bool)
    ahead = 2 * fit.frames
    padded = np.concatenate([fit.residuals, np.zeros(ahead)])
    worst = np.lib.stride_tricks.sliding_window_view(padded, ahead + 1).max(axis=1)
    bent = IMPACT * BENT * np.linalg.norm(fit.accelerations, axis=1) * SPAN**2 / 8.0
    return np.asarray(worst > np.maximum(bent, NOISY * noise))


def _before_the_end(fit: LocalFits, _: float) -> NDArray[np.bool_]:
    """(W,) windows that poses end behind, within twice their length: a recording may be cut in the air."""
    last = np.append(np.diff(fit.first) > 1, True)[: len(fit.first)]  # of a run
    ends = np.minimum.accumulate(np.where(last, fit.first, np.iinfo(np.int64).max)[::-1])[::-1]
    return np.asarray(ends - fit.first <= 2 * fit.frames)
