"""Poses that are not as measured: repeated, interpolated, held or filled where the object is hidden, filtered, rounded.

An impact changes a velocity within one frame. With a_k = (z_k+1 - 2 z_k + z_k-1) / dt^2 + g, what contact gives from frame to
frame, the largest two neighbours hold nearly all of it in raw poses, and much less behind a filter. A filter shows in the
noise, too: third differences of white noise correlate from one to the next by -0.75, of filtered noise by less or not at all.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import Survey, noise_in_the_air
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.diagnosis.findings.carried import scattering

RAW = "record the tracker's raw poses, each once, at its own rate"
UNFILTERED = "record raw poses, without a filter behind the tracker"

MOST_REPEATED = 0.2
"""Share of steps of nothing amid motion; of second differences of nothing."""

SHARPEST, SHARP = 0.75, 0.87
"""Shares of an impact in two frames, at the 90th percentile of throws: over 0.9 in raw poses, under the first behind filters
that spoil tosses, and under the second behind weaker ones, such as the mean of each pose and the last, that spoil a model."""

SLOWED = 0.015
"""Share by which a fall is not gravity, where a filter may have done it: then it is the first thing to mend."""

LOST = "publish nothing where the object is not seen: a gap that is known costs less than a pose that is made up"
FEWEST_LOST, OFTEN_LOST = 3, 0.3
"""Motions in which the object was lost, and the share that these are of all, from which on it is worth a line."""

HARD = 20.0
"""Times the noise of `a_k`: of softer impacts the frames around them hold as much of it."""

IMPACT, AROUND = 0.0135, 0.054
"""[s] In which an impact of raw poses is over, two frames at least; what is looked at around it."""

PULLED = 0.75
"""Of the largest push: contact does not pull, and filters ring less. One pose that is off does, by two pushes or a half."""

WHITEST, WHITE = -0.4, -0.69
"""Correlations of successive third differences in the air: from the first on noise is filtered; up to the second it is not, and
noise that grows with speed spreads impacts."""

WHITE_AT_REST = -0.55
"""Correlation at rest, up to which no filter works there: what scatters in the air is then a body that vibrates."""

COARSEST = 2e-4
"""[m] Rounding that moves velocities by more than tracking noise does."""

NOISELESS = 1e-7
"""[s^2] Times gravity: no tracker scatters so little, under 1 um."""

KINK = 6.0
"""Times the median of a flight: larger third differences are no noise."""

FEWEST_FALLS = 6
"""Throws: a body that lands on one corner after the other spreads its impact, too, in two of three throws of the simulator."""

MOVING, STRAIGHT = 0.1, 1e-6
"""Shares of a motion's longest step: what is held or straight between steps so long is so amid the motion; what a line bends
by in numbers with six digits."""

LONGEST_RUN = 9
GAP = 3.5
"""Median steps: where two poses are further apart, nothing is said of what lies between."""


def repeated(evidence: Evidence) -> Finding | None:
    """The last pose sent again until there is another."""
    share = _share(evidence, order=1)
    if share < MOST_REPEATED:
        return None
    rate = 1.0 / evidence.period
    sent = f"a tracker of {rate * (1.0 - share):.0f} Hz sent at {rate:.0f} Hz"
    what = f"{100.0 * share:.0f} % of the poses repeat the one before amid motion: {sent}"
    return Finding(Severity.FAULT, what, RAW)


def interpolated(evidence: Evidence) -> Finding | None:
    """Straight lines between poses: no body falls along them."""
    share = _share(evidence, order=2)
    if share < MOST_REPEATED or _share(evidence, order=1) >= MOST_REPEATED:
        return None
    rate = 1.0 / evidence.period
    sent = f"interpolated from {rate * (1.0 - share):.0f} to {rate:.0f} Hz"
    what = f"{100.0 * share:.0f} % of the poses lie on straight lines between others: {sent}"
    return Finding(Severity.FAULT, what, RAW)


def smoothed(evidence: Evidence) -> Finding | None:
    """Impacts that are spread over frames though contacts are firm, or noise that is not white."""
    if evidence.fall is None or scattering(evidence) is not None:
        return None
    sharpness, colour = _sharpness(evidence.survey), _colour(evidence.survey)
    share = float(np.percentile(sharpness, 90)) if len(sharpness) >= FEWEST_FALLS and not evidence.gives_way else 1.0
    spread = f"impacts are spread over several frames ({100.0 * share:.0f} % of one within two frames, expected over 90 %)"
    if share < SHARPEST:
        what = spread
    elif colour is not None and colour > WHITEST and not _is_white_at_rest(evidence.survey):
        what = f"what scatters in the air is not white (third differences correlate by {colour:+.2f}, expected -0.75)"
    elif share < SHARP and colour is not None and colour > WHITE:
        what = f"poses may be smoothed, and friction and shape be learned wrong: {spread}"
        slowed = abs(evidence.fall.size / evidence.body.gravity - 1.0) > SLOWED
        return Finding(Severity.FAULT if slowed else Severity.WARNING, what, UNFILTERED)
    else:
        return None
    return Finding(Severity.FAULT, f"poses look smoothed: {what}", UNFILTERED)


def held(evidence: Evidence) -> Finding | None:
    """Poses that are repeated within motions, where the tracker lost the object."""
    return None if repeated(evidence) else _lost(evidence, _longest_held, "poses repeat the one before")


def filled(evidence: Evidence) -> Finding | None:
    """Poses on straight lines within motions, by which a tracker filled what it did not see."""
    if interpolated(evidence) or rounded(evidence):
        return None
    return _lost(evidence, _longest_line, "poses lie on a straight line between others")


def rounded(evidence: Evidence) -> Finding | None:
    """Positions with few decimals."""
    if evidence.fall is None or not evidence.fall.sound:
        return None
    grids = [grid for one in evidence.recordings if (grid := _grid(one.measured.positions))]
    if not grids:
        return None
    what = f"positions are rounded to {1e3 * max(grids):.2g} mm"
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    return Finding(severity, what, "record them with all their digits")


def _lost(evidence: Evidence, longest_in: Callable[[Toss], int], how: str) -> Finding | None:
    """What is said of poses that are none, by the most of them in a row in each motion."""
    motions = [one.toss if isinstance(one, Rejected) else one for one in evidence.outcomes]
    runs = [run for one in motions if (run := longest_in(one))]
    if len(runs) < max(FEWEST_LOST, OFTEN_LOST * len(motions)):
        return None
    frames = f"up to {max(runs)} frames" if max(runs) > 1 else "one frame"
    what = f"{how} for {frames} amid {len(runs)} of {len(motions)} motions"
    return Finding(Severity.FAULT if evidence.mostly_rejected else Severity.WARNING, what, LOST)


def _longest_held(toss: Toss) -> int:
    """The most frames in a row that repeat the pose before, amid a motion; of a body at rest they do not count."""
    same = (np.diff(toss.positions, axis=0) == 0.0).all(axis=1) & (np.diff(toss.orientations_wxyz, axis=0) == 0.0).all(axis=1)
    moved = np.flatnonzero(~same)
    if not len(moved):
        return 0
    gaps = np.diff(moved) - 1
    steps = np.linalg.norm(np.diff(toss.positions, axis=0), axis=1)[moved]
    amid = gaps[(steps[1:] > MOVING * steps.max()) & (steps[:-1] > MOVING * steps.max())]
    return int(amid[amid <= LONGEST_RUN].max(initial=0))


def _longest_line(toss: Toss) -> int:
    """The most frames in a row that lie amid the ones beside them, while the body moves: gravity and noise bend its way."""
    steps = np.linalg.norm(np.diff(toss.positions, axis=0), axis=1)
    bent = np.linalg.norm(np.diff(toss.positions, n=2, axis=0), axis=1)
    straight = (bent <= STRAIGHT * steps.max(initial=0.0)) & (steps[:-1] > MOVING * steps.max(initial=0.0))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], straight, [False]])))
    lengths = edges[1::2] - edges[::2]
    return int(lengths[lengths <= LONGEST_RUN].max(initial=0))


def _share(evidence: Evidence, order: int) -> float:
    """Of differences of an order that are nothing, amid motion, in short runs; 0 where nothing moves."""
    none = moving = 0
    for series in evidence.survey.series:
        if len(series) < 16:
            continue
        away = np.linalg.norm(series.positions[6:] - series.positions[:-6], axis=1)
        apart = np.concatenate([[0], np.cumsum(series.steps > GAP * series.period)])
        away[apart[6:] > apart[:-6]] = 0.0
        largest = float(np.percentile(away, 99))
        fast = np.concatenate([[False] * 3, away > 0.25 * max(largest, 1e-12), [False] * 3])
        bent = np.linalg.norm(np.diff(series.positions, n=order, axis=0), axis=1)
        nothing = _in_short_runs(bent <= 1e-7 * max(largest, 1e-12))
        at = fast[1 : 1 + len(bent)]
        none, moving = none + int(nothing[at].sum()), moving + int(at.sum())
    return none / moving if moving else 0.0


def _in_short_runs(marks: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The same without runs longer than `LONGEST_RUN`: a body that is led evenly is no interpolation."""
    padded = np.concatenate([[False], marks, [False]])
    starts, stops = np.flatnonzero(padded[1:] & ~padded[:-1]), np.flatnonzero(~padded[1:] & padded[:-1])
    short = np.zeros_like(marks)
    for start, stop in zip(starts, stops, strict=True):
        short[start:stop] = stop - start <= LONGEST_RUN
    return short


