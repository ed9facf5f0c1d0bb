"""ROS 2 nodes: a stage of the library each, plus translation of messages.

The linear algebra of NumPy and torch is kept to one thread here: a node's matrices are small, and threads of several nodes that
wait for each other on few cores turn an eigenvalue decomposition of 1 ms into one of 30 ms.
"""

import os

for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # read when NumPy or torch is imported, which is after this
    os.environ.setdefault(library, "1")
