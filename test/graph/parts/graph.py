"""Nodes in processes of their own, and a listener in the test's process that hears what they say."""

import threading
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import rclpy
from contact_curation_msgs.msg import CuratedBuffer, ModelParameters, TossInformation, TossRejected, TrainingStatus
from contact_curation_msgs.msg import Toss as TossMessage
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

from contact_curation.nodes.ros.qos import latched, profile
from test.graph.parts.processes import NodeProcess, spawn_node

STORES = {
    "pose_ingest": "tosses.sqlite",
    "fisher_scorer": "information.sqlite",
    "curator": "buffer.sqlite",
    "trainer": "trainer.sqlite",
}
POLL = 0.02
"""[s]"""

LONGEST = 90.0
"""That anything may take on a busy machine [s]."""


class Listener:
    """A node of the test's own; what it hears is in lists by topic.

    Args:
        domain: its ROS domain.
    """

    def __init__(self, domain: int) -> None:
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = Node("listener", context=self._context, enable_rosout=False)
        self.heard: dict[str, list[Any]] = {}
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def listen(self, kind: Any, topic: str, depth: int = 1000) -> list[Any]:
        """Hears a topic of the graph from now on; what was kept for late subscribers too."""
        heard = self.heard.setdefault(topic, [])
        self.node.create_subscription(kind, topic, heard.append, latched(depth))
        return heard

    def call(self, kind: Any, name: str, request: Any, seconds: float = 30.0) -> Any:
        """Calls a service and waits for its answer; asks again once, since a service that does not know us yet loses it."""
        client = self.node.create_client(kind, name)
        assert client.wait_for_service(LONGEST), f"no service {name}"
        future = client.call_async(request)
        if not within(future.done, seconds):
            future = client.call_async(request)
            until(future.done, LONGEST, f"an answer of {name}")
        self.node.destroy_client(client)
        return future.result()

    def close(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return


class Graph:
    """Processes, a listener, and one folder for all they keep.

    Args:
        folder: for stores and logs.
        domain: ROS domain.
    """

    def __init__(self, folder: Path, domain: int) -> None:
        self.folder = folder
        self.domain = domain
        self._stack = ExitStack()
        self._listener: Listener | None = None
        self.processes: list[NodeProcess] = []

    @property
    def listener(self) -> Listener:
        """Made when it is needed first."""
        if self._listener is None:
            self._listener = Listener(self.domain)
            self._stack.callback(self._listener.close)
        return self._listener

    def start(self, name: str, remappings: Mapping[str, str] | None = None, label: str = "", **parameters: Any) -> NodeProcess:
        """A node; a stage keeps its store in the folder, so that a second one of its label goes on where the first was."""
        if name in STORES:
            parameters.setdefault("store", self.folder / f"{label}{STORES[name]}")
        log_path = self.folder / f"{label or name}.log"
        process = spawn_node(name, parameters, self.domain, log_path, remappings)
        self.processes.append(process)
        return process

    def start_together(self, stages: Mapping[str, Mapping[str, Any]]) -> NodeProcess:
        """Nodes in one container, by name with their parameters; each keeps the store that it would have alone."""
        kept = {name: {"store": self.folder / STORES[name], **chosen} for name, chosen in stages.items()}
        parameters = {f"{name}:{key}": value for name, chosen in kept.items() for key, value in chosen.items()}
        log_path = self.folder / "container.log"
        process = spawn_node("container", parameters, self.domain, log_path, words=[*stages])
        self.processes.append(process)
        return process

    def logs(self) -> str:
        """What all nodes said."""
        return "\n".join(f"== {path.name}\n{path.read_text()}" for path in sorted(self.folder.glob("*.log")))

    def tosses(self, topic: str = "/toss") -> list[Any]:
        return self.listener.listen(TossMessage, topic)

    def rejected(self) -> list[Any]:
        return self.listener.listen(TossRejected, "/toss_rejected")

    def diagnostics(self) -> list[Any]:
        heard = self.listener.heard.setdefault("/diagnostics", [])
        qos = profile(100, reliable=True, latched=False)
        self.listener.node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, qos)
        return heard

    def information(self) -> list[Any]:
        return self.listener.listen(TossInformation, "/toss_information")

    def buffers(self) -> list[Any]:
        return self.listener.listen(CuratedBuffer, "/curated_buffer")

    def parameters(self) -> list[Any]:
        return self.listener.listen(ModelParameters, "/model_parameters")

    def statuses(self) -> list[Any]:
        return self.listener.listen(TrainingStatus, "/training_status")

    def until(self, true: Callable[[], Any], seconds: float, what: str) -> None:
        """Waits; fails with the nodes' logs."""
        try:
            until(true, seconds, what)
        except AssertionError as error:
            raise AssertionError(f"{error}\n{self.logs()}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for process in self.processes:
            process.ask_to_end()
        for process in self.processes:
            process.stop()
        self._stack.close()


def until(true: Callable[[], Any], seconds: float, what: str) -> None:
    """Waits until something is true, and fails after a while."""
    assert within(true, seconds), f"waited {seconds:g} s for {what}"


def within(true: Callable[[], Any], seconds: float) -> bool:
    """Whether something becomes true before so much time has gone."""
    end = time.monotonic() + seconds
    while not true():
        if time.monotonic() > end:
            return False
        time.sleep(POLL)
    return True
