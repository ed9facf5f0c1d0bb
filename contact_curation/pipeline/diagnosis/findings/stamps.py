"""Header stamps: zero, standing still, going back, too seldom, not when the poses were taken, or closed up over lost frames."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.pose_stream import LOWEST_RATE
from contact_curation.motion.scales import scale_of
from contact_curation.motion.survey.lost_frames import lost_frames
from contact_curation.motion.survey.series import WIDEST_STEP, PoseSeries
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity, by_recording, of_recordings
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.storage.inputs.bag_tosses import OVERTAKEN_NS

MOST_DISORDER = 0.02
"""Share of stamps that stand still or go back, from which on it is a fault."""

EVEN, MOSTLY = 0.25, 0.9
"""Steps that differ from the usual one by less than this share are even; so many are, where stamps are sound."""

FEWEST_CLOSED_UP, MOST_CLOSED_UP = 2, 0.05
"""Places at which frames are lost: fewer are no word worth; more, for each motion, are a fault."""

SEPARATE = "record a topic for each camera, and choose by --topic"

APART = "where they disagree, record a topic for each, and choose by --topic"

WINDOW, STILL, CERTAIN = 8, 0.02, 6.0
"""Steps, and speed [m/s], at which a body lies still, and by how many standard errors its poses then alternate."""

WRITTEN = 1e-3
"""Stamps that were written at a rate are even to this share of a period; those of a tracker are not."""


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
    """Stamps that stand still or go back by less than a jump of the clock, and are no jitter; or log times that are late."""
    worst = 0.0
    late, several = False, list[str]()

    def line(one: Recording) -> str:
        nonlocal worst, late
        steps = np.diff(one.measured.stamps_ns)
        still, back = int((steps == 0).sum()), int((steps < 0).sum())
        again = int(((steps == 0) & ~np.any(np.diff(one.measured.positions, axis=0), axis=1)).sum())
        left_out = one.bad.get("stamp", 0) - again
        if not left_out or not still + back:
            return ""
        worst = max(worst, left_out / len(steps))
        parts = [f"{still} of {len(steps)} header stamps stand still"] if still else []
        if _of_several_at_once(one):
            names = " and ".join(f"'{name}'" for name in sorted(one.parents))
            parts = [f"{parts[0]}: poses in {names} have the same ones"]
            several.append(one.name)
        farthest = -float(steps.min()) * 1e-9
        if not still and _even_in_order(one.measured.stamps_ns):
            late = True
            return f"{back} of {len(steps)} poses were logged out of order (by up to {farthest:.3g} s); their stamps are sound"
        parts += (
            [f"{back} {'' if parts else f'of {len(steps)} header stamps '}go back (by up to {farthest:.3g} s)"] if back else []
        )
        return " and ".join(parts)

    found = by_recording(evidence, line)
    if not found:
        return None
    remedy = "give every pose the time of its image, and publish each once"
    if late:
        remedy = f"write it anew in the order of header stamps; up to {1e-9 * OVERTAKEN_NS:g} s is corrected"
    elif several:
        remedy = SEPARATE
    return Finding(Severity.FAULT if worst > MOST_DISORDER else Severity.WARNING, of_recordings(evidence, found), remedy)


def _of_several_at_once(one: Recording) -> bool:
    """Whether what has the stamp of the pose before is mostly in another frame, as of two cameras."""
    again = np.diff(one.measured.stamps_ns) == 0
    return bool(again.any()) and float(np.mean((one.measured.frames[1:] != one.measured.frames[:-1])[again])) > MOSTLY


def published_twice(evidence: Evidence) -> Finding | None:
    """Poses that come again with their stamps: each counts once."""

    def line(one: Recording) -> str:
        again = (np.diff(one.measured.stamps_ns) == 0) & ~np.any(np.diff(one.measured.positions, axis=0), axis=1)
        share = float(again.mean()) if len(again) else 0.0
        return f"{again.sum()} of {len(again) + 1} poses are there twice, and count once" if share > MOST_DISORDER else ""

    found = by_recording(evidence, line)
    return Finding(Severity.WARNING, of_recordings(evidence, found), "publish each once") if found else None


def _even_in_order(stamps_ns: NDArray[np.int64]) -> bool:
    """Whether stamps are evenly spaced once they are sorted: then the log is out of order and not the stamps."""
    steps = np.diff(np.sort(stamps_ns))
    return float(np.mean(np.abs(steps - np.median(steps)) < EVEN * np.median(steps))) > MOSTLY


def slow(evidence: Evidence) -> Finding | None:
    """Poses that come too seldom to see a fall."""
    if not np.isfinite(evidence.period) or evidence.period < 1.0 / LOWEST_RATE:
        return None
    remedy = "record faster; falls and impacts of thrown bodies last hundredths of a second"
    return Finding(Severity.FAULT, f"poses come at {1.0 / evidence.period:.3g} Hz, expected 60 Hz or more", remedy)


def jitter(evidence: Evidence) -> Finding | None:
    """Stamps that were evened before anything else was made of the poses."""
    found = by_recording(evidence, lambda one: one.stamps_done)
    remedy = "stamp poses with the time of exposure, not of reception"
    return Finding(Severity.WARNING, of_recordings(evidence, found), remedy) if found else None


def by_turns(evidence: Evidence) -> Finding | None:
    """Two cameras whose poses come on one topic, after uneven steps, of which the segmenter may take the longer for gaps."""
    seen = [one for recording in evidence.recordings for one in recording.series if one.pair_period]
    if not seen:
        return None
    pair = seen[0].pair_period
    short = float(np.median(seen[0].steps[seen[0].steps < 0.5 * pair]))
    what = f"poses come by turns {1e3 * short:.3g} and {1e3 * (pair - short):.3g} ms after the last, as of two cameras"
    if pair - short <= evidence.config.inputs.segmenter.largest_gap * short:
        return Finding(Severity.FACT, what, APART)
    setting = f"segmenter.largest_gap={np.ceil(10.0 * pair / short - 9.0) / 10.0:.1f}"
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    return Finding(severity, what, f"say --set {setting}; {APART}", settings=(setting,))


def disagreeing(evidence: Evidence) -> Finding | None:
    """Two cameras by turns that see a body that lies still at two places: its poses alternate from frame to frame."""
    found = [_alternations(one) for _, one in evidence.series if len(one) > WINDOW + 1]
    windows = [np.concatenate(parts) for parts in zip(*found)]
    means = [window.mean(axis=2) for window in windows]
    errors = [np.sqrt(window.var(axis=2).mean(axis=1) / WINDOW) for window in windows]
    apart = [np.linalg.norm(mean, axis=1) for mean in means]
    if not any(len(size) and np.mean(size > CERTAIN * error) > 0.5 for size, error in zip(apart, errors)):
        return None
    place, turn = (float(np.median(size)) for size in apart)
    what = f"bodies that lie still move to and fro by {1e3 * place:.2g} mm and {np.degrees(turn):.2g} degrees"
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    what = f"{what} from frame to frame: two cameras that disagree?"
    return Finding(severity, what, "record a topic for each", other_poses=True)


def _alternations(series: PoseSeries) -> tuple[Array, Array]:
    """(N, 3, WINDOW) of displacements [m] and of turns [rad], every second one reversed, where a body lies still."""
    moved, orientations = np.diff(series.positions, axis=0), series.orientations_wxyz
    turned = quaternions.log(quaternions.multiply(quaternions.conjugate(orientations[:-1]), orientations[1:]))
    pairs = series.positions[1:] + series.positions[:-1]  # in which two cameras cancel
    speeds = np.linalg.norm(pairs[WINDOW - 1 :] - pairs[: 1 - WINDOW], axis=1) / (2.0 * (WINDOW - 1) * series.period)
    sound = series.steps < WIDEST_STEP * series.period  # also where rounded poses stand still, or only jumps would be left
    still = sliding_window_view(sound, WINDOW).all(axis=1) & (speeds < STILL)
    signs = (-1.0) ** np.arange(WINDOW)
    moves, turns = (signs * sliding_window_view(each, WINDOW, axis=0)[still] for each in (moved, turned))
    return moves, turns


def closed_up(evidence: Evidence) -> Finding | None:
    """Even stamps over frames that were lost, by the flights on both sides of them; it needs no fall that is whole."""
    if evidence.config.inputs.segmenter.closed_up:
        return None
    reach, gravity, lost = scale_of(evidence.body).reach, evidence.body.gravity, list[int]()
    for _, one in evidence.series:
        missing = lost_frames(one.positions, one.orientations_wxyz, one.period, reach, gravity)
        lost += missing[(missing > 0) & (one.steps < WIDEST_STEP * one.period)].tolist()
    if len(lost) < FEWEST_CLOSED_UP:
        return None
    many = len(lost) > MOST_CLOSED_UP * max(len(evidence.outcomes), 1)
    severity = Severity.FAULT if many or evidence.mostly_rejected else Severity.WARNING
    longest = f"{max(lost) + 1} periods" if max(lost) == min(lost) else f"{min(lost) + 1} to {max(lost) + 1} periods"
    what = f"frames are lost in {len(lost)} places, and their stamps were closed up: {longest} of motion in one step"
    remedy, setting = "stamp each pose with the time of its image", "segmenter.closed_up=true"
    if not all(_written_at_a_rate(recording.measured.stamps_ns) for recording, _ in evidence.series):
        return Finding(severity, what, remedy)
    return Finding(severity, what, f"say --set {setting}, or {remedy}", settings=(setting,))


def _written_at_a_rate(stamps_ns: NDArray[np.int64]) -> bool:
    steps = np.diff(stamps_ns)
    return not len(steps) or bool(np.median(np.abs(steps - np.median(steps))) < WRITTEN * np.median(steps))
