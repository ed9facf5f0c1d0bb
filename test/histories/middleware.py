"""A middleware in which nothing moves by itself: messages, answers and jobs wait until a history says which comes next.

Real nodes run on it, in one process and on one thread. A process may die between any two steps, or at any commit of its store.
Topics and services behave as DDS does on one machine: what one process publishes arrives in order, the last message of a topic
of depth 1 replaces one that waits, and a late subscriber gets what living publishers hold. A history may also do what DDS does
not: repeat, drop and reorder messages that are numbered.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from contact_curation.nodes.ros.node_main import StageNode

type Step = Callable[[], None]


class Killed(BaseException):
    """The process dies here."""


class Middleware:
    """One domain.

    Attributes:
        processes: by name.
        waiting: by channel, what comes next on it; a channel's name ends with that of the process it leads to.
        watch: sees all that is published.
    """

    def __init__(self) -> None:
        self.processes: dict[str, Process] = {}
        self.waiting: defaultdict[str, deque[Step]] = defaultdict(deque)
        self.watch: Callable[[str, Any], None] = lambda topic, message: None

    @property
    def channels(self) -> list[str]:
        """Those on which something waits."""
        return sorted(name for name, steps in self.waiting.items() if steps)

    def take(self, channel: str) -> None:
        """The next step of a channel."""
        if self.waiting[channel]:
            self.do(channel.rpartition(">")[2], self.waiting[channel].popleft())

    def do(self, name: str, step: Step) -> None:
        """A step of a process, at which it may die."""
        try:
            step()
        except Killed:
            self.processes[name].kill()

    def publish(self, topic: str, message: Any, depth: int) -> None:
        self.watch(topic, message)
        for process in self.living:
            for callback in process.subscriptions[topic]:
                self._send(f"{topic}>{process.name}", callback, message, depth)

    def subscribe(self, topic: str, name: str, callback: Callable[[Any], None]) -> None:
        for process in self.living:
            for message in process.held[topic]:
                self._send(f"{topic}>{name}", callback, message, process.depths[topic])

    @property
    def living(self) -> "list[Process]":
        return [process for process in self.processes.values() if process.alive]

    def server(self, service: str) -> "Process | None":
        """The process that answers."""
        return next((process for process in self.living if service in process.services), None)

    def _send(self, channel: str, callback: Callable[[Any], None], message: Any, depth: int) -> None:
        if depth == 1:
            self.waiting[channel].clear()
        self.waiting[channel].append(lambda: callback(message))


class Process:
    """A node, while it lives, and what stays on disk of it.

    Args:
        name: of the process.
        middleware: that it is part of.
        make: makes the node.
        store: its file.
        parameters: that it is started with.
    """

    starting: "Process"
    by_store: dict[str, "Process"] = {}  # noqa: RUF012 - of all, while they are used

    def __init__(
        self, name: str, middleware: Middleware, make: Callable[[], StageNode], store: Path, parameters: Mapping[str, Any]
    ) -> None:
        self.name, self.middleware, self.store = name, middleware, store
        self.parameters: dict[str, Any] = {"store": str(store), **parameters}
        self.node: Any = None
        self.set_parameters: Callable[[list[Any]], Any] = _unheard
        self.dies_in = self.life = self.seconds = 0
        self._make = make
        middleware.processes[name] = Process.by_store[str(store)] = self
        self.start()

    @property
    def alive(self) -> bool:
        return self.node is not None

    def start(self) -> None:
        """Starts it, unless it dies at that already."""
        self._forget()
        self.life += 1
        Process.starting = self
        self.node = SimpleNamespace()  # what it does while it starts comes from a living process
        try:
            self.node = self._make()
        except Killed:
            self.kill()

    def kill(self) -> None:
        """As SIGKILL does: what was committed stays, and nothing else; what it sent is on its way."""
        self.node, self.dies_in = None, 0
        self._forget()
        for opened in OPENED.pop(str(self.store), []):
            opened.close()
        for channel in list(self.middleware.waiting):
            if channel.endswith(f">{self.name}"):
                del self.middleware.waiting[channel]

    def commits(self) -> None:
        """Called around each commit of its store."""
        if self.dies_in:
            self.dies_in -= 1
            if self.dies_in == 0:
                raise Killed

    def tick(self) -> None:
        """A second goes by."""
        self.seconds += 1
        for callback in tuple(self.timers):
            if self.alive:
                self.middleware.do(self.name, callback)

    def _forget(self) -> None:
        self.timers: list[Step] = []
        self.services: dict[str, Callable[[Any, Any], Any]] = {}
        self.subscriptions: defaultdict[str, list[Callable[[Any], None]]] = defaultdict(list)
        self.held: defaultdict[str, deque[Any]] = defaultdict(deque)
        self.depths: dict[str, int] = {}


OPENED: dict[str, list[Any]] = {}
"""Connections to stores, by path: the system closes them when a process dies."""


class StillNode(StageNode):
    """What nodes ask of ROS, answered by the middleware; a base beside the node's own."""

    def __init__(self, name: str) -> None:  # ROS's own is not called: there is no ROS here
        self._process = Process.starting
        self.name = name

    def declare_parameter(self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False) -> Any:
        return SimpleNamespace(value=self._process.parameters.get(name, value))

    def get_parameter(self, name: str) -> Any:
        return SimpleNamespace(value=self._process.parameters.get(name))

    def create_publisher(self, kind: Any, topic: str, qos: Any, **_: Any) -> Any:
        process, depth = self._process, qos.depth
        held = process.held[topic] = deque(maxlen=depth)
        process.depths[topic] = depth

        def publish(message: Any) -> None:
            held.append(message)
            process.middleware.publish(topic, message, depth)

        return SimpleNamespace(publish=publish)

    def create_subscription(self, kind: Any, topic: str, callback: Any, qos: Any, **_: Any) -> Any:
        self._process.subscriptions[topic].append(callback)
        self._process.middleware.subscribe(topic, self._process.name, callback)

    def create_service(self, kind: Any, name: str, callback: Any, **_: Any) -> Any:
        self._process.services[name] = callback

    def create_client(self, kind: Any, name: str, **_: Any) -> Any:
        return _Client(self._process, kind, name)

    def create_timer(self, period: float, callback: Any, *_: Any, **__: Any) -> Any:
        self._process.timers.append(callback)

    def add_on_set_parameters_callback(self, callback: Any) -> None:
        self._process.set_parameters = callback

    def get_clock(self) -> Any:
        return Watch(process=self._process)

    def get_logger(self) -> Any:
        return SimpleNamespace(info=_unheard, warning=_unheard)

    def count_publishers(self, topic: str) -> int:
        return sum(topic in process.depths for process in self._process.middleware.living)


