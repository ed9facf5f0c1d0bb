"""metadata.yaml may be missing, name other files or say anything: the storage files are what is read."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from rosbags.rosbag2 import StoragePlugin

from contact_curation.storage.bags.reader import BagReader
from test.storage.written_bags import CUBE, ODOMETRY, STRING, assert_same, read, recording, write_ours, write_rosbag2

SENT = recording(700)
SQLITE = StoragePlugin.SQLITE3


def edited(folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """The folder, with what `change` makes of its metadata."""
    path = folder / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    change(content["rosbag2_bagfile_information"])
    path.write_text(yaml.safe_dump(content))
    return folder


def odometry_entry(information: dict[str, Any]) -> dict[str, Any]:
    entries: list[dict[str, Any]] = information["topics_with_message_count"]
    return next(entry for entry in entries if entry["topic_metadata"]["name"] == CUBE)


def described_as(**changes: object) -> Callable[[dict[str, Any]], None]:
    return lambda information: odometry_entry(information)["topic_metadata"].update(changes)


METADATA_LIES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "count": (lambda i: odometry_entry(i).update(message_count=0), f"says of {CUBE}: 0 messages, stored are 700"),
    "type": (described_as(type=STRING), f"says of {CUBE}: type {STRING}, stored is {ODOMETRY}"),
    "type hash": (described_as(type_description_hash="RIHS01_0"), f"says of {CUBE}: type hash RIHS01_0, stored is RIHS01_"),
    "QoS": (described_as(offered_qos_profiles="- {durability: 1}"), f"says of {CUBE}: QoS"),
    "a topic too many": (described_as(name="/other"), "says of /other: 700 messages, no storage file knows the topic"),
    "a topic missing": (lambda i: i["topics_with_message_count"].remove(odometry_entry(i)), f"says of {CUBE}: nothing"),
    "file name": (lambda i: i.update(relative_file_paths=["other.mcap"]), "names other.mcap, which is not there: read bag"),
    "no file name": (lambda i: i.update(relative_file_paths=[]), "names no storage file"),
    "no topics": (lambda i: i.pop("topics_with_message_count"), "is not what rosbag2 writes"),
    "a count that is no number": (lambda i: odometry_entry(i).update(message_count="many"), "is not what rosbag2 writes"),
}


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["mcap", "db3"])
@pytest.mark.parametrize("lie", METADATA_LIES)
def test_metadata_that_disagrees_is_said_and_the_storage_file_is_read(tmp_path: Path, lie: str, ending: str) -> None:
    folder = write_ours(tmp_path / "bag", SENT) if ending == "mcap" else write_rosbag2(tmp_path / "bag", SENT, SQLITE)
    change, expected = METADATA_LIES[lie]
    found, losses = read(edited(folder, change))
    assert_same(found, SENT)
    if lie == "QoS" and ending == "db3":  # rosbags stored none
        return
    assert any(expected in line for line in losses), losses


def test_a_folder_without_metadata_is_read(tmp_path: Path) -> None:
    for folder in (write_ours(tmp_path / "a", SENT), write_rosbag2(tmp_path / "b", SENT, SQLITE)):
        (folder / "metadata.yaml").unlink()
        found, losses = read(folder)
        assert_same(found, SENT)
        assert losses == ()


def metadata_of_aliases(repeated: str) -> str:
    """Metadata of one topic whose name is a billion times what is repeated."""
    lists = [f"a{level}: &a{level} [{', '.join([f'*a{level - 1}'] * 10)}]" for level in range(1, 10)]
    topic = "topic_metadata: {name: *a9, type: a/msg/A}"
    information = f"relative_file_paths: [bag.mcap], topics_with_message_count: [{{ {topic}, message_count: 1}}]"
    return "\n".join([f"a0: &a0 {repeated}", *lists, f"rosbag2_bagfile_information: {{ {information} }}"])


@pytest.mark.parametrize("repeated", ["x", "x" * 100_000])
def test_metadata_whose_aliases_stand_for_far_more_are_said_and_not_unfolded(tmp_path: Path, repeated: str) -> None:
    folder = write_ours(tmp_path / "bag", SENT)
    (folder / "metadata.yaml").write_text(metadata_of_aliases(repeated))
    found, losses = read(folder)
    assert_same(found, SENT)
    assert losses == ("metadata.yaml cannot be read: its aliases stand for over 1000000 values: read without it",)


def test_storage_files_may_have_any_digits_in_their_names(tmp_path: Path) -> None:
    folder = write_ours(tmp_path / "bag", SENT)
    next(folder.glob("*.mcap")).rename(folder / "0\u00b21.mcap")
    (folder / "metadata.yaml").unlink()
    assert_same(read(folder)[0], SENT)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"a: [", b"just text", b"- 1"])
def test_metadata_that_is_no_yaml_is_said_and_the_storage_file_is_read(tmp_path: Path, content: bytes) -> None:
    folder = write_ours(tmp_path / "bag", SENT)
    (folder / "metadata.yaml").write_bytes(content)
    found, losses = read(folder)
    assert_same(found, SENT)
    assert len(losses) == 1
    assert losses[0].startswith("metadata.yaml ")


def test_a_storage_file_that_complete_metadata_does_not_name_is_left_out_and_said(tmp_path: Path) -> None:
    folder = write_ours(tmp_path / "bag", SENT)
    write_ours(folder / "other.mcap", SENT)
    found, losses = read(folder)
    assert_same(found, SENT)
    assert losses == ("metadata.yaml does not name other.mcap: not read",)


def test_the_qos_of_metadata_stands_in_where_the_storage_file_has_none(tmp_path: Path) -> None:
    folder = write_rosbag2(tmp_path / "bag", SENT, SQLITE)

    def latch(information: dict[str, Any]) -> None:
        odometry_entry(information)["topic_metadata"]["offered_qos_profiles"] = [{"durability": "transient_local"}]

    with BagReader(edited(folder, latch)) as reader:
        assert reader.qos(CUBE).latched
