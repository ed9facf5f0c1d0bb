"""The entry point of all nodes, from process start to exit status. A configuration error is one line and status 1."""

import re
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import rclpy
from rclpy._rclpy_pybind11 import InvalidHandle, RCLError
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter

from contact_curation.errors import ContactCurationError, InvalidValueError, UnknownNameError
from contact_curation.session.node_parameters import OF_ROS, declared_parameters


RENAMED = {"body_file": "body", "held_out": "evaluate_on", "recording": "rrd"}
"""Former names of parameters, which are still taken."""

OF_RCL = re.compile(r",? at /\S+:\d+")
"""Where in its own sources rcl found an error; nobody can do anything about it."""

PARAMS_FILE, PARAMETER = "--params-file", ("-p", "--param")


class StageNode(Node):
    """A node that can stop itself with a reason, and tidies up when it ends."""

    failure: BaseException | None = None

    def __init__(self, name: str) -> None:
        super().__init__(name)
        given = self._parameter_overrides
        for former, now in RENAMED.items():
            if former in given and now not in given and now in declared_parameters()[name]:
                given[now] = Parameter(now, value=given.pop(former).value)
                self.get_logger().warning(f"parameter {former} is called {now} now")

    def fail(self, error: BaseException) -> None:
        """Ends the process with status 1; may be called from any thread.

        A job that still wanted to publish when the middleware was gone is no failure: what was not announced is announced
        after the next start.
        """
        if isinstance(error, RCLError | InvalidHandle) and not self.context.ok():
            return
        self.failure = error
        self.context.try_shutdown()

    def close(self) -> None:
        """Ends threads and files; called once, before the node is destroyed."""


def run(make: Callable[[], StageNode], name: str) -> int:
    """Makes a node and spins it until SIGINT, SIGTERM or its own end; returns the exit status."""
    try:
        check_files(sys.argv)
        rclpy.init(args=sys.argv)
        node = make()
    except (*REFUSED, RCLError) as error:
        return refuse(name, error)
    try:
        check_names(name, node, sys.argv)
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except InvalidValueError as error:
        node.failure = error
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0 if node.failure is None else refuse(name, node.failure)


def check_files(words: Sequence[str]) -> None:
    """Refuses parameter files that are not there, which rcl would do in several lines.

    Raises:
        InvalidValueError: one is not there.
    """
    for word, path in pairwise(words):
        if word == PARAMS_FILE and not Path(path).is_file():
            raise InvalidValueError(PARAMS_FILE, f"no file {path}", "one like config/nodes.yaml; is the path right?")


def check_names(name: str, node: Node, words: Sequence[str]) -> None:
    """Refuses parameters that the node does not have, which ROS would pass over.

    A file may set parameters of all nodes at once, so that there a name may also be another node's.

    Raises:
        UnknownNameError: there is no parameter of a name.
    """
    own = {*node._parameters, *declared_parameters()[name]}
    others = {one for each in declared_parameters().values() for one in each}
    said = {text.partition(":=")[0].rpartition(":")[2] for word, text in pairwise(words) if word in PARAMETER}
    for given in node._parameter_overrides:
        if given not in own and not given.startswith(OF_ROS) and (given in said or given not in others):
            raise UnknownNameError("parameter", given, own)


REFUSED = (ContactCurationError, ParameterException)


def refuse(name: str, error: BaseException) -> int:
    """Says in one line why the node cannot go on; programming errors keep their traceback."""
    if not isinstance(error, (*REFUSED, RCLError)):
        raise error
    sys.stderr.write(f"{name}: {OF_RCL.sub('', ' '.join(str(error).split()))}\n")
    return 1
