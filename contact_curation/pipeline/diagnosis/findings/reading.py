"""Whether there is anything to look at: inputs that cannot be read, topics that are missing, messages that are lost."""

from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity, by_recording, of_recordings
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.wording import counted
from contact_curation.storage.bags.reader import AS_PARTS
from contact_curation.storage.inputs.pose_source import BY_TAG_MAP


def unreadable(evidence: Evidence) -> Finding | None:
    """Inputs that are no recordings; a fault where none is one."""
    found = by_recording(evidence, lambda one: one.unreadable)
    if not found:
        return None
    severity = Severity.FAULT if len(found) == len(evidence.recordings) else Severity.WARNING
    name, line = next(iter(found.items()))
    said = of_recordings(evidence, found) if len(evidence.recordings) > 1 else f"{name}: {line}"
    return Finding(severity, f"cannot be read: {said}", "give another, or copy or record it again")


def without_a_topic(evidence: Evidence) -> Finding | None:
    """Bags where no topic, or several, may hold the body's poses."""
    found = by_recording(evidence, lambda one: one.no_topic)
    if not found:
        return None
    remedy = "name the topic with --topic, or give tag detections a --tag-map"
    by_tag_map = any(BY_TAG_MAP in line for line in found.values())
    return Finding(
        Severity.FAULT, of_recordings(evidence, found), remedy, options=("--tag-map", "my_tags.yaml") if by_tag_map else ()
    )


def without_a_message(evidence: Evidence) -> Finding | None:
    """Topics that were chosen, and hold nothing of the body."""

    def line(one: Recording) -> str:
        if one.source is None or len(one.measured) or one.poses:
            return ""
        seen = ", ".join(sorted(one.frames)) or "none"
        topic = one.source.body.name
        if _comes_later(one):
            looked = sum(one.counted.values())
            return f"no message of {topic} among the first {looked} of the recording: look at more of them, --most {looked}"
        read = f"{'' if one.whole else 'the first '}{one.counted.get(topic, 0)} messages of {topic}"
        if one.why_bad or one.losses:
            why = next(iter(one.why_bad.values()), "") or one.losses[0].removeprefix(f"{one.name}: ")
            return f"none of {read} gives a pose of {one.source.body_frame}: {why}"
        none = f"no pose of {one.source.body_frame} in {read}"
        return f"{none}: {one.only_inverted}" if one.only_inverted else f"{none}; frames there: {seen}"

    found = by_recording(evidence, line)
    if not found:
        return None
    silent = [one for one in evidence.recordings if one.name in found]
    explained = any(one.why_bad or one.losses or one.only_inverted or _comes_later(one) for one in silent)
    return Finding(
        Severity.FAULT, of_recordings(evidence, found), "" if explained else "name the body's frame with --body-frame"
    )


def overlapping(evidence: Evidence) -> Finding | None:
    """A folder with several recordings of one topic at one time: their poses are mixed."""
    found = by_recording(evidence, lambda one: next((line for line in one.losses if AS_PARTS in line), ""))
    return Finding(Severity.FAULT, of_recordings(evidence, found)) if found and evidence.mostly_rejected else None


def lost(evidence: Evidence) -> Finding | None:
    """What could not be read of recordings that could."""
    found = by_recording(evidence, _first_loss)
    return Finding(Severity.WARNING, f"parts were lost: {of_recordings(evidence, found)}") if found else None


def not_whole(evidence: Evidence) -> Finding | None:
    """Long recordings are looked at as far as the first messages go."""
    short = [one for one in evidence.recordings if not one.whole]
    if not short:
        return None
    looked = sum(sum(one.counted.values()) or one.poses for one in short)
    return Finding(
        Severity.FACT, f"looked at the first {looked} messages of {counted(len(short), 'long recording')}, not at the rest"
    )


def _comes_later(one: Recording) -> bool:
    """Whether messages of the body's topic come after the part of a recording that was read."""
    if one.source is None or one.whole or one.counted.get(one.source.body.name):
        return False
    return any(topic.count != 0 for topic in one.topics if topic.name == one.source.body.name)


def _first_loss(one: Recording) -> str:
    if one.unreadable or not one.losses:
        return ""
    more = f" (and {len(one.losses) - 1} more)" if len(one.losses) > 1 else ""
    return one.losses[0].removeprefix(f"{one.name}: ") + more
