"""ROS 2 nodes: a stage of the library each, plus translation of messages.

The linear algebra of NumPy and torch is kept to one thread here: a node's matrices are small, and threads of several nodes that
wait for each other on few cores turn an eigenvalue decomposition of 1 ms into one of 30 ms.
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

# Fast DDS's shared memory outlives a killed process, and its locks with it (docs/reliability.md).
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
