"""A session's bag is readable while it grows, and is gone on with after its writer was killed."""

import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.storage.bags import session as session_bag
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import OfferedQos, RawMessage
from contact_curation.storage.bags.session import SessionBag

LATCHED, VOLATILE = OfferedQos(latched=True), OfferedQos()
KILLED = """
import sys, os, signal
from pathlib import Path
from contact_curation.storage.bags.session import SessionBag
from test.storage.bags.test_session import LATCHED, VOLATILE, said
bag = SessionBag(Path(sys.argv[1]))
for number in range(300):
    bag.write(said("/poses", number), LATCHED)
    bag.write(said("/truth", number), VOLATILE)
bag.flush()
bag.write(said("/poses", 300), LATCHED)
os.kill(os.getpid(), signal.SIGKILL)
"""


def said(topic: str, number: int) -> RawMessage:
    """A std_msgs/String in CDR."""
    text = f"number {number}".encode() + b"\0"
    data = b"\0\1\0\0" + len(text).to_bytes(4, "little") + text
    return RawMessage(topic, "std_msgs/msg/String", 1000 + number, data, 900 + number, "string data\n", "ros2msg", "RIHS01_x")


def heard(path: Path, topic: str) -> list[str]:
    with BagReader(path) as reader:
        assert not reader.losses or "cut short" in reader.losses[0]
        return [one.message.data for one in reader.messages([topic])]


def test_what_was_flushed_can_be_read_while_the_bag_grows_and_byte_for_byte(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    with SessionBag(path) as bag:
        bag.write(said("/truth", 1), VOLATILE)
        bag.flush()
        assert heard(path, "/truth") == ["number 1"]
        bag.write(said("/truth", 2), VOLATILE)
    with BagReader(path) as reader:
        assert list(reader.raw_messages()) == [said("/truth", 1), said("/truth", 2)]
        assert reader.qos("/truth") == VOLATILE
        assert not reader.losses


def test_a_killed_writer_leaves_what_was_flushed_and_the_next_one_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    assert subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False).returncode == -9
    assert heard(path, "/poses") == [f"number {number}" for number in range(300)]
    with SessionBag(path) as bag:
        assert bag.losses
        new = [bag.write(said("/poses", number), LATCHED) for number in range(250, 310)]
        assert new == [False] * 50 + [True] * 10
        assert bag.write(said("/truth", 299), VOLATILE)
    assert heard(path, "/poses") == [f"number {number}" for number in range(310)]
    assert len(heard(path, "/truth")) == 301
    with BagReader(path) as reader:
        assert reader.qos("/poses") == LATCHED


def test_of_a_latched_topic_the_newest_are_known_in_any_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_bag, "REMEMBERED", 10)
    with SessionBag(tmp_path / "session.mcap") as bag:
        assert all(bag.write(said("/poses", number), LATCHED) for number in [*range(0, 50, 2), *range(1, 50, 2)])
        assert not any(bag.write(said("/poses", number), LATCHED) for number in range(49, 39, -1))


def test_only_one_may_write_and_a_refused_one_takes_nothing_away(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    with SessionBag(path) as bag:
        bag.write(said("/truth", 1), VOLATILE)
        bag.flush()
        with pytest.raises(InvalidValueError):
            SessionBag(path)
        bag.write(said("/truth", 2), VOLATILE)
    assert heard(path, "/truth") == ["number 1", "number 2"]
