"""The entry point of all nodes, from process start to exit status. A configuration error is one line and status 1."""

import sys
from collections.abc import Callable

import rclpy
from rclpy._rclpy_pybind11 import InvalidHandle, RCLError
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

from contact_curation.errors import ContactCurationError


class StageNode(Node):
    """A node that can stop itself with a reason, and tidies up when it ends."""

    failure: BaseException | None = None

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
    rclpy.init(args=sys.argv)
    try:
        node = make()
    except (ContactCurationError, ParameterException) as error:
        return refuse(name, error)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.close()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0 if node.failure is None else refuse(name, node.failure)


def refuse(name: str, error: BaseException) -> int:
    """Says in one line why the node cannot go on; programming errors keep their traceback."""
    if not isinstance(error, ContactCurationError | ParameterException):
        raise error
    sys.stderr.write(f"{name}: {' '.join(str(error).split())}\n")
    return 1
