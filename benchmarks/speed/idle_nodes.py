"""Nodes that have nothing to do: processor time of each, and how long each takes to end on one signal and on two.

    python -m benchmarks.speed.idle_nodes --seconds 30

Processor time is what the system counts for a process and its threads, as a share of one core; it does not depend on what else
runs. The exit status is 1 where a node does not end within 5 s with status 0 and without a traceback.
"""

import argparse
import os
import signal
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from test.graph.parts.processes import NodeProcess, spawn_node

NODES = ("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "sim_camera", "session_recorder")
WITHOUT_STORE = ("sim_arm", "sim_camera", "session_recorder")
STARTING = 60.0
"""[s] that a node gets to start on a busy machine; it has started when its processor time stands nearly still."""
CALM = 0.2
"""Share of a core under which a node has started."""
LONGEST = 5.0
"""[s] in which a node ends."""
DOMAIN = 92


def main() -> int:
    """Measures."""
    parser = argparse.ArgumentParser(description="what nodes that have nothing to do take, and how they end")
    parser.add_argument("--seconds", type=float, default=30.0)
    arguments = parser.parse_args()
    sound = True
    for signals in (1, 2):
        with TemporaryDirectory(prefix="contact-curation-idle-") as folder:
            nodes = [started(name, Path(folder)) for name in NODES]
            for node in nodes:
                await_calm(node)
            if signals == 1:
                shares = {node.name: share for node, share in zip(nodes, at_rest(nodes, arguments.seconds))}
                print("\n".join(f"{name:>18}  {100.0 * share:5.2f} % of a core at rest" for name, share in shares.items()))
            for node in nodes:
                seconds, clean = ending(node, signals)
                sound &= clean and seconds <= LONGEST
                print(f"{node.name:>18}  ended {seconds:.2f} s after {signals} signal(s), {'clean' if clean else node.log()}")
    return 0 if sound else 1


def started(name: str, folder: Path) -> NodeProcess:
    """A node with stores of its own."""
    stores = {} if name in WITHOUT_STORE else {"store": folder / f"{name}.sqlite"}
    bag = {"bag": folder / "session.mcap"} if name == "session_recorder" else {}
    return spawn_node(name, {**stores, **bag}, DOMAIN, folder / f"{name}.log")


def await_calm(node: NodeProcess) -> None:
    """Until a node has started."""
    end = time.monotonic() + STARTING
    while time.monotonic() < end:
        before = busy(node.pid)
        time.sleep(2.0)
        if before > 0.5 and busy(node.pid) - before < 2.0 * CALM:
            return


def at_rest(nodes: list[NodeProcess], seconds: float) -> list[float]:
    """Share of a core that each takes."""
    before, begun = [busy(node.pid) for node in nodes], time.monotonic()
    time.sleep(seconds)
    elapsed = time.monotonic() - begun
    return [(busy(node.pid) - first) / elapsed for node, first in zip(nodes, before)]


def busy(pid: int) -> float:
    """Processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def ending(node: NodeProcess, signals: int) -> tuple[float, bool]:
    """Seconds to its end, and whether that was clean."""
    begun = time.monotonic()
    for _ in range(signals):
        if node.status is None:
            os.kill(node.pid, signal.SIGINT)
            time.sleep(0.1)
    status = node.wait(30.0)
    return time.monotonic() - begun, status == 0 and "Traceback" not in node.log()


if __name__ == "__main__":
    sys.exit(main())
