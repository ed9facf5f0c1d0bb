"""Header stamps: zero, standing still, going back, too seldom, or not when the poses were taken."""

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.survey.falls import Flight
from contact_curation.motion.survey.series import PoseSeries
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity, by_recording, of_recordings
from contact_curation.pipeline.diagnosis.recording import Recording

LOWEST_RATE = 55.0
"""[Hz] Slower poses miss free falls."""

MOST_DISORDER = 0.02
"""Share of stamps that stand still or go back, from which on it is a fault."""

LEAST_JITTER = 1e-4
"""[s] What cameras have anyway."""

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
        return None
    spread = float(np.median(spreads))
    if spread < LEAST_JITTER or np.median(as_stamped) < WORSE * np.median(as_even):
        return None
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    remedy = "stamp poses with the time of exposure, not of reception"
    what = f"header stamps jitter by {1e3 * spread:.2g} ms against the motion: falls are even at {1.0 / evidence.period:.4g} Hz"
    return Finding(severity, what, remedy)


def _left_over(series: PoseSeries, flight: Flight, times: Array) -> float:
    """Root mean square of what a parabola leaves of a flight."""
    terms = np.stack([np.ones_like(times), times, times**2], axis=1)
    positions = series.positions[flight.first : flight.stop]
    left = positions - terms @ np.linalg.lstsq(terms, positions, rcond=None)[0]
    return float(np.sqrt(np.mean(np.square(left))))
