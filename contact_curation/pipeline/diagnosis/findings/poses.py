"""Poses that are none, that are missing, or that scatter."""

import numpy as np

from contact_curation.motion.pose_noise import LOUD, MOST, RIG_NOISE
from contact_curation.motion.pose_stream import LOWEST_RATE
from contact_curation.motion.survey.falls import noise_in_the_air
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity, by_recording, of_recordings
from contact_curation.pipeline.diagnosis.recording import Recording

MANY = 0.02
"""Share of bad or missing poses from which on it is worth a line; it is a fault where most motions are rejected."""

BESIDE, QUIET, FAR, OFTEN = 4, 0.002, 0.001, 0.005
"""Outliers: so many poses on either side that span at most so much [m], further away than that [m], in a share of them."""

SHORT = 0.75
"""Median steps: a tracker that loses frames has hardly any that are shorter."""

LONGEST = 0.2
"""A longer time without poses is a pause [s]."""

QUIETER = "more light, larger tags or a nearer camera"
SHARPER = "a shorter exposure, since images are blurred"

BLURRED = 2.0
"""Times: poses scatter by so much more in the air than otherwise, where motion blurs images."""

REMEDIES = {
    "pose": "publish unit quaternions, and nothing where the tracker has no pose",
    "far": "give positions from an origin near the board, in metres",
    "name": "name the body's with --body-frame, or record it whole",
    "twice": "give each tag or body another id or name",
    "array": "say --set poses.array_index=N, counted from 0",
    "lost": f"are these the family and the ids of the tag map? else {QUIETER}",
    "misfit": f"compare the tag map and poses.rectified with the detector (docs/how-to/camera.md); else {QUIETER}",
    **dict.fromkeys(("flip", "unsure"), QUIETER),
}
"""By the kind of a bad pose."""


def not_poses(evidence: Evidence) -> Finding | None:
    """Measurements that are no poses: numbers that are not finite, quaternions that are no rotations."""
    worst, remedies = 0.0, list[str]()

    def line(one: Recording) -> str:
        nonlocal worst
        bad = {kind: count for kind, count in one.bad.items() if kind not in ("frame", "stamp", "clock")}
        if not bad or not (one.poses or len(one.measured)):  # no measurement at all is another finding
            return ""
        most = max(bad, key=lambda kind: bad[kind])
        remedies.append(REMEDIES.get(most, ""))
        total = max(len(one.measured), one.poses + sum(bad.values()))
        worst = max(worst, sum(bad.values()) / total)
        return f"{sum(bad.values())} of {total} poses are unusable, most for this: {one.why_bad[most]}"

    found = by_recording(evidence, line)
    if not found:
        return None
    severity = Severity.FAULT if worst > 0.5 or evidence.mostly_rejected else Severity.WARNING
    return Finding(severity, of_recordings(evidence, found), remedies[0])


def frames_are_lost(evidence: Evidence) -> Finding | None:
    """Frames that are missing between others."""
    lost, there = 0, 0
    for _, series in evidence.series:
        steps = series.steps[series.steps < LONGEST]
        if len(steps) and np.mean(steps < SHORT * series.period) > MANY:
            continue  # stamps that jitter look like missing frames
        there += len(series)
        lost += int(np.maximum(np.rint(steps / series.period) - 1.0, 0.0).sum()) if len(steps) else 0
    share = lost / max(lost + there, 1)
    if share < MANY:
        return None
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    what = f"{100.0 * share:.2g} % of the frames are missing between others, at {1.0 / evidence.period:.4g} Hz"
    remedy = "record with a larger queue, or track in fewer, brighter images: gaps over segmenter.largest_gap reject a toss"
    return Finding(severity, what, remedy)


