"""Nodes as processes of their own, for tests and benchmarks.

The packaged wheels replace the interpreter once at start (exec), which keeps the process id: signals reach the node.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

GRACE = 10.0
"""[s] that a node gets to end after SIGINT."""


class NodeProcess:
    """A running node; use it as a context manager, which stops it.

    Args:
        name: of the executable: pose_ingest, fisher_scorer, curator, player, ...; or a module with dots
        parameters: ROS parameters by name; paths, numbers, words, truth values, or lists of these.
        domain_id: ROS_DOMAIN_ID.
        log_path: file that takes what the node says; appended to.
        remappings: topic names, from what the node calls them to what they are called.
        environment: more variables for the process.
        words: of the command line, before what ROS takes.
    """

    def __init__(
        self,
        name: str,
        parameters: Mapping[str, Any],
        domain_id: int,
        log_path: Path,
        remappings: Mapping[str, str] | None = None,
        environment: Mapping[str, str] | None = None,
        words: Sequence[str] = (),
    ) -> None:
        self.name = name
        self.log_path = log_path
        self._asked = False
        module = name if "." in name else f"contact_curation.nodes.{name}"
        arguments = [f"-r{old}:={new}" for old, new in (remappings or {}).items()]
        arguments += [f"-p{key}:={parameter_text(value)}" for key, value in parameters.items()]
        settings = {"ROS_DOMAIN_ID": str(domain_id), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        with log_path.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", module, *words, "--ros-args", *_split(arguments)],
                env={**os.environ, **settings, **(environment or {})},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def status(self) -> int | None:
        """Exit status; None while it runs; -9 after a kill."""
        return self._process.poll()

    def wait(self, seconds: float) -> int:
        """Waits for the node to end by itself and gives its exit status.

        Raises:
            subprocess.TimeoutExpired: it runs on.
        """
        return self._process.wait(seconds)

    def kill(self) -> None:
        """Ends the node at once, as a crash would (SIGKILL)."""
        self._process.kill()
        self._process.wait()

    def stop(self, how: signal.Signals = signal.SIGINT) -> int:
        """Asks the node to end, insists after a while, and gives its exit status."""
        self.ask_to_end(how)
        try:
            return self._process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self.kill()
            return self._process.wait()

    def ask_to_end(self, how: signal.Signals = signal.SIGINT) -> None:
        """Sends a signal and does not wait; once, for a second one would interrupt the ending."""
        if self._process.poll() is None and not self._asked:
            self._process.send_signal(how)
        self._asked = True

    def log(self) -> str:
        """What it has said so far."""
        return self.log_path.read_text(errors="replace")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.stop()


def spawn_node(
    name: str,
    parameters: Mapping[str, Any],
    domain_id: int,
    log_path: Path,
    remappings: Mapping[str, str] | None = None,
    environment: Mapping[str, str] | None = None,
    words: Sequence[str] = (),
) -> NodeProcess:
    """Starts a node of this package; arguments as `NodeProcess`."""
    return NodeProcess(name, parameters, domain_id, log_path, remappings, environment, words)


def parameter_text(value: Any) -> str:
    """A value as `-p name:=value` takes it, which is YAML; words are quoted so that "1" or "yes" stay words."""
    if isinstance(value, float) and value in (float("inf"), float("-inf")):
        return ".inf" if value > 0.0 else "-.inf"
    if isinstance(value, list | tuple):
        return f"[{', '.join(parameter_text(each) for each in value)}]"
    return json.dumps(str(value) if isinstance(value, Path) else value)


def _split(arguments: list[str]) -> list[str]:
    """`-pname:=value` as the two words that ROS wants."""
    return [part for argument in arguments for part in (argument[:2], argument[2:])]
