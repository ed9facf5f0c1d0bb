"""player: a recording as live topics, with the option names of `ros2 bag play`. Header stamps stay as recorded.

Messages go out as the bytes that were recorded. The last ones stay there for whoever comes late (`history`): a node that was
killed gets again what it missed.
"""

import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
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

from contact_curation.errors import InvalidValueError, MissingDependencyError, MissingTopicError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import time_message
from contact_curation.nodes.ros.message_types import message_class
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.pace import Pace
from contact_curation.nodes.ros.parameters import declare
from contact_curation.nodes.ros.qos import profile
from contact_curation.nodes.ros.worker import Worker
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import RawMessage

FOREVER = 1e9
NAP = Duration(seconds=0.1)
"""Between looks at whether subscribers are there, have got everything, or the player is to stop."""

BURST = 1000
"""Messages between acknowledgements when playing as fast as possible."""

PATIENCE = 10
"""[s] for acknowledgements."""


class Player(StageNode):
    """Plays one recording."""

    def __init__(self) -> None:
        super().__init__("player")
        path = declare(self, "bag", "", "recording: MCAP, rosbag2 folder or its storage file, ROS 1 bag")
        rate = declare(self, "rate", 1.0, "recorded seconds a second", bounds=(1e-3, 1e3), fixed=False)
        declare(self, "seek", 0.0, "jumps to so many seconds behind the recording's start", bounds=(0.0, FOREVER), fixed=False)
        self._loop = declare(self, "loop", False, "begin again at the end")
        self._offset = declare(self, "start_offset", 0.0, "seconds left out at the start", bounds=(0.0, FOREVER))
        self._fast = declare(self, "as_fast_as_possible", False, "do not wait between messages")
        self._wait = declare(self, "wait_for", 0.0, "seconds to wait for a first subscriber", bounds=(0.0, FOREVER))
        self._stay = declare(self, "stay", False, "stay at the end, so that late subscribers still get the history")
        self._history = declare(self, "history", 30000, "messages kept per topic for late subscribers; 0: as recorded",
                                bounds=(0, 1 << 20))  # fmt: skip
        wanted = [name for name in declare(self, "topics", [""], "topics to play; empty: all") if name]
        renamed = [pair for pair in declare(self, "remap", [""], "topics to rename, as old:=new") if pair]
        hertz = declare(self, "clock", 0.0, "rate of /clock [Hz]; 0: none", bounds=(0.0, 1e4))
        self._pace = Pace(rate, declare(self, "start_paused", False, "wait for ~/resume"))
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._changed = threading.Condition()
        self._stopped = False
        self._jump: float | None = None
        if not path:
            raise InvalidValueError("parameter bag", "nothing", "the path of a recording")
        self._reader = BagReader(Path(path))
        self._outlets = self._advertised(wanted, new_names(renamed))
        self._triggers()
        if hertz:
            self._clock_topic = self.create_publisher(ClockMessage, "/clock", profile(1, reliable=True, latched=False))
            self.create_timer(1.0 / hertz, self._tell_time, clock=self._steady)
        self.add_on_set_parameters_callback(self._parameters_set)
        self._worker = Worker(self.fail)
        self._worker.do(self._play)

    def close(self) -> None:
        with self._changed:
            self._stopped = True
            self._changed.notify_all()
        self._worker.stop()
        self._reader.close()

    def _advertised(self, wanted: list[str], renamed: Mapping[str, str]) -> dict[str, Publisher]:
        """A publisher per topic whose type is installed."""
        available = [info.name for info in self._reader.topics]
        missing = sorted(set(wanted) - set(available))
        if missing:
            raise MissingTopicError(self._reader.path, ", ".join(missing), available)
        publishers: dict[str, Publisher] = {}
        for info in self._reader.topics:
            if wanted and info.name not in wanted:
                continue
            try:
                name = renamed.get(info.name, info.name)
                publishers[info.name] = self.create_publisher(message_class(info.type), name, self._qos(info.name))
            except (MissingDependencyError, InvalidTopicNameException) as error:
                self.get_logger().warning(f"{info.name} is left out: {str(error).splitlines()[0]}")
        return publishers

    def _qos(self, topic: str) -> Any:
        recorded = self._reader.qos(topic)
        if self._history:
            return profile(self._history, reliable=True, latched=True)
        return profile(max(recorded.depth, 1), reliable=recorded.reliable, latched=recorded.latched)

    def _play(self) -> None:
        """On the worker's thread: the recording, once or again and again."""
        self._await_subscriber()
        offset: float | None = self._offset
        while offset is not None and not self._stopped:
            length = self._pass(offset)
            offset = self._jumped_to()
            if offset is None and self._offset > length:
                raise InvalidValueError("start_offset", self._offset, f"at most the recording's {length:.1f} s")
            if offset is None and self._loop and not self._stopped:
                offset = self._offset
            if offset is None:
                self._end()
                offset = self._jumped_to(wait=self._stay)

    def _jumped_to(self, wait: bool = False) -> float | None:
        """Where it was told to jump to [s], if it was; it may wait for that."""
        with self._changed:
            self._changed.wait_for(lambda: self._stopped or not wait or self._jump is not None)
            offset, self._jump = self._jump, None
        return offset

    def _pass(self, offset: float) -> float:
        """Plays from `offset` [s] to the end, to a jump, or until stopped; how long the recording is [s], if it came so far."""
        first_ns: int | None = None
        last_ns = 0
        published = 0
        for message in self._messages():
            last_ns = message.log_time_ns
            if first_ns is None:
                first_ns = message.log_time_ns
                start_ns = first_ns + int(offset * NANOSECONDS)
                self._pace.begin(start_ns, self._now())
            publisher = self._outlets.get(message.topic)
            if publisher is None or (message.log_time_ns < start_ns and not self._latched(message.topic)):
                continue
            if not self._due(message.log_time_ns):
                return FOREVER
            publisher.publish(message.data)
            published += 1
            if self._fast and published % BURST == 0:
                self._acknowledged(publisher)
        return FOREVER if first_ns is None else (last_ns - first_ns) / NANOSECONDS

    def _messages(self) -> Iterator[RawMessage]:
        return self._reader.raw_messages(list(self._outlets))

    def _latched(self, topic: str) -> bool:
        """What was latched is sent in any case: it holds for what comes later."""
        return self._reader.qos(topic).latched

    def _due(self, recorded_ns: int) -> bool:
        """Waits until a message is due; False when there is something else to do."""
        with self._changed:
            while not (self._stopped or self._jump is not None):
                if self._fast and not self._pace.paused:
                    return True
                wait_ns = self._pace.wait_ns(recorded_ns, self._now())
                if wait_ns <= 0.0:
                    return True
                self._changed.wait(None if wait_ns == float("inf") else wait_ns / NANOSECONDS)
            return False

    def _await_subscriber(self) -> None:
        end_ns = self._now() + int(self._wait * NANOSECONDS)
        with self._changed:
            while not self._stopped and self._now() < end_ns and not self._heard():
                self._changed.wait(NAP.nanoseconds / NANOSECONDS)

    def _heard(self) -> bool:
        return any(publisher.get_subscription_count() for publisher in self._outlets.values())

    def _end(self) -> None:
        for line in self._reader.losses:
            self.get_logger().warning(line)
        if self._stopped:
            return
        self.get_logger().info(f"played {self._reader.path}")
        for publisher in self._outlets.values():
            self._acknowledged(publisher)
        if not self._stay:
            self.context.try_shutdown()

    def _acknowledged(self, publisher: Publisher) -> None:
        """Waits until all subscribers have got everything; not for ever, because one may have died, nor once it is to stop."""
        end_ns = self._now() + PATIENCE * NANOSECONDS
        while not (self._stopped or publisher.wait_for_all_acked(NAP)) and self._now() < end_ns:
            pass

    def _triggers(self) -> None:
        """The services; rosbag2_interfaces, whose types `ros2 bag play` uses, is not needed for them."""
        actions: dict[str, Callable[[], None]] = {
            "pause": lambda: self._set_paused(True),
            "resume": lambda: self._set_paused(False),
            "toggle_paused": lambda: self._set_paused(not self._pace.paused),
            "is_paused": lambda: None,
        }
        for name, act in actions.items():

            def answer(_: Any, response: Any, act: Callable[[], None] = act) -> Any:
                act()
                response.success, response.message = True, "paused" if self._pace.paused else "playing"
                return response

            self.create_service(Trigger, f"~/{name}", answer)

    def _set_paused(self, paused: bool) -> None:
        with self._changed:
            self._pace.pause(paused, self._now())
            self._changed.notify_all()

    def _parameters_set(self, parameters: list[Parameter]) -> SetParametersResult:
        with self._changed:
            for parameter in parameters:
                if parameter.name == "rate":
                    self._pace.set_rate(parameter.value, self._now())
                elif parameter.name == "seek":
                    self._jump = parameter.value
            self._changed.notify_all()
        return SetParametersResult(successful=True)

    def _tell_time(self) -> None:
        if self._pace.begun:
            self._clock_topic.publish(ClockMessage(clock=time_message(self._pace.now(self._now()))))

    def _now(self) -> int:
        return int(self._steady.now().nanoseconds)


def new_names(pairs: Sequence[str]) -> dict[str, str]:
    """Topics by their recorded names, from `old:=new`.

    Raises:
        InvalidValueError: a pair is not of this form.
    """
    names: dict[str, str] = {}
    for pair in pairs:
        old, arrow, new = pair.partition(":=")
        if not (old and arrow and new):
            raise InvalidValueError("remap", repr(pair), "old:=new")
        names[f"/{old.lstrip('/')}"] = new
    return names


def main() -> int:
    """Runs the node."""
    return run(Player, "player")


if __name__ == "__main__":
    sys.exit(main())
