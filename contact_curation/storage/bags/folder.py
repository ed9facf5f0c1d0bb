"""rosbag2 folders: metadata.yaml, and the storage files of the bag, with or without a correct metadata.yaml.

metadata.yaml is written as ROS 2 Jazzy does. When it is read, it is compared with the storage files, and these count.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import yaml

from contact_curation.errors import UnreadableInputError, why_unreadable
from contact_curation.files import parse_yaml
from contact_curation.storage.addresses import Address
from contact_curation.storage.bags.file import DamagedBagError, Losses
from contact_curation.storage.bags.records import Channel, OfferedQos, profiles_of, qos_from

METADATA_NAME = "metadata.yaml"
METADATA_VERSION = 9
LARGEST_METADATA = 16 << 20
"""Largest accepted metadata.yaml [bytes]; real ones have a few kB."""


@dataclass(frozen=True)
class TopicMetadata:
    """A topic in metadata.yaml: `count` is the number of messages, `qos` is None if it cannot be read."""

    name: str
    type: str
    count: int
    type_hash: str
    qos: OfferedQos | None


@dataclass(frozen=True)
class BagMetadata:
    """The content of metadata.yaml: names of the storage files, in their order, and the topics."""

    files: tuple[str, ...]
    topics: tuple[TopicMetadata, ...]


def metadata_text(file_name: str, topics: Sequence[TopicMetadata], first_ns: int, last_ns: int) -> str:
    """The text of metadata.yaml for a bag of one MCAP file with log times from `first_ns` to `last_ns` [ns]."""
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
        if not path.is_file():  # reading a pipe would block
            raise DamagedBagError("is no regular file")
        if path.stat().st_size > LARGEST_METADATA:
            raise DamagedBagError(f"holds more than {LARGEST_METADATA} bytes")
        content = parse_yaml(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DamagedBagError(f"cannot be read: {error}") from error
    try:
        information = content["rosbag2_bagfile_information"]
        topics = tuple(_topic(entry) for entry in information["topics_with_message_count"])
        return BagMetadata(tuple(Path(str(name)).name for name in information["relative_file_paths"]), topics)
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
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


STORAGE_ENDINGS = (".mcap", ".db3")
COMPRESSED = ".zstd"
EXPECTED = "expected .mcap or .db3 files directly in it, or .pt files of ContactNets' tosses"


class BagFolder(NamedTuple):
    """Storage files in their order, and the content of metadata.yaml; None if there is none."""

    files: tuple[Path, ...]
    metadata: BagMetadata | None


def storage_files(path: Path, losses: Losses) -> BagFolder:
    """The storage files of a bag: `path` itself, or those of the folder `path`.

    Raises:
        UnreadableInputError: a folder holds no storage file, files of both formats, or may not be read.
    """
    try:
        if not path.is_dir():
            return BagFolder((path,), None)
        named = sorted((entry for entry in path.iterdir() if _format(entry)), key=_natural)
        found = [entry for entry in named if isinstance(entry, Address) or entry.is_file()]
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {why_unreadable(path, error)}") from error
    if not found:
        raise UnreadableInputError(path, f"is a folder without storage files; {EXPECTED}")
    for entry in named:
        if entry not in found:  # reading a pipe would block, a device has no end
            what = "is no file but a folder, a pipe, a device or a link to nothing"
            losses.say((entry.name, "no file"), f"{entry}: {what}: left out, the other files of the bag are read")
    metadata = _metadata_if_sound(path / METADATA_NAME, losses)
    files = tuple(found) if metadata is None else _chosen(found, metadata, losses)
    if len({_format(file) for file in files}) > 1:
        raise UnreadableInputError(path, f"holds .mcap and .db3 files, {METADATA_NAME} does not say which; name one of them")
    return BagFolder(files, metadata)


def compare(metadata: BagMetadata, counts: Mapping[Channel, int] | None, channels: Sequence[Channel], losses: Losses) -> None:
    """Reports where metadata.yaml and the storage files disagree; the storage files count.

    Args:
        metadata: content of metadata.yaml.
        counts: messages per channel in the storage files; None if not known.
        channels: channels of all storage files.
        losses: receives the report.
    """
    declared = {topic.name: topic for topic in metadata.topics}
    for topic in sorted({channel.topic for channel in channels} | set(declared)):
        stored = [channel for channel in channels if channel.topic == topic]
        count = None if counts is None else sum(counts.get(channel, 0) for channel in stored)
        for difference in _differences(declared.get(topic), stored, count):
            line = f"{METADATA_NAME} says of {topic}: {difference}; the storage file counts"
            losses.say((METADATA_NAME, topic, difference), line)


def _differences(declared: TopicMetadata | None, stored: Sequence[Channel], count: int | None) -> list[str]:
    if declared is None:
        return ["nothing"]
    if not stored:
        return [f"{declared.count} messages, no storage file knows the topic"] if declared.count else []
    pairs: list[tuple[str, object, set[object]]] = [
        ("type", declared.type, {channel.type for channel in stored}),
        ("type hash", declared.type_hash, {channel.type_hash for channel in stored}),
        ("QoS", declared.qos, {channel.qos for channel in stored}),
    ]
    lines = [f"{what} {said}, stored is {_listed(held)}" for what, said, held in pairs if _contradicts(said, held)]
    if count is not None and count != declared.count:
        lines.append(f"{declared.count} messages, stored are {count}")
    return lines


def _contradicts(said: object, held: set[object]) -> bool:
    """Whether a declared value differs from all stored values; an empty value never does."""
    known = {value for value in held if value}
    return bool(said) and bool(known) and said not in known


def _listed(held: set[object]) -> str:
    return " and ".join(sorted(str(value) for value in held if value))


def _chosen(found: list[Path], metadata: BagMetadata, losses: Losses) -> tuple[Path, ...]:
    """The files that metadata.yaml names; if one of them is missing, all storage files of the folder."""
    by_name = {file.name: file for file in found}
    missing = [name for name in metadata.files if name not in by_name]
    if missing or not metadata.files:
        names = ", ".join(missing) or "no storage file"
        line = f"{METADATA_NAME} names {names}, which is not there: read {', '.join(by_name)}"
        losses.say((METADATA_NAME, "files"), line)
        return tuple(found)
    unnamed = [name for name in by_name if name not in metadata.files]
    if unnamed:
        losses.say((METADATA_NAME, "files"), f"{METADATA_NAME} does not name {', '.join(unnamed)}: not read")
    return tuple(by_name[name] for name in metadata.files)


def _metadata_if_sound(path: Path, losses: Losses) -> BagMetadata | None:
    if not path.exists():
        return None
    try:
        return read_metadata(path)
    except DamagedBagError as error:
        losses.say((METADATA_NAME, "damaged"), f"{METADATA_NAME} {error}: read without it")
        return None


def _format(path: Path) -> str:
    """`.mcap` or `.db3`; empty for other files."""
    ending = Path(path.stem).suffix if path.suffix == COMPRESSED else path.suffix
    return ending if ending in STORAGE_ENDINGS and not path.name.startswith(".") else ""


def _natural(path: Path) -> list[tuple[bool, int | str]]:
    """Sort key that puts `bag_10` after `bag_9`."""
    parts = re.split(r"(\d+)", path.name)
    return [(part.isdecimal(), int(part) if part.isdecimal() else part) for part in parts if part]
