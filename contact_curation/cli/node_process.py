"""A node of this package as a process, started and stopped from the command line, which knows no ROS."""

import ctypes
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

GRACE = 10.0
"""[s] that a node gets to end after SIGINT."""

SET_PARENT_DEATH_SIGNAL = 1
"""Of Linux's prctl."""


class NodeProcess:
    """A running node; use it as a context manager, which stops it. It also ends when its parent dies.

    Args:
        name: of the executable, e.g. pose_ingest.
        parameters: ROS parameters by name.
        domain_id: ROS_DOMAIN_ID; nodes are found on this machine only.
        log_path: file that takes what the node says.
    """

    def __init__(self, name: str, parameters: Mapping[str, Any], domain_id: int, log_path: Path) -> None:
        self.name = name
        self.log_path = log_path
        command = [sys.executable, "-m", f"contact_curation.nodes.{name}", "--ros-args"]
        for key, value in parameters.items():
            command += ["-p", f"{key}:={json.dumps(value)}"]
        environment = {key: value for key, value in os.environ.items() if key not in ("ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS")}
        environment |= {"ROS_DOMAIN_ID": str(domain_id), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with log_path.open("wb") as log:
            self._process = subprocess.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, preexec_fn=_end_with_the_parent
            )

    @property
    def status(self) -> int | None:
        """Exit status; None while it runs."""
        return self._process.poll()

    def stop(self) -> None:
        """Asks the node to end, and insists after a while."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def last_words(self) -> str:
        """The last line it said."""
        lines = self.log_path.read_text(errors="replace").strip().splitlines()
        return lines[-1] if lines else "nothing"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.stop()


def _end_with_the_parent() -> None:
    """Between fork and exec: even where the parent is killed, the node gets a SIGINT."""
    ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGINT)