def _sharpness(found: Survey) -> Array:
    """By throw, the share of its first impact in two frames of some 150 a second or fewer, or as long a time."""
    shares = []
    size = 0.0 if found.gravity is None else float(np.linalg.norm(found.gravity))
    noise = max(found.noise, noise_in_the_air(found.series, found.throws))
    for throw in found.throws:
        series, hit = found.series[throw.flights[0].series], throw.flights[0].stop
        stride = max(round(0.5 * IMPACT / series.period), 1)  # over shorter steps noise hides impacts
        period = stride * series.period
        frames = max(round(IMPACT / period), 2)
        before, after = max(3 * frames // 2, 1), max(round(AROUND / period) - 3 * frames // 2, frames + 1)
        first, last = hit - stride * (3 * frames + 1), hit + stride * 7 * frames
        if first < 0 or last + 1 >= len(series) or series.steps[first : last + 1].max() > 1.5 * series.period:
            continue
        heights = series.positions[first : last + 1 : stride] @ found.up
        given = np.diff(heights, n=2) / period**2 + size
        sums = np.convolve(given, np.ones(frames), mode="valid")
        at = int(np.argmax(sums))
        near = given[max(at - before, 0) : at + after]
        around = np.maximum(near, 0.0).sum()
        if near.min() < -PULLED * near.max():
            continue
        if around > 0.0 and sums[at] > HARD * np.sqrt(6.0) * noise / period**2:
            shares.append(float(sums[at] / around))
    return np.array(shares)


def _colour(found: Survey) -> float | None:
    """Correlation of successive third differences in the air; None where there are too few, or no noise."""
    if found.gravity is None or found.noise < NOISELESS * float(np.linalg.norm(found.gravity)):
        return None  # what simulated poses scatter by is contact
    flights = (max(throw.flights, key=lambda one: one.stop - one.first) for throw in found.throws)
    return _correlation(found, [(one.series, one.first + 2, one.stop - 2) for one in flights])


def _is_white_at_rest(found: Survey) -> bool:
    spans = [(one.span.series, one.rest.first, one.rest.stop) for one in found.throws if one.rest is not None]
    colour = _correlation(found, spans)
    return colour is not None and colour < WHITE_AT_REST


def _correlation(found: Survey, spans: Sequence[tuple[int, int, int]]) -> float | None:
    """Of successive third differences within spans (series, first frame, the one after the last)."""
    products = squares = count = 0.0
    for place, first, stop in spans:
        series = found.series[place]
        bent = np.diff(series.positions[first:stop], n=3, axis=0)
        bent = bent[_like_the_others(bent)]  # the release, or a touch, may be among its first and last frames
        if len(bent) < 3 or series.steps[first : stop - 1].max() > 1.5 * series.period:
            continue
        products += float((bent[:-1] * bent[1:]).sum())
        squares += float((bent**2).sum())
        count += len(bent)
    return products / squares if count >= 40 and squares else None


def _like_the_others(bent: Array) -> NDArray[np.bool_]:
    """Rows (n,) of differences (n, 3) that are no larger than noise makes them; simulated poses have none."""
    sizes = np.linalg.norm(bent, axis=1)
    return np.asarray(sizes <= KINK * np.median(sizes)) if len(sizes) else np.zeros(0, dtype=bool)


def _grid(positions: Array) -> float:
    """The decimal grid that all positions lie on [m]; 0 where it is finer than `COARSEST`."""
    rows = positions[np.isfinite(positions).all(axis=1)]
    if len(rows) < 16:
        return 0.0
    for grid in (1e-2, 5e-3, 1e-3, 5e-4, 2.5e-4):
        if grid >= COARSEST and np.abs(rows / grid - np.rint(rows / grid)).max() < 1e-5:
            return grid
    return 0.0
