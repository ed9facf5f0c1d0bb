"""Node `player`: plays a recording as live topics, with the option names of `ros2 bag play`. Header stamps stay as recorded.

Messages are published as the recorded bytes. Late subscribers, for example a node that was killed, receive the last `history`
messages of each topic again.
"""

import sys
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import InvalidTopicNameException
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import Trigger

from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import time_message
from contact_curation.nodes.ros.message_types import message_class
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.own_namespace import own_name
from contact_curation.nodes.ros.parameters import declare
from contact_curation.nodes.ros.qos import profile
from contact_curation.nodes.ros.worker import Worker
from contact_curation.stages.playback import Playback, PlaybackClock, new_names, played_topics
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import RawMessage

FOREVER = 1e9
NAP = Duration(seconds=0.1)
"""Time between checks for subscribers, for acknowledgements, and for the end."""

BURST = 1000
"""Messages of a topic between acknowledgements when playing as fast as possible."""

PATIENCE = 10
"""Longest wait for acknowledgements [s]."""


class Player(StageNode):
    """Plays one recording."""

    def __init__(self) -> None:
        super().__init__("player")
        path = declare(self, "bag", "", "recording: MCAP, rosbag2 folder or its storage file, ROS 1 bag")
        rate = declare(self, "rate", 1.0, "playback rate: recorded seconds per second", bounds=(1e-3, 1e3), fixed=False)
        declare(
            self,
            "seek",
            0.0,
            "position to jump to, in seconds after the start of the recording",
            bounds=(0.0, FOREVER),
            fixed=False,
        )
        loop = declare(self, "loop", False, "start again at the end")
        offset = declare(self, "start_offset", 0.0, "seconds to skip at the start", bounds=(0.0, FOREVER))
        self._fast = declare(self, "as_fast_as_possible", False, "play without waiting between messages")
        self._wait = declare(self, "wait_for", 0.0, "seconds to wait for a first subscriber", bounds=(0.0, FOREVER))
        self._stay = declare(self, "stay", False, "keep running at the end, so that late subscribers still get the history")
        self._history = declare(self, "history", 30000, "messages per topic that late subscribers still get; 0: as recorded",
                                bounds=(0, 1 << 20))  # fmt: skip
        self._burst = BURST if self._fast else self._history // 2  # before the history drops what was not received
        wanted = [name for name in declare(self, "topics", [""], "topics to play; empty: all but results of the nodes") if name]
        renamed = [pair for pair in declare(self, "remap", [""], "topics to rename, as old:=new") if pair]
        hertz = declare(self, "clock", 0.0, "rate of /clock [Hz]; 0: none", bounds=(0.0, 1e4))
        self._recorded_time = PlaybackClock(rate, declare(self, "start_paused", False, "wait for a call of ~/resume"))
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._published: Counter[str] = Counter()
        if not path:
            raise InvalidValueError("parameter bag", "nothing", "the path of a recording")
        self._reader = BagReader(Path(path))
        played = played_topics(self._reader, wanted, own_clock=hertz > 0.0)
        left_out = [one.name for one in self._reader.topics if one.name not in played]
        if left_out and not wanted:
            self.get_logger().info(
                f"left out: {', '.join(left_out)}; results of nodes, and a clock beside the player's own, are played only "
                "where the parameter topics names them"
            )
        self._outlets = self._advertised(played, new_names(self._reader, renamed))
        self._playback = Playback(self._reader, self._recorded_time, self._now, offset, loop=loop, fast=self._fast)
        self._triggers()
        if hertz:
            self._clock_topic = self.create_publisher(ClockMessage, "clock", profile(1, reliable=True, latched=False))
            self.create_timer(1.0 / hertz, self._tell_time, clock=self._steady)
        self.add_on_set_parameters_callback(self._parameters_set)
        self._worker = Worker(self.fail)
        self._worker.do(self._play)

    def close(self) -> None:
        self._playback.stop()
        self._worker.stop()
        self._reader.close()

    def _advertised(self, types: Mapping[str, str], renamed: Mapping[str, str]) -> dict[str, Publisher]:
        """A publisher per topic whose type is installed."""
        publishers: dict[str, Publisher] = {}
        for topic, kind in types.items():
            try:
                publishers[topic] = self.create_publisher(
                    message_class(kind), renamed.get(topic, own_name(self, topic)), self._qos(topic)
                )
            except (MissingDependencyError, InvalidTopicNameException) as error:
                self.get_logger().warning(f"{topic} is left out: {str(error).splitlines()[0]}")
        return publishers

    def _qos(self, topic: str) -> Any:
        recorded = self._reader.qos(topic)
        if self._history:
            return profile(self._history, reliable=True, latched=True)
        return profile(max(recorded.depth, 1), reliable=recorded.reliable, latched=recorded.latched)

    def _play(self) -> None:
        """Plays the recording; on the worker's thread, as the next three methods."""
        self._playback.wait_until(self._heard, self._wait, NAP.nanoseconds / NANOSECONDS)
        self._playback.play(list(self._outlets), self._publish, self._end, stay=self._stay)

    def _publish(self, message: RawMessage) -> None:
        publisher = self._outlets[message.topic]
        publisher.publish(message.data)
        self._published[message.topic] += 1
        if self._burst and self._published[message.topic] % self._burst == 0:
            self._acknowledged(publisher)

    def _heard(self) -> bool:
        return any(publisher.get_subscription_count() for publisher in self._outlets.values())

    def _end(self) -> None:
        for line in self._reader.losses:
            self.get_logger().warning(line)
        if self._playback.stopped:
            return
        self.get_logger().info(f"played {self._reader.path}")
        for publisher in self._outlets.values():
            self._acknowledged(publisher)
        if not self._stay:
            self.end()

    def _acknowledged(self, publisher: Publisher) -> None:
        """Waits until all subscribers have acknowledged everything, up to a limit, because one may have died."""
        end_ns = self._now() + PATIENCE * NANOSECONDS
        while not (self._playback.stopped or publisher.wait_for_all_acked(NAP)) and self._now() < end_ns:
            pass

    def _triggers(self) -> None:
        """Offers the services as std_srvs/Trigger, so that rosbag2_interfaces, which `ros2 bag play` uses, is not needed."""
        actions: dict[str, Callable[[], None]] = {
            "pause": lambda: self._playback.pause(True),
            "resume": lambda: self._playback.pause(False),
            "toggle_paused": lambda: self._playback.pause(not self._recorded_time.paused),
            "is_paused": lambda: None,
        }
        for name, act in actions.items():

            def answer(_: Any, response: Any, act: Callable[[], None] = act) -> Any:
                act()
                response.success, response.message = True, "paused" if self._recorded_time.paused else "playing"
                return response

            self.create_service(Trigger, f"~/{name}", answer)

    def _parameters_set(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "rate":
                self._playback.set_rate(parameter.value)
            elif parameter.name == "seek":
                self._playback.jump(parameter.value)
        return SetParametersResult(successful=True)

    def _tell_time(self) -> None:
        if self._recorded_time.begun:
            self._clock_topic.publish(ClockMessage(clock=time_message(self._recorded_time.now(self._now()))))

    def _now(self) -> int:
        return int(self._steady.now().nanoseconds)


def main() -> int:
    """Runs the node."""
    return run(Player, "player")


if __name__ == "__main__":
    sys.exit(main())
