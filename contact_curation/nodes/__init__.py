"""ROS 2 nodes: each is a stage of the library plus the translation of messages.

Linear algebra in NumPy and torch uses one thread here. A node's matrices are small, and on few cores the threads of several
nodes wait for each other: an eigenvalue decomposition of 1 ms then takes 30 ms.
"""

import os
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
