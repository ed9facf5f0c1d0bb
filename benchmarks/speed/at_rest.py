"""Processor time of each node of a session while nothing is thrown.

    python -m benchmarks.speed.at_rest [--seconds 60]

Once with simulated time that stands still, so that no poses come; once with a tracker that publishes 148 poses a second of a
body that does not move. The nodes are those of `online --record`, started as it starts them. What other programs use is not
counted, though a busy machine's caches make the shares somewhat larger.
"""

import argparse
import os
import sys
import time
from collections.abc import Collection
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.nodes.ros.health import node_of
from contact_curation.nodes.ros.qos import profile
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.free_domain import free_domain
from contact_curation.session.graph import supervised
from contact_curation.session.node_parameters import session_parameters
from contact_curation.session.parameter_files import write_node_parameters
from contact_curation.session.supervisor import Incident
from test.graph.parts.graph import Listener, until

RATES = {"no poses": 0.0, "148 poses/s": 1.0}
"""Simulated seconds a second, by what the tracker does then."""

LONGEST_START, SETTLING = 600.0, 15.0
"""[s] that all nodes may take to start, and to finish what the start left over."""


class Used(NamedTuple):
    """What a process has used: processor time [s], memory [bytes]; threads it has."""

    seconds: float
    memory: int
    threads: int


def used(pid: int) -> Used:
    """Read from Linux's /proc."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    ticks, pages = int(fields[11]) + int(fields[12]), int(fields[21])
    return Used(ticks / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGE_SIZE"), int(fields[17]))


def at_rest(rate: float, seconds: float) -> dict[str, tuple[float, Used]]:
    """By node: share of a processor in so many seconds of rest, and what it has then."""
    pids: dict[str, int] = {}

    def tell(incident: Incident) -> None:
        pids[incident.program] = incident.pid
        if incident.what == "died":
            raise SystemExit(f"{incident.program} died: {incident.detail}")

    with ExitStack() as stack:
        folder = SessionFolder(Path(stack.enter_context(TemporaryDirectory())) / "session")
        folder.make()
        parameters = session_parameters(SessionConfig(rate=rate, record=folder.root), CONTACTNETS_CUBE, folder)
        parameters["throw_designer"]["auto"] = False
        write_node_parameters(folder.parameters, parameters)
        domain = stack.enter_context(free_domain())
        supervisor = stack.enter_context(supervised(parameters, folder, domain, tell))
        supervisor.start()
        _until_up(parameters, domain)
        before, began = {name: used(pid) for name, pid in pids.items()}, time.monotonic()
        time.sleep(seconds)
        supervisor.look()
        passed = time.monotonic() - began
        after = {name: used(pid) for name, pid in pids.items()}
    return {name: ((after[name].seconds - before[name].seconds) / passed, after[name]) for name in before}


def _until_up(nodes: Collection[str], domain: int) -> None:
    """Until every node has reported its health, which a node that has no time to start does not; then a while more."""
    listener = Listener(domain)
    heard: list[Any] = []
    qos = profile(100, reliable=True, latched=False)
    listener.node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, qos)
    try:
        wanted = {f"/{node}" for node in nodes}
        until(lambda: wanted <= {node_of(one.name) for array in heard for one in array.status}, LONGEST_START, "all nodes")
    finally:
        listener.close()
    time.sleep(SETTLING)


def main() -> int:
    """Prints a table."""
    parser = argparse.ArgumentParser(description="processor time of the nodes while nothing is thrown")
    parser.add_argument("--seconds", type=float, default=60.0)
    arguments = parser.parse_args()
    found = {name: at_rest(rate, arguments.seconds) for name, rate in RATES.items()}
    print(f"| node | {' | '.join(f'{name}, % of a processor' for name in found)} | memory, MB | threads |")
    print(f"|---|{'---|' * len(found)}---|---|")
    nodes = list(next(iter(found.values())))
    for node in nodes:
        shares = [f"{100.0 * each[node][0]:.1f}" for each in found.values()]
        last = list(found.values())[-1][node][1]
        print(f"| `{node}` | {' | '.join(shares)} | {last.memory / 1e6:.0f} | {last.threads} |")
    sums = [f"{100.0 * sum(share for share, _ in each.values()):.1f}" for each in found.values()]
    print(f"| all | {' | '.join(sums)} | | |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
