"""A recording is played from an offset, jumps, begins again and stops, by a clock that moves as it is asked."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError, MissingTopicError
from contact_curation.motion.pose_stream import FramePose
from contact_curation.stages.playback import CLOCK, Playback, PlaybackClock, new_names, played_topics
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import RawMessage
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.inputs.pose_messages import POSE
from test.motion.streams import stream
from test.storage.pose_recordings import recorded
from test.storage.written_bags import write_ours

TOPIC = "/pose"


@pytest.fixture
def reader(tmp_path: Path) -> Iterator[BagReader]:
    poses = [FramePose(one.stamp_ns, "table", "body_cube", one.pose) for one in stream()[:20]]
    made = BagReader(write_ours(tmp_path / "a.mcap", recorded(TOPIC, POSE, poses)))
    yield made
    made.close()


def playing(reader: BagReader, offset: float = 0.0, *, loop: bool = False) -> Playback:
    return Playback(reader, PlaybackClock(1.0, paused=False), lambda: 0, offset, loop=loop, fast=True)


def times_of(reader: BagReader) -> list[int]:
    return [one.log_time_ns for one in reader.raw_messages([TOPIC])]


def test_what_lies_before_the_offset_is_left_out(reader: BagReader) -> None:
    heard: list[RawMessage] = []
    ends: list[int] = []
    times = times_of(reader)
    offset = (times[5] - times[0]) / 1e9
    playing(reader, offset).play([TOPIC], heard.append, lambda: ends.append(len(heard)), stay=False)
    assert [one.log_time_ns for one in heard] == times[5:]
    assert ends == [15]


def test_an_offset_behind_the_end_is_refused(reader: BagReader) -> None:
    with pytest.raises(InvalidValueError, match=r"start_offset: found 9\.0, expected at most the recording's 0\.1 s"):
        playing(reader, 9.0).play([TOPIC], lambda _: None, lambda: None, stay=False)


def test_a_jump_is_followed_at_once_and_a_loop_begins_again_until_it_is_stopped(reader: BagReader) -> None:
    times, heard = times_of(reader), list[int]()
    playback = playing(reader, loop=True)

    def publish(message: RawMessage) -> None:
        heard.append(message.log_time_ns)
        if len(heard) == 3:
            playback.jump((times[18] - times[0]) / 1e9)
        if len(heard) == 8:
            playback.stop()

    playback.play([TOPIC], publish, lambda: None, stay=False)
    assert heard == [*times[:3], *times[18:], *times[:3]]


def test_who_stays_at_the_end_can_be_told_to_jump_back(reader: BagReader) -> None:
    heard, ended = list[int](), threading.Event()
    times, playback = times_of(reader), playing(reader)
    thread = threading.Thread(
        target=playback.play, args=([TOPIC], lambda one: heard.append(one.log_time_ns), ended.set), kwargs={"stay": True}
    )
    thread.start()
    assert ended.wait(20.0)
    ended.clear()
    playback.jump((times[19] - times[0]) / 1e9)
    assert ended.wait(20.0)
    playback.stop()
    thread.join(20.0)
    assert not thread.is_alive()
    assert heard == [*times, times[19]]


def test_topics_that_were_not_recorded_are_refused(reader: BagReader) -> None:
    assert list(played_topics(reader, [])) == [TOPIC]
    with pytest.raises(MissingTopicError, match="expected /nothing"):
        played_topics(reader, ["/nothing"])


def test_results_and_a_clock_beside_an_own_one_are_played_only_when_they_are_named(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    kinds = {"/clock": CLOCK, "/toss": "contact_curation_msgs/msg/Toss", "/pose": POSE}
    with BagWriter(path) as bag:
        for topic, kind in kinds.items():
            bag.write_raw(topic, kind, "int32 x\n", b"\0\1\0\0\5\0\0\0", 1)
    with BagReader(path) as reader:
        assert [*played_topics(reader, [])] == ["/clock", "/pose"]
        assert [*played_topics(reader, [], own_clock=True)] == ["/pose"]
        assert [*played_topics(reader, ["/toss", "/clock"], own_clock=True)] == ["/clock", "/toss"]


def test_new_names_are_given_as_pairs(reader: BagReader) -> None:
    for pair in (f"{TOPIC}:=/b", f"{TOPIC.lstrip('/')}:=/b"):
        assert new_names(reader, [pair]) == {TOPIC: "/b"}
    with pytest.raises(InvalidValueError, match="old:=new"):
        new_names(reader, ["a=b"])
    with pytest.raises(MissingTopicError, match="expected /nothing"):
        new_names(reader, ["/nothing:=/b"])
