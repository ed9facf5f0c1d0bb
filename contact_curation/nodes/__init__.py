"""ROS 2 nodes: each is a stage of the library plus the translation of messages.

A process that runs a node ends at once with status 0 when it is told to while modules are imported, which takes seconds;
`ros.node_main` takes over. At its end it leaves as soon as everything is closed: with torch, clearing up takes Python seconds.

Linear algebra in NumPy and torch uses one thread here. A node's matrices are small, and on few cores the threads of several
nodes wait for each other: an eigenvalue decomposition of 1 ms then takes 30 ms.
"""

import atexit
import os
import signal
import sys
from importlib.util import find_spec
from pathlib import Path

from contact_curation.errors import MissingDependencyError

for library in ("rclpy", "contact_curation_msgs"):
    if find_spec(library) is None:
        why = MissingDependencyError(library, "source a ROS 2 Jazzy workspace, or pip install 'contact-curation[ros]'")
        sys.exit(f"{Path(sys.argv[0]).stem}: {why}")

for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # read when NumPy or torch is imported, which is after this
    os.environ.setdefault(library, "1")

# Fast DDS's shared memory and its locks remain after a process is killed (docs/reliability.md).
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")

left_with: list[int] = []
"""The exit status of a process that ran a node, once everything is closed."""


def _leave() -> None:
    if left_with:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(left_with[0])


def _runs_a_node() -> bool:
    """Whether this process was started to run one: `python -m contact_curation.nodes.trainer`, or a script `trainer`."""
    if sys.argv[0] == "-m":
        return any(word.startswith(f"{__name__}.") for word in sys.orig_argv)
    return Path(sys.argv[0]).name in {path.stem for path in Path(__file__).parent.glob("*.py")}  # no user's `trainer.py`


runs_a_node = _runs_a_node()
"""Whether this process was started to run a node; it cannot be told later, when Python has replaced `-m`."""

if runs_a_node:
    atexit.register(_leave)  # before all others, so that it comes last
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
