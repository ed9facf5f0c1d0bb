"""Header stamps: zero, standing still, going back, too seldom, or not when the poses were taken."""

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import Flight, survey
from contact_curation.motion.survey.series import PoseSeries
from contact_curation.pipeline.diagnosis.evidence import NEAREST_UNIT, UNITS, Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity, by_recording, of_recordings
from contact_curation.pipeline.diagnosis.recording import Recording

LOWEST_RATE = 55.0
"""[Hz] Slower poses miss free falls."""

MOST_DISORDER = 0.02
"""Share of stamps that stand still or go back, from which on it is a fault."""

LEAST_JITTER = 1e-4
"""[s] What cameras have anyway."""

SHORT, SOME = 0.75, 0.1
"""Median steps, and the share of shorter ones from which on stamps are uneven."""

LONGEST = 0.2
"""A longer time without poses is a pause [s]."""

WORSE = 1.5
"""Times what is left over with even stamps: as much with the stamps as they are, and they are not when poses were taken."""


def zero(evidence: Evidence) -> Finding | None:
    """Drivers that do not fill header.stamp."""

    def line(one: Recording) -> str:
        stamps = one.measured.stamps_ns
        if one.source is None or not len(stamps) or np.mean(stamps == 0) < 0.5:
            return ""
        share = "all" if np.all(stamps == 0) else f"{100.0 * np.mean(stamps == 0):.0f} % of the"
        return f"{share} header stamps of {one.source.body.name} are 0"

    found = by_recording(evidence, line)
    remedy = "fill header.stamp with the time at which the image was taken"
    return Finding(Severity.FAULT, of_recordings(evidence, found), remedy) if found else None


def out_of_order(evidence: Evidence) -> Finding | None:
    """Stamps that stand still or go back by less than a jump of the clock."""
    worst = 0.0

    def line(one: Recording) -> str:
        nonlocal worst
        steps = np.diff(one.measured.stamps_ns)
        still, back = int((steps == 0).sum()), int((steps < 0).sum())
        if not still + back:
            return ""
        worst = max(worst, (still + back) / len(steps))
        parts = [f"{still} of {len(steps)} header stamps stand still"] if still else []
        farthest = -float(steps.min()) * 1e-9
        parts += (
            [f"{back} {'' if parts else f'of {len(steps)} header stamps '}go back (by up to {farthest:.3g} s)"] if back else []
        )
        return " and ".join(parts)

    found = by_recording(evidence, line)
    if not found:
        return None
    remedy = "give every pose the time of its image, and publish each once"
    return Finding(Severity.FAULT if worst > MOST_DISORDER else Severity.WARNING, of_recordings(evidence, found), remedy)


def slow(evidence: Evidence) -> Finding | None:
    """Poses that come too seldom to see a fall."""
    if not np.isfinite(evidence.period) or evidence.period < 1.0 / LOWEST_RATE:
        return None
    remedy = "record faster; falls and impacts of thrown bodies last hundredths of a second"
    return Finding(Severity.FAULT, f"poses come at {1.0 / evidence.period:.3g} Hz, expected 60 Hz or more", remedy)


def jitter(evidence: Evidence) -> Finding | None:
    """Falls that are parabolas over even stamps, and none over the stamps as they are."""
    found = evidence.survey
    flights = [max(throw.flights, key=lambda flight: flight.stop - flight.first) for throw in found.throws]
    spreads, as_stamped, as_even = [], [], []
    for flight in flights:
        series = found.series[flight.series]
        steps = series.steps[flight.first : flight.stop - 1]
        if len(steps) < 4 or steps.max() > 1.9 * series.period:
            continue
        frames = np.asarray(np.arange(len(steps) + 1) * float(steps.mean()), dtype=float)
        times = np.concatenate([[0.0], np.cumsum(steps)])
        spreads.append(float(np.std(times - np.polyval(np.polyfit(frames, times, 1), frames))))
        as_stamped.append(_left_over(series, flight, times))
        as_even.append(_left_over(series, flight, frames))
    if len(spreads) < 2:
        return _too_uneven_to_fall(evidence)
    spread = float(np.median(spreads))
    if spread < LEAST_JITTER or np.median(as_stamped) < WORSE * np.median(as_even):
        return None
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    remedy = "stamp poses with the time of exposure, not of reception"
    what = f"header stamps jitter by {1e3 * spread:.2g} ms against the motion: falls are even at {1.0 / evidence.period:.4g} Hz"
    return Finding(severity, what, remedy)


def _too_uneven_to_fall(evidence: Evidence) -> Finding | None:
    """Stamps so uneven that nothing seems to fall, though over even ones it does."""
    uneven = [np.mean(one.steps < SHORT * one.period) for one in evidence.survey.series if len(one) > 1]
    if not uneven or np.median(uneven) < SOME:
        return None
    evened = [part for one in evidence.survey.series for part in _evened(one)]
    found = survey(evened)
    size = 0.0 if found.gravity is None else float(np.linalg.norm(found.gravity))
    if len(found.throws) < 2 or not any(
        1.0 / NEAREST_UNIT < size / (evidence.body.gravity * u) < NEAREST_UNIT for u in UNITS.values()
    ):
        return None
    spread = float(np.median([np.std(one.steps[one.steps < LONGEST]) for one in evidence.survey.series if len(one) > 1]))
    period = float(np.median([one.period for one in evened]))
    jitter = f"header stamps jitter by {1e3 * spread / np.sqrt(2.0):.2g} ms against the motion"
    what = f"{jitter}: falls are even at {1.0 / period:.4g} Hz"
    return Finding(Severity.FAULT, what, "stamp poses with the time of exposure, not of reception")


def _evened(series: PoseSeries) -> list[PoseSeries]:
    """The poses between pauses, each with even stamps from its first to its last."""
    parts = np.split(np.arange(len(series)), np.flatnonzero(series.steps > LONGEST) + 1)
    return [
        PoseSeries(
            np.linspace(series.stamps_ns[part[0]], series.stamps_ns[part[-1]], len(part)).astype(np.int64),
            series.positions[part],
            series.orientations_wxyz[part],
        )
        for part in parts
        if len(part) > 1
    ]


def _left_over(series: PoseSeries, flight: Flight, times: Array) -> float:
    """Root mean square of what a parabola leaves of a flight."""
    terms = np.stack([np.ones_like(times), times, times**2], axis=1)
    positions = series.positions[flight.first : flight.stop]
    left = positions - terms @ np.linalg.lstsq(terms, positions, rcond=None)[0]
    return float(np.sqrt(np.mean(np.square(left))))
