"""What a tracker says, message by message: the golden recording, in part."""

from functools import cache
from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import Toss
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.inputs.pose_source import PoseTopicConfig, TypedTopic, find_pose_source


@cache
def measured_of(bag: Path) -> tuple[FramePose, ...]:
    """All poses of a recording, of the body and the board."""
    with BagReader(bag) as reader:
        topics = [TypedTopic(info.name, info.type) for info in reader.topics]
        source = find_pose_source(bag, topics, "cube", PoseTopicConfig())
        found = [one for message in reader.messages() for one in source.measured(message.topic, message.message)]
    return tuple(one for one in found if isinstance(one, FramePose))


def fresh_ingest(source: str = "test") -> TossIngest:
    return TossIngest(IngestConfig(TrackerConfig("body_cube")), CONTACTNETS_CUBE, source=source)


def tosses_in(measured: tuple[FramePose, ...], source: str = "test") -> list[Toss]:
    """What an undisturbed ingest cuts."""
    ingest = fresh_ingest(source)
    events: list[IngestEvent] = [event for one in measured for event in ingest.push(one)]
    return [event for event in events if isinstance(event, Toss)]
