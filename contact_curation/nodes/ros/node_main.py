"""The entry point of all nodes, from process start to exit status. A configuration error gives one line and status 1.

A process holds one node, or several (`nodes/container.py`), which then share its executor and its end.

Signals never interrupt a callback. The first SIGINT or SIGTERM ends the spinning; the node then closes its threads, files and
publishers while the middleware still works. Further signals have no effect. Closing has a time limit: unfinished work is
continued after the next start, as after a kill. A second limit needs no Python, for when the middleware or a library neither
returns nor lets Python run.
"""

import faulthandler
import os
import re
import signal
import socket
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import ParameterException
from rclpy.executors import ConditionReachedException, ShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.exit_timer import exit_after
from contact_curation.nodes import left_with, runs_a_node
from contact_curation.nodes.ros.given_parameters import (
    PAGE,
    check_files,
    check_names,
    check_words,
    take_former_names,
    why_unchanged,
    without_foreign_types,
)
from contact_curation.nodes.ros.qos import overridable, overrides_checked
from contact_curation.nodes.ros.security import check_keystore, explained
from contact_curation.nodes.ros.worker import Worker

REFUSED = (ContactCurationError, OSError, ParameterException, RCLError)
"""Errors that a user can cause while a node starts."""

FAILED = (ContactCurationError, OSError)
"""Errors that can end a running node without being programming errors, for example a full or broken disk."""

OF_RCL = re.compile(r",? at /\S+:\d+")
"""Position in rcl's sources at the end of its messages, which is removed."""

LONGEST_CLOSING = 4.5
"""Longest time from the first signal to the end of the process [s]; launch kills processes after 5 s."""

BLOCKED = 2.0
"""Time after its limit at which a process is ended from outside Python, because no Python runs in it [s]."""


class StageNode(Node):
    """A node that can end its process with a reason, and closes its resources at the end."""

    failure: BaseException | None = None
    shares_process = False
    """Whether other nodes share the process, so that only one of all their threads runs Python at a time."""
    _made = False
    longest_closing = LONGEST_CLOSING
    """Time limit of closing [s]; nodes with more to write at their end may set a longer one."""
    _at_end = False
    _end_spinning: Callable[[], None] | None = None

    def __init__(self, name: str) -> None:
        super().__init__(name)
        take_former_names(self, name)
        for service in self.services:
            if service.srv_type in (SetParameters, SetParametersAtomically):
                service.callback = without_foreign_types(service.callback)
        self._made = True

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """As in rclpy; a name that the node does not have, and no value, are refused in one line."""
        if why := why_unchanged(self, parameter_list):
            return SetParametersResult(successful=False, reason=why)
        return super().set_parameters_atomically(parameter_list)

    def create_publisher(self, *what: Any, **how: Any) -> Any:
        """As in rclpy, with the parameters `qos_overrides.TOPIC.publisher.*` for history, depth and reliability."""
        with overrides_checked():
            return super().create_publisher(*what, **self._overridable(how))

    def create_subscription(self, *what: Any, **how: Any) -> Any:
        """As in rclpy, with the parameters `qos_overrides.TOPIC.subscription.*` for history, depth and reliability."""
        with overrides_checked():
            return super().create_subscription(*what, **self._overridable(how))

    def _overridable(self, how: dict[str, Any]) -> dict[str, Any]:
        """Adds these parameters, except while rclpy's own constructor runs."""
        return {"qos_overriding_options": overridable(), **how} if self._made else how

    def fail(self, error: BaseException) -> None:
        """Ends the process with status 1; may be called from any thread."""
        self.failure = error
        self.end()

    def end(self) -> None:
        """Ends the process, with status 0 unless the node has failed; may be called from any thread."""
        self._at_end = True
        if self._end_spinning is not None:
            self._end_spinning()

    def when_ended(self, end: Callable[[], None]) -> None:
        """Sets the function that ends the spinning, and calls it if the node has ended already."""
        self._end_spinning = end
        if self._at_end:
            end()

    def done_by(self, worker: Worker, job: Callable[[], Any]) -> Future:
        """The result of a job on a worker's thread, for a service that awaits it while all other callbacks run.

        The service needs a reentrant callback group. What the job raises of this package's errors, the service gets.
        """
        done = Future()
        done.add_done_callback(lambda _: self.executor.wake())  # so that the waiting coroutine goes on
        worker.do(partial(_settle, done, job))
        return done

    def close(self) -> None:
        """Ends threads and closes files; called once, before the node is destroyed."""


def _settle(done: Future, job: Callable[[], Any]) -> None:
    try:
        result = job()
    except ContactCurationError as error:
        done.set_exception(error)
    else:
        done.set_result(result)


