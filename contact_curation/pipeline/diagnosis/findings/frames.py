"""Whether the board's frame was found, and whose poses these are."""

from collections import defaultdict

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.motion.body_tracker import AROUND
from contact_curation.motion.survey.series import WIDEST_STEP
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity, by_recording, of_recordings
from contact_curation.pipeline.diagnosis.findings import stamps
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.storage.inputs.pose_source import is_of_another

ON_BOARD = ("--board-frame", "")
MOST_LISTED = 8

MANY = 0.01
"""Share of poses that wait for the board in vain, from which on it is worth a line."""


FEWEST_CHANGES, CERTAIN, LEAST, SPOILS, MOST = 5, 6.0, 2e-4, 1e-3, 0.05
"""Changes from frame to frame, and times the usual unevenness of a motion as the noisiest camera sees it; [m] by which poses
jump with them, by which they spoil tosses, and by which they would if the body had been carried away meanwhile."""

SMOOTH = 0.5
"""Of a jump: so little a step after it differs from the one before it, where nothing strikes the body."""

NEARBY = 0.1
"""[s] Jumps are compared with steps so near in time: poses scatter more in flight, where cameras take over, than at rest."""


def disagreeing(evidence: Evidence) -> Finding | None:
    """Cameras that see the body one after the other, at places that differ: it jumps when another one sees it."""
    found = [_jumps(one) for one in evidence.recordings if len(one.parents) > 1]
    changes = np.concatenate([np.zeros(0), *(jumps for jumps, _ in found)])
    others = {name: np.concatenate([own[name] for _, own in found if name in own]) for _, each in found for name in each}
    uneven = [float(np.median(sizes)) for sizes in others.values() if len(sizes) >= FEWEST_CHANGES]
    if len(changes) < FEWEST_CHANGES or not uneven or stamps.disagreeing(evidence) is not None:
        return None
    size = float(np.median(changes))
    if size < max(LEAST, CERTAIN * max(uneven)):
        return None
    names = " and ".join(
        f"'{name}'" for name in sorted(next(one.parents for one in evidence.recordings if len(one.parents) > 1))
    )
    what = f"poses jump by {1e3 * size:.2g} mm where they come from another one of {names}: cameras that disagree"
    severity = Severity.FAULT if size > SPOILS or evidence.mostly_rejected else Severity.WARNING
    remedy = f"calibrate where they are to each other, or {stamps.SEPARATE}"
    return Finding(severity, what, remedy, other_poses=True)


def _jumps(one: Recording) -> tuple[Array, dict[str, Array]]:
    """By how much steps differ from those around them [m]: steps to another frame amid smooth motion; those near, by frame.

    One camera may be much noisier than the other.
    """
    changes, others = [np.zeros(0)], defaultdict[str, list[Array]](list)
    for series in one.series:
        _, own, measured = np.intersect1d(series.stamps_ns, one.measured.stamps_ns, return_indices=True)
        names, moved = one.measured.frames[measured], np.diff(series.positions[own], axis=0)
        if len(moved) < 3:
            continue
        other, even = names[1:] != names[:-1], np.diff(series.times[own]) < WIDEST_STEP * series.period
        reach = round(NEARBY / series.period)
        near = np.convolve(other, np.ones(2 * reach + 1))[reach : reach + len(other)] > 0.5
        beside = ~other[:-2] & ~other[2:] & even[:-2] & even[1:-1] & even[2:]
        sizes = np.linalg.norm(moved[1:-1] - 0.5 * (moved[:-2] + moved[2:]), axis=1)
        smooth = (np.linalg.norm(moved[2:] - moved[:-2], axis=1) < SMOOTH * sizes) & (sizes < MOST)
        changes.append(sizes[beside & other[1:-1] & smooth])
        usual = beside & ~other[1:-1] & near[1:-1]
        for name in set(names[1:-2][usual].tolist()):
            others[name].append(sizes[usual & (names[1:-2] == name)])
    return np.concatenate(changes), {name: np.concatenate(found) for name, found in others.items()}


