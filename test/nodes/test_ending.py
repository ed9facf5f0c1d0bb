"""A process of nodes ends in time whatever keeps it, and says what did."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

NODE = """
import ctypes, sys, threading, time
from contact_curation.nodes.ros import node_main

class Kept(node_main.StageNode):
    longest_closing = 0.5

    def __init__(self):
        super().__init__("kept")
        self.create_timer(0.01, lambda: sys.stdout.write("ready\\n") and sys.stdout.flush())

    def close(self):
        {close}

    def destroy_node(self):
        {destroy}

node_main.LONGEST_CLOSING = node_main.BLOCKED = 0.5
sys.exit(node_main.run(Kept, "kept"))
"""

BY_M = """
import sys
sys.argv[0], sys.orig_argv = "-m", [sys.executable, "-m", "contact_curation.nodes.curator"]
import contact_curation.nodes
sys.argv[0] = "curator.py"
"""
"""What Python does while it imports a module's packages, and before it runs the module."""

LONGEST = 20.0
"""[s] on a busy machine; what keeps a node here, keeps it for minutes."""

HOLDS = "ctypes.PyDLL(None).sleep(600)"
"""A call that returns late, and lets no other Python run."""

KEPT = {
    "a job": (
        "time.sleep(600)",
        "pass",
        0,
        "kept: not closed after 0.5 s; what is unfinished is taken up after the next start",
    ),
    "a call that holds Python": (HOLDS, "pass", 1, "in close"),
    "a thread": ("threading.Thread(target=time.sleep, args=(600,)).start()", "super().destroy_node()", 0, ""),
    "the middleware": ("pass", HOLDS, 0, ""),
    "the middleware after a failure": (
        'self.failure = OSError(28, "No space left on device", "store.sqlite")',
        HOLDS,
        1,
        "kept: store.sqlite: found No space left on device, expected to read and write there",
    ),
    "nothing": ("pass", "super().destroy_node()", 0, ""),
}
"""How a node closes and is destroyed, the exit status and what it prints, by what keeps the process."""


@pytest.mark.slow
@pytest.mark.parametrize("by_m", [False, True])
@pytest.mark.parametrize("keeper", KEPT)
def test_a_node_ends_whatever_keeps_it(keeper: str, by_m: bool, tmp_path: Path) -> None:
    close, destroy, status, message = KEPT[keeper]
    left_with, said = ended(close, destroy, tmp_path, by_m)
    assert message in said
    assert bool(said) == bool(message)
    assert left_with == status


def ended(close: str, destroy: str, folder: Path, by_m: bool) -> tuple[int, str]:
    """The exit status of a node that a signal ends, and what it printed on standard error."""
    script = folder / ("kept.py" if by_m else "curator")  # the name of a script makes it a process of nodes
    script.write_text((BY_M if by_m else "") + NODE.format(close=close, destroy=destroy))
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=LONGEST)
        finally:
            process.kill()
    return process.returncode, said
