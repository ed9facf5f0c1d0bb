"""Detected corners that do not fit the tag map, and the setting or the line of the map that is wrong."""

from math import ceil

from contact_curation.motion.tags.fit import Explanation
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity, by_recording, of_recordings
from contact_curation.pipeline.diagnosis.recording import Recording

MANY = 0.01
"""Share of images whose corners fit no pose, from which on noise is worth a line."""

LARGEST_NOISE = 1.0
"""[px] Corners that are off by more are no noise."""

DOUBTFUL = ("misfit", "flip")


def corners_do_not_fit(evidence: Evidence) -> Finding | None:
    """Corners that other settings or another map would let fit, or that are noisier than expected."""
    settings: list[str] = []
    remedies: list[str] = []

    def line(one: Recording) -> str:
        if one.tags is None:
            return ""
        misfit = f"corners of tags are off by {one.tags.misfit:.3g} expected deviations"
        if one.tags.misfit > 1e3:
            misfit = "corners of tags fit no pose"
        better = one.tags.better
        if better is not None:
            what, remedy, changes = _explained(better)
            settings.extend(changes)
            remedies.append(remedy)
            if better.tag_id is not None:
                return f"corners of tags do not fit in some images, and do {what}"
            return f"{misfit}, and are off by {better.misfit:.3g} {what}"
        noise = one.tags.misfit * evidence.config.inputs.poses.tags.noise.deviation
        doubtful = sum(one.bad.get(kind, 0) for kind in DOUBTFUL)
        if noise > LARGEST_NOISE or one.tags.misfit < 2.0 or doubtful <= MANY * (doubtful + one.poses):
            return ""
        settings.append(f"poses.tags.noise.deviation={ceil(100.0 * noise) / 100.0:g}")
        remedies.append(f"if the tag map is right to a millimetre, corners are noisy: say --set {settings[-1]}")
        return f"{misfit}, which is {noise:.2g} px"

    found = by_recording(evidence, line)
    if not found:
        return None
    sound = bool(evidence.outcomes) and not evidence.mostly_rejected and not settings
    return Finding(
        Severity.WARNING if sound else Severity.FAULT,
        of_recordings(evidence, found),
        remedies[0],
        settings=tuple(dict.fromkeys(settings)),
        other_poses=not sound,
    )


def _explained(better: Explanation) -> tuple[str, str, list[str]]:
    """With what corners fit, what to do, and the settings for it."""
    if better.tag_id is not None:
        where = f"tag {better.tag_id} of {better.frames[0]}"
        return f"without {where}", "it is not where the tag map has it: measure its position, orientation and edge", []
    if better.frames:
        longer = f"with edges of {' and '.join(better.frames)} times {better.scale:.3g}"
        return longer, "correct `edge` in the tag map: it is that of the black square, without the white rim", []
    changes: list[str] = []
    if better.rectified is not None:
        changes.append(f"poses.rectified={str(better.rectified).lower()}")
    if better.corner_order is not None:
        changes.append(f"poses.tags.corner_order={better.corner_order.value}")
    said = [f"--set {one}" for one in changes] + ["the other `axes` in the tag map"] * better.other_axes
    remedies = [f"say --set {one}" for one in changes] + ["change `axes` in the tag map"] * better.other_axes
    return f"with {' and '.join(said)}", " and ".join(remedies), changes