def board_is_not_found(evidence: Evidence) -> Finding | None:
    """Most poses wait in vain for what leads from the board's frame to theirs."""

    def line(one: Recording) -> str:
        lost = one.bad.get("frame", 0)
        if one.source is None or lost <= one.poses or AROUND in one.why_bad["frame"]:
            return ""
        if one.tags is not None and one.tags.has_board:
            return ""  # its tags give no pose, which others say
        parent = max(one.parents, key=lambda name: one.parents[name], default="")
        board = one.source.board_frame
        if not parent:
            return f"header.frame_id of {one.source.body.name} is empty, so that nothing leads from it to the board '{board}'"
        there = ", ".join(sorted(one.frames)[:MOST_LISTED])
        given = f"'{parent}', in which {one.source.body.name} gives poses"
        why = one.why_bad.get("static", f"frames there: {there}")
        return f"nothing leads from the board's frame '{board}' to {given}; {why}"

    found = by_recording(evidence, line)
    if not found:
        return None
    remedy = "record /tf_static, name the board with --board-frame NAME, or say --board-frame '' where poses are given on it"
    return Finding(Severity.FAULT, of_recordings(evidence, found), remedy, options=ON_BOARD)


def board_is_seldom_known(evidence: Evidence) -> Finding | None:
    """Poses at whose time nothing says where the board is."""
    worst = 0.0

    def line(one: Recording) -> str:
        nonlocal worst
        lost = one.bad.get("frame", 0)
        share = lost / max(lost + one.poses, 1)
        if share < MANY or (share > 0.5 and AROUND not in one.why_bad["frame"]):
            return ""
        worst = max(worst, share)
        return f"{lost} of {lost + one.poses} poses are left out: {one.why_bad['frame']}"

    found = by_recording(evidence, line)
    return Finding(Severity.FAULT if worst > 0.5 else Severity.WARNING, of_recordings(evidence, found)) if found else None


def taken_as_on_board(evidence: Evidence) -> Finding | None:
    """Poses in some other frame, and nothing at all that leads to the board."""

    def line(one: Recording) -> str:
        if one.source is None or not one.taken_as_on_board:
            return ""
        parent = next(iter(one.parents))
        named = f"in frame '{parent}'" if parent else "without a header.frame_id"
        return f"poses come {named} and nothing leads to the board '{one.source.wanted_board}': taken as given on it"

    found = by_recording(evidence, line)
    if not found:
        return None
    if any(one.series and not one.taken_as_on_board for one in evidence.recordings):
        remedy = "others know the board: give the folder of a split bag, whose first file alone has /tf_static"
        return Finding(Severity.FAULT, of_recordings(evidence, found), remedy)
    remedy = "if they are, say --board-frame ''; else record /tf and /tf_static"
    return Finding(Severity.FAULT, of_recordings(evidence, found), remedy, options=ON_BOARD)


def of_several_bodies(evidence: Evidence) -> Finding | None:
    """Messages of one topic that are of several frames, none of them the body's."""

    def line(one: Recording) -> str:
        if one.source is None or not one.source.is_mixed:
            return ""
        names = ", ".join(f"'{name}'" for name in sorted(one.source.children)[:MOST_LISTED])
        return f"{one.source.body.name} has poses of {names}, none of them {evidence.body.name}'s"

    found = by_recording(evidence, line)
    return Finding(Severity.FAULT, of_recordings(evidence, found), "name one with --body-frame") if found else None


def of_another_body(evidence: Evidence) -> Finding | None:
    """A topic that is called after another body."""

    def line(one: Recording) -> str:
        if one.source is None or not is_of_another(one.source.body.name, evidence.body.name, evidence.config.inputs.poses):
            return ""
        return f"no topic is named after {evidence.body.name}: took {one.source.body.name}"

    found = by_recording(evidence, line)
    remedy = "give the body of these poses with --body, or name its topic with --topic"
    return Finding(Severity.FAULT, of_recordings(evidence, found), remedy) if found else None