def _unheard(what: Any) -> None:
    """Nobody listens."""


class _Client:
    """Of a service: question and answer both wait on channels; either is lost where its process dies."""

    def __init__(self, process: Process, kind: Any, service: str) -> None:
        self._process, self._kind, self._service = process, kind, service
        self._middleware = process.middleware

    def service_is_ready(self) -> bool:
        return self._middleware.server(self._service) is not None

    def remove_pending_request(self, future: Any) -> None:
        future.done = _unheard

    def call_async(self, request: Any) -> "_Answer":
        answer, server = _Answer(), self._middleware.server(self._service)
        asker, life = self._process, self._process.life

        def arrive() -> None:
            assert server is not None
            response = server.services[self._service](request, self._kind.Response())
            if asker.life == life:
                self._middleware.waiting[f"answer of {self._service}>{asker.name}"].append(lambda: answer.come(response))

        if server is not None:
            self._middleware.waiting[f"{self._service} of {asker.name}>{server.name}"].append(arrive)
        return answer


class _Answer:
    """A future."""

    def __init__(self) -> None:
        self.done: Callable[[Any], None] = _unheard
        self._response: Any = None

    def add_done_callback(self, done: Callable[[Any], None]) -> None:
        self.done = done

    def come(self, response: Any) -> None:
        self._response = response
        self.done(self)

    def result(self) -> Any:
        return self._response


class Watch:
    """A steady clock that shows the seconds that its process was given."""

    def __init__(self, process: Process | None = None, **_: Any) -> None:
        self._process = process or Process.starting

    def now(self) -> Any:
        return SimpleNamespace(nanoseconds=1_000_000_000 * self._process.seconds)


class Hand:
    """A worker whose jobs wait on a channel of their own."""

    def __init__(self, fail: Callable[[BaseException], None]) -> None:
        process = Process.starting
        self._jobs = process.middleware.waiting[f"work>{process.name}"]

    def do(self, job: Step) -> None:
        self._jobs.append(job)

    @property
    def waiting(self) -> int:
        return len(self._jobs)

    def stop(self) -> None:
        return
