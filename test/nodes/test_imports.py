"""A node starts without the libraries that its work does not need: SciPy's statistics alone take half a second."""

import subprocess
import sys

NODES = ("container", "curator", "fisher_scorer", "player", "pose_ingest", "session_recorder", "throw_designer")


def test_the_nodes_of_a_recorded_or_live_graph_import_neither_scipy_nor_torch() -> None:
    modules = ", ".join(f"contact_curation.nodes.{name}" for name in NODES)
    code = f"import sys, {modules}; print(sorted({{'mujoco', 'rerun', 'scipy', 'torch'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