class _Ending:
    """The end of the process: whether it was requested, and its time limit.

    Args:
        name: name of the process, for the message.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._wanted = threading.Event()
        self._closed = threading.Event()
        self.nodes: dict[str, StageNode] = {}
        self.failures: dict[str, BaseException] = {}
        self.executor: SingleThreadedExecutor | None = None

    @property
    def wanted(self) -> bool:
        """Whether the end was requested."""
        return self._wanted.is_set()

    def begin(self) -> None:
        """Ends the spinning and starts the time limit; only the first call has an effect."""
        if self.wanted:
            return
        limit = max((node.longest_closing for node in [*self.nodes.values()]), default=LONGEST_CLOSING)
        _limit_outside_python(limit)  # first: once the end is wanted, closing may let no other thread run
        self._wanted.set()
        threading.Thread(target=self._limit, args=(limit,), name="limit of closing", daemon=True).start()
        if self.executor is not None:
            self.executor.wake()

    def closed(self) -> None:
        """Cancels the time limit, because the nodes are closed. A process of nodes has as long again to end.

        Fast DDS may never return from deleting its participant, and Python cannot run meanwhile; nothing is lost then.
        """
        self._closed.set()
        faulthandler.cancel_dump_traceback_later()
        if runs_a_node:
            exit_after(LONGEST_CLOSING, 1 if self.failures else 0)

    def _limit(self, seconds: float) -> None:
        if not self._closed.wait(seconds):
            sys.stderr.write(
                f"{self._name}: not closed after {seconds:g} s; what is unfinished is taken up after the next start\n"
            )
            sys.stderr.flush()
            os._exit(1 if self.failures or any(node.failure for node in self.nodes.values()) else 0)


def _limit_outside_python(seconds: float) -> None:
    """Ends the process some time after a limit, with status 1 and on standard error where each of its threads is."""
    faulthandler.dump_traceback_later(seconds + BLOCKED, exit=True, file=2)


def run(make: Callable[[], StageNode], name: str) -> int:
    """Makes a node and spins it until SIGINT, SIGTERM or its own end; returns the exit status."""
    if sys.argv[1:2] in (["-h"], ["--help"]):
        usage = f"usage: {name} --ros-args [-p NAME:=VALUE] [--params-file FILE] [-r NAME:=NEW_NAME]"
        sys.stdout.write(f"{usage}; parameters: {PAGE}\n")
        return 0
    return run_together({name: make}, name)


def run_together(
    makers: Mapping[str, Callable[[], StageNode]],
    process: str,
    made: Callable[[Sequence[StageNode]], None] = lambda nodes: None,
) -> int:
    """Makes nodes and spins them in this process until SIGINT, SIGTERM or the end of one of them; returns the exit status.

    Args:
        makers: make the nodes, by their names in config/nodes.yaml.
        process: name of the process, for messages.
        made: called with the nodes before they spin.
    """
    ending = _Ending(process)
    with _signals(ending.begin):
        try:
            if _make(makers, process, ending):
                made([*ending.nodes.values()])
                _spin(ending)
        except FAILED as error:
            ending.failures.setdefault(process, error)
        finally:
            status = _close(ending)
    left_with[:] = [status]
    return status


def _make(makers: Mapping[str, Callable[[], StageNode]], process: str, ending: _Ending) -> bool:
    """Makes all nodes and checks what they were started with; on an error that a user can cause notes it and returns False."""
    name = process
    try:
        check_files(sys.argv)
        check_keystore(os.environ)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Failed to fini", RuntimeWarning)  # from rclpy, when a node cannot be made
            _begin_ros()
            if process in makers:  # a container takes words of its own
                check_words(sys.argv)
            for name, make in makers.items():
                ending.nodes[name] = node = make()
                node.shares_process = len(makers) > 1
                node.when_ended(ending.begin)
                check_names(node, name, sys.argv, [*makers])
    except REFUSED as error:
        ending.failures[name] = explained(error)
        return False
    return True


def _begin_ros() -> None:
    """Starts rclpy.

    Raises:
        InvalidValueError: its log cannot be written, of which it says no more than a RuntimeError.
    """
    try:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except REFUSED:
        raise
    except RuntimeError as error:
        raise InvalidValueError("log of ROS", error, "a folder that can be written: set ROS_LOG_DIR") from error


def _close(ending: _Ending) -> int:
    """Closes all nodes and prints what went wrong, then leaves the middleware; returns the exit status."""
    for name, node in ending.nodes.items():
        try:
            node.close()
        except FAILED as error:
            node.failure = node.failure or error
        if node.failure is not None:
            ending.failures[name] = node.failure
    try:
        return max((refuse(name, failure) for name, failure in ending.failures.items()), default=0)
    finally:
        ending.closed()
        for node in ending.nodes.values():
            node.destroy_node()
        if ending.nodes:
            rclpy.try_shutdown()


def refuse(name: str, error: BaseException) -> int:
    """Prints in one line why the node cannot continue; programming errors keep their traceback."""
    if isinstance(error, OSError):
        why = f"{error.filename or 'a file'}: found {error.strerror or error}, expected to read and write there"
    elif isinstance(error, REFUSED):
        why = OF_RCL.sub("", " ".join(str(error).split()))
    else:
        raise error
    sys.stderr.write(f"{name}: {why}\n")
    return 1


def _spin(ending: _Ending) -> None:
    """Runs the nodes' callbacks, one after the other, until the end is requested."""
    executor = ending.executor = SingleThreadedExecutor()
    for node in ending.nodes.values():
        executor.add_node(node)

    def wanted() -> bool:
        return ending.wanted

    while not wanted():
        try:
            handler, _, _ = executor.wait_for_ready_callbacks(condition=wanted)
        except (ConditionReachedException, ShutdownException):
            break
        handler()
        handler.result()  # raises the callback's exception
    executor.shutdown(0.0)


@contextmanager
def _signals(end: Callable[[], None]) -> Iterator[None]:
    """Calls `end` for each SIGINT and SIGTERM, on a separate thread, so at once even while the main thread is busy."""
    heard, told = socket.socketpair()
    told.setblocking(False)

    def listen() -> None:
        while heard.recv(1):
            end()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: None)  # the thread is woken by the byte that Python writes to the socket
    signal.set_wakeup_fd(told.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=listen, name="signals", daemon=True).start()
    try:
        yield
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)  # while the interpreter ends
        signal.set_wakeup_fd(-1)
        told.close()
