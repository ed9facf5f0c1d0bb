"""What cannot be decoded, a topic or a message, costs only itself, and is said with its reason."""

from pathlib import Path

import pytest

from contact_curation.storage.bags.file import BagLimits
from contact_curation.storage.bags.reader import BagReader
from test.storage.written_bags import CUBE, NOTE, ODOMETRY, Sent, assert_same, read, recording, write_mcap, write_ours

SENT = recording(700)


class OddlySent(Sent):
    """A message of a type that JAZZY does not know."""

    @property
    def cdr(self) -> bytes:
        return bytes(self.message)


class Odd(bytes):
    __msgtype__ = "vendor_msgs/srv/Ask_Event"


EVENT = OddlySent("/ask/_service_event", SENT[5].log_time_ns, Odd(b"\x00\x01\x00\x00" + bytes(16)))
SCHEMAS = {
    "service event": ("service_msgs/ServiceEventInfo info\nvendor_msgs/Ask_Request[<=1] request\n", "ros2msg"),
    "request and response": ("int32 a\n---\nint32 b\n", "ros2msg"),
    "unknown nested type": ("vendor_msgs/Unheard of\n", "ros2msg"),
    "no definition": ("", "ros2msg"),
    "nonsense": ("%$§ \x00", "ros2msg"),
    "protobuf": ("\x0a\x00", "protobuf"),
    "within itself": ("vendor_msgs/Ask_Event again\n", "ros2msg"),
    "endless array": (
        "geometry_msgs/Point[4000000000] points\n" + "=" * 80 + "\nMSG: geometry_msgs/Point\nfloat64 x\n",
        "ros2msg",
    ),
    "endless string of types": ("int32 a\n" * 200_000, "ros2msg"),
}


@pytest.mark.parametrize("kind", SCHEMAS)
def test_a_topic_of_an_unknown_type_costs_only_itself(tmp_path: Path, kind: str) -> None:
    path = write_mcap(tmp_path / "bag.mcap", [*SENT, EVENT, EVENT], {Odd.__msgtype__: SCHEMAS[kind]})
    found, losses = read(path)
    assert_same(found, SENT)
    assert len(losses) == 1
    assert losses[0].startswith("/ask/_service_event: 2 messages of vendor_msgs/srv/Ask_Event could not be decoded")
    assert read(path, [CUBE])[1] == ()


def test_a_definition_of_more_fields_than_any_message_has_is_refused_before_code_is_generated(tmp_path: Path) -> None:
    fields = "\n".join(f"float64 f{number}" for number in range(4001))
    path = write_mcap(tmp_path / "bag.mcap", [*SENT[:3], EVENT], {Odd.__msgtype__: (fields, "ros2msg")})
    (line,) = read(path)[1]
    assert line.endswith("it has 4001 fields where at most 4000 are accepted")


def test_messages_of_an_unknown_type_can_be_passed_on(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "bag.mcap", [*SENT, EVENT], {Odd.__msgtype__: SCHEMAS["service event"]})
    with BagReader(path) as reader:
        (raw,) = reader.raw_messages([EVENT.topic])
        assert (raw.data, raw.type, raw.schema) == (EVENT.cdr, Odd.__msgtype__, SCHEMAS["service event"][0])
        assert reader.losses == ()


def test_messages_that_are_not_cdr_are_left_out_and_said(tmp_path: Path) -> None:
    found, losses = read(write_mcap(tmp_path / "bag.mcap", SENT, encoding="json"))
    assert found == []
    assert len(losses) == 2
    assert "encoded as 'json'" in losses[0]


def test_two_definitions_of_one_type_are_each_used_for_their_own_topic(tmp_path: Path) -> None:
    class Longer(bytes):
        __msgtype__ = "vendor_msgs/msg/Longer"

    text = f"std_msgs/Header header\n{'=' * 80}\nMSG: std_msgs/Header\nuint32 seq\n"
    longer = OddlySent("/longer", SENT[-1].log_time_ns, Longer(b"\x00\x01\x00\x00" + (9).to_bytes(4, "little")))
    found, losses = read(write_mcap(tmp_path / "bag.mcap", [*SENT, longer], {Longer.__msgtype__: (text, "ros2msg")}))
    assert losses == ()
    assert found[-1].message.header.seq == 9
    assert_same(found[:-1], SENT)


def test_a_type_hash_that_is_not_that_of_the_definition_is_said(tmp_path: Path) -> None:
    path = write_ours(tmp_path / "bag.mcap", recording(3))
    data = path.read_bytes()
    at = data.rindex(b"RIHS01_")
    path.write_bytes(data[: at + 7] + b"0" * 64 + data[at + 71 :])
    found, losses = read(path)
    assert_same(found, recording(3))
    assert any("type hash" in line for line in losses) or any("index" in line for line in losses)


def test_messages_that_do_not_decode_are_counted_with_the_reason(tmp_path: Path) -> None:
    class Cut(Sent):
        @property
        def cdr(self) -> bytes:
            return super().cdr[:-20]

    cut = [Cut(*one) if number in (3, 50, 51) else one for number, one in enumerate(SENT)]
    found, losses = read(write_mcap(tmp_path / "bag.mcap", cut))
    assert_same(found, [one for one in cut if not isinstance(one, Cut)])
    (line,) = losses
    assert line.startswith(f"{CUBE}: 3 messages of {ODOMETRY} could not be decoded and were left out; the first: ")


def test_messages_above_the_limit_are_left_out_and_said(tmp_path: Path) -> None:
    path = write_ours(tmp_path / "bag.mcap", SENT)
    with BagReader(path, BagLimits(message_bytes=100)) as reader:
        assert {m.topic for m in reader.messages()} == {NOTE}
        assert "700 messages" in reader.losses[0]
        assert "at most 100 are accepted" in reader.losses[0]
