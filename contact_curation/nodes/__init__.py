"""ROS 2 nodes: a stage of the library each, plus translation of messages.

NumPy's linear algebra is kept to one thread here: a node's matrices are small (52 x 52), and threads of several nodes that wait
for each other on few cores turn an eigenvalue decomposition of 1 ms into one of 30 ms.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when NumPy is imported, which the nodes' modules do after this
