"""rosbag2's metadata.yaml: written as Jazzy does, and read for what it says without being believed."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from contact_curation.storage.bags.errors import DamagedBagError
from contact_curation.storage.bags.qos import profiles_of, qos_from
from contact_curation.storage.bags.records import OfferedQos

METADATA_NAME = "metadata.yaml"
METADATA_VERSION = 9
LARGEST_METADATA = 16 << 20
"""Bytes; real ones have a few kB."""


@dataclass(frozen=True)
class TopicMetadata:
    """What metadata.yaml says about one topic; `count` in messages, `qos` None where it cannot be read."""

    name: str
    type: str
    count: int
    type_hash: str
    qos: OfferedQos | None


@dataclass(frozen=True)
class BagMetadata:
    """What metadata.yaml says: names of the storage files, in their order, and the topics."""

    files: tuple[str, ...]
    topics: tuple[TopicMetadata, ...]


def metadata_text(file_name: str, topics: Sequence[TopicMetadata], first_ns: int, last_ns: int) -> str:
    """metadata.yaml of a bag of one MCAP file whose log times go from `first_ns` to `last_ns`."""
    count = sum(topic.count for topic in topics)
    information = {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        **_extent(first_ns, last_ns, count),
        "topics_with_message_count": [_topic_entry(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [{"path": file_name, **_extent(first_ns, last_ns, count)}],
        "custom_data": None,
        "ros_distro": "jazzy",
    }
    return str(yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False))


def read_metadata(path: Path) -> BagMetadata:
    """Reads metadata.yaml of any rosbag2 release.

    Raises:
        DamagedBagError: the file cannot be read as metadata.
    """
    try:
        if path.stat().st_size > LARGEST_METADATA:
            raise DamagedBagError(f"holds more than {LARGEST_METADATA} bytes")
        information = yaml.safe_load(path.read_text())["rosbag2_bagfile_information"]
        topics = tuple(_topic(entry) for entry in information["topics_with_message_count"])
        return BagMetadata(tuple(Path(str(name)).name for name in information["relative_file_paths"]), topics)
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise DamagedBagError(f"cannot be read: {error}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedBagError(f"is not what rosbag2 writes: {error!r}") from error


def _extent(first_ns: int, last_ns: int, count: int) -> dict[str, object]:
    return {
        "duration": {"nanoseconds": last_ns - first_ns if count else 0},
        "starting_time": {"nanoseconds_since_epoch": first_ns if count else 0},
        "message_count": count,
    }


def _topic_entry(topic: TopicMetadata) -> dict[str, object]:
    description = {
        "name": topic.name,
        "type": topic.type,
        "serialization_format": "cdr",
        "offered_qos_profiles": profiles_of(topic.qos or OfferedQos()),
        "type_description_hash": topic.type_hash,
    }
    return {"topic_metadata": description, "message_count": topic.count}


def _topic(entry: dict[str, dict[str, object]]) -> TopicMetadata:
    description = entry["topic_metadata"]
    return TopicMetadata(
        name=str(description["name"]),
        type=str(description["type"]),
        count=int(str(entry["message_count"])),
        type_hash=str(description.get("type_description_hash") or ""),
        qos=qos_from(description.get("offered_qos_profiles")),
    )