def outliers(evidence: Evidence) -> Finding | None:
    """Single poses far from where a body that hardly moves is."""
    jumps, slow = list[float](), 0
    for series in evidence.survey.series:
        if len(series) < 4 * BESIDE or evidence.fall is None or not evidence.fall.sound:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(series.positions, 2 * BESIDE + 1, axis=0)  # (W, 3, 9)
        middle = np.median(windows, axis=2)
        quiet = np.linalg.norm(np.percentile(windows, 80, axis=2) - np.percentile(windows, 20, axis=2), axis=1) < QUIET
        near = windows[:, :, BESIDE - 1 : BESIDE + 2] - middle[:, :, np.newaxis]  # (W, 3, 3) the pose between its neighbours
        before, distances, after = np.linalg.norm(near, axis=1).T
        alone = 2.0 * np.maximum(before, after) < distances  # a body that rocks or hops is off in several frames
        slow += int(quiet.sum())
        jumps += distances[quiet & alone & (distances > max(FAR, 12.0 * evidence.survey.noise))].tolist()
    if not slow or len(jumps) < OFTEN * slow:
        return None
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    share, away = 100.0 * len(jumps) / slow, 1e3 * float(np.median(jumps))
    what = f"{share:.2g} % of the poses of a body that hardly moves are outliers, {away:.2g} mm away"
    return Finding(severity, what, "are tags seen at a slant, or in two images? leave out what fits them badly")


def too_noisy(evidence: Evidence) -> Finding | None:
    """Poses that scatter so much that falls cannot be told from noise, but perhaps by a segmenter that expects it."""
    if evidence.fall is not None or not evidence.is_too_noisy or evidence.period > 1.0 / LOWEST_RATE:
        return None
    noise, told = evidence.survey.noise, evidence.config.inputs.segmenter.tracker_noise
    scatter = f"positions scatter by {1e3 * noise:.2g} mm from frame to frame, expected {1e3 * MOST * RIG_NOISE:.2g} mm at most"
    if told is not None and not evidence.mostly_rejected:
        return Finding(Severity.WARNING, f"{scatter}: rig and body cannot be checked", QUIETER)
    what = f"{scatter}: falls cannot be told from noise"
    if told is not None and noise <= LOUD * told * RIG_NOISE:
        return Finding(Severity.FAULT, what, QUIETER)
    setting = _tracker_noise(noise)
    return Finding(Severity.FAULT, what, f"{QUIETER}, or try --set {setting}", settings=(setting,))


def noisy(evidence: Evidence) -> Finding | None:
    """Poses that scatter more than the segmenter expects."""
    multiple = evidence.survey.noise / RIG_NOISE
    told = evidence.config.inputs.segmenter.tracker_noise
    expected = told or 1.0
    if evidence.fall is None or not evidence.fall.sound or multiple <= LOUD * expected:
        return None
    severity = Severity.FAULT if evidence.mostly_rejected else Severity.WARNING
    what = (
        f"positions scatter by {1e3 * evidence.survey.noise:.2g} mm from frame to frame, "
        f"expected {1e3 * RIG_NOISE * expected:.2g} mm"
    )
    noise, quieter = evidence.survey.noise, QUIETER
    in_the_air = noise_in_the_air(evidence.survey.series, evidence.survey.throws)
    blurred = in_the_air > max(BLURRED * noise, LOUD * expected * RIG_NOISE)
    if blurred:
        noise, quieter = in_the_air, SHARPER
        what = f"{what}, and by {1e3 * in_the_air:.2g} mm while bodies fly: noise grows with speed"
    taken = min(one.tracker.position for one in evidence.recordings)
    if told is None and multiple <= LOUD * taken and not (blurred and evidence.mostly_rejected):
        remedy = f"wider bounds were taken, for {taken:.2g} times the noise; less of it by {quieter}"
        return Finding(Severity.WARNING, what, remedy)
    setting = _tracker_noise(noise)
    remedy = f"{quieter}, or try --set {setting}" if blurred or multiple > MOST else f"say --set {setting}"
    return Finding(severity, what, remedy, settings=(setting,))


def _tracker_noise(noise: float) -> str:
    """The setting for positions that scatter by `noise` [m]."""
    return f"segmenter.tracker_noise={np.ceil(10.0 * noise / RIG_NOISE) / 10.0:.1f}"
