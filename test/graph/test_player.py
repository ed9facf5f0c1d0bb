"""The player's options, on a small recording of its own."""

import math
import os
import signal
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import PointStamped
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from contact_curation.nodes.messages.headers import Stamped, header_message, nanoseconds_of
from contact_curation.nodes.ros.qos import profile
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import OfferedQos
from contact_curation.storage.bags.writer import BagWriter
from test.graph.parts.graph import Graph

MILLISECOND = 10**6
RECORDED_NS = 1_600_000_000 * 10**9
STAMP_NS = 77 * 10**9
"""Header stamps of the recording have nothing to do with when it was recorded."""

COUNT = 100
PERIOD_NS = 20 * MILLISECOND
POINT = "std_msgs/Header header\ngeometry_msgs/Point point\n"
LONG = 90.0


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Two seconds of points at 50 Hz, and a topic whose type nobody knows."""
    path = tmp_path / "points.mcap"
    with BagWriter(path) as bag:
        for k in range(COUNT):
            at = RECORDED_NS + k * PERIOD_NS
            message = PointStamped(header=header_message(Stamped(STAMP_NS + k, "map")))
            message.point.x = float(k)
            schema = "geometry_msgs/msg/PointStamped"
            bag.write_raw("/points", schema, POINT, serialize_message(message), at, qos=OfferedQos(reliable=False))
            bag.write_raw("/odd", "nobody_msgs/msg/Odd", "int32 x\n", b"\0\1\0\0\5\0\0\0", at)
    return path


def numbers(heard: Sequence[Any]) -> list[int]:
    return [int(message.point.x) for message in heard]


def test_a_recording_comes_out_whole_with_its_stamps_and_says_what_is_left_out(graph: Graph, recording: Path) -> None:
    points = graph.listener.listen(PointStamped, "/renamed")
    player = graph.start(
        "player", bag=recording, wait_for=10.0, as_fast_as_possible=True, remap=["/points:=/renamed"], start_offset=0.5
    )
    assert player.wait(LONG) == 0
    graph.until(lambda: len(points) == 75, LONG, "the points")
    assert numbers(points) == list(range(25, COUNT))
    assert [nanoseconds_of(message.header.stamp) for message in points] == [STAMP_NS + k for k in range(25, COUNT)]
    assert player.log().count("nobody_msgs/msg/Odd") == 1


@pytest.mark.slow
def test_a_subscriber_that_stands_still_for_longer_than_the_history_loses_nothing(graph: Graph, recording: Path) -> None:
    bag = graph.folder / "heard.mcap"
    recorder = graph.start("session_recorder", bag=bag)
    player = graph.start("player", bag=recording, history=10, wait_for=LONG, start_paused=True, stay=True)
    graph.until(lambda: graph.listener.node.count_subscribers("/points") == 1, LONG, "the recorder to find the topic")
    time.sleep(1.0)
    os.kill(recorder.pid, signal.SIGSTOP)
    assert graph.listener.call(Trigger, "/player/resume", Trigger.Request(), LONG).success
    time.sleep(2.5)  # the recording's two seconds
    os.kill(recorder.pid, signal.SIGCONT)
    graph.until(lambda: "played" in player.log(), LONG, "the end of the recording")
    assert recorder.stop() == 0
    with BagReader(bag) as reader:
        assert len(list(reader.messages(["/points"]))) == COUNT


def test_it_waits_goes_on_stands_still_and_jumps_when_asked(graph: Graph, recording: Path) -> None:
    points = graph.listener.listen(PointStamped, "/points")
    times: list[Any] = []
    graph.listener.node.create_subscription(Clock, "/clock", times.append, profile(100, reliable=True, latched=False))
    graph.start("player", bag=recording, start_paused=True, loop=True, rate=0.5, clock=50.0, topics=["/points"])

    def ask(name: str) -> str:
        return str(graph.listener.call(Trigger, f"/player/{name}", Trigger.Request()).message)

    assert ask("is_paused") == "paused"
    graph.until(lambda: len(times) > 5, LONG, "the clock")
    assert numbers(points) in ([], [0])
    assert ask("resume") == "playing"
    graph.until(lambda: len(points) >= 30, LONG, "points")
    assert ask("toggle_paused") == "paused"
    time.sleep(0.2)  # what is on its way arrives
    so_far = len(points)
    moments = [nanoseconds_of(one.clock) for one in times]
    time.sleep(0.3)
    assert len(points) == so_far
    assert moments == sorted(moments)
    assert moments[0] >= RECORDED_NS
    shown = (moments[-1] - RECORDED_NS) // PERIOD_NS
    assert math.isclose(shown, numbers(points)[-1], abs_tol=2)

    ask("resume")
    value = ParameterValue(type=3, double_value=1.8)
    request = SetParameters.Request(parameters=[Parameter(name="seek", value=value)])
    assert graph.listener.call(SetParameters, "/player/set_parameters", request).results[0].successful
    jumps: list[tuple[int, int]] = []

    def jumped() -> bool:
        heard = numbers(points)[so_far - 1 :]
        jumps[:] = [(one, other) for one, other in pairwise(heard) if other - one != 1]
        return any(other == 90 for _, other in jumps)

    graph.until(lambda: jumped() and jumps[-1] == (99, 0), LONG, "the jump, then the end and the beginning again")


@pytest.mark.slow
def test_at_the_end_it_can_be_told_to_jump_back(graph: Graph, recording: Path) -> None:
    points = graph.listener.listen(PointStamped, "/points")
    player = graph.start("player", bag=recording, wait_for=10.0, as_fast_as_possible=True, stay=True, topics=["/points"])
    graph.until(lambda: "played" in player.log(), LONG, "the end")
    value = ParameterValue(type=3, double_value=1.9)
    request = SetParameters.Request(parameters=[Parameter(name="seek", value=value)])
    assert graph.listener.call(SetParameters, "/player/set_parameters", request).results[0].successful
    graph.until(lambda: len(points) == COUNT + 5, LONG, "the last points again")
    assert numbers(points)[-5:] == list(range(95, COUNT))


def test_an_offset_behind_the_end_is_one_line(graph: Graph, recording: Path) -> None:
    player = graph.start("player", bag=recording, start_offset=3.0, loop=True)
    assert player.wait(LONG) == 1
    assert "start_offset: found 3.0, expected at most the recording's 2.0 s" in player.log()
    assert "Traceback" not in player.log()
