"""How long after a toss's last pose its information is published at 148 Hz, and what the graph costs: three ways in one run.

- separate: pose_ingest, fisher_scorer and curator as processes of their own
- container: the same nodes in one process (`contact_curation.nodes.container`)
- bare: a node that publishes a message for every pose that it receives and does nothing else, which is the least that rclpy
  takes for one reception and one publication

Both moments are times of publication by the middleware's clock, on one machine: of the pose with the stamp of the toss's last
frame, and of the information. A toss is known to be over one frame after its last (6.8 ms), which is part of the latency of the
first two. Processor time is that of the nodes' processes, without player and listener, in percent of one processor.

    python -m benchmarks.speed.graph_latency [--tosses N] [--rate R] [--ways separate container bare] [--json]
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from contact_curation_msgs.msg import TossInformation
from nav_msgs.msg import Odometry

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.nodes.messages.headers import nanoseconds_of
from contact_curation.nodes.ros.health import node_of
from contact_curation.nodes.ros.qos import latched
from contact_curation.session.free_domain import free_domain
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.datasets.tagslam_bag import TagslamRig, record
from test.graph.parts.graph import Graph, until
from test.graph.parts.processes import NodeProcess
from test.simulated import RIG_NOISE, simulated_tosses

TOPIC, ECHO = "/tagslam/odom/body_cube", "/echo"
STAGES: Mapping[str, Mapping[str, Any]] = {"pose_ingest": {}, "fisher_scorer": {}, "curator": {}}
PAUSE = 0.5
"""Time without poses between tosses [s]."""

SEED = 5
PATIENCE = 180.0
"""[s] for what is still on its way at the end, and for nodes to start."""

REST = 10.0
"""Time over which the processor time at rest is taken [s]."""

TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Latency:
    """One way, from last pose to information, or to the echo of any pose [ms]; processor time [% of one processor]."""

    way: str
    tosses: int
    measured: int
    rate: float
    median: float
    p90: float
    p99: float
    worst: float
    cpu_at_rest: float
    cpu_playing: float
    processors: int
    load: float


class Moments:
    """Times of publication [ns] by header stamp, of poses and of what follows from them."""

    def __init__(self, graph: Graph, kind: Any, topic: str) -> None:
        self.poses: dict[int, int] = {}
        self.results: dict[int, int] = {}
        node = graph.listener.node
        node.create_subscription(Odometry, TOPIC, _noted(self.poses), latched(10000))
        node.create_subscription(kind, topic, _noted(self.results), latched(10000))

    def latencies(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """(measured,) [ms]."""
        return np.array([(at - self.poses[stamp]) * 1e-6 for stamp, at in self.results.items()])


def _noted(moments: dict[int, int]) -> Callable[[Any, Mapping[str, int]], None]:
    def note(message: Any, info: Mapping[str, int]) -> None:
        moments[nanoseconds_of(message.header.stamp)] = info["source_timestamp"]

    return note


class Busy:
    """Processor time of processes since it was last asked for, in percent of one processor."""

    def __init__(self, processes: Sequence[NodeProcess]) -> None:
        self._processes = processes
        self._before = self._now()

    def percent(self) -> float:
        """Since the last call."""
        (used, at), self._before = self._before, self._now()
        return 100.0 * (self._before[0] - used) / (self._before[1] - at)

    def _now(self) -> tuple[float, float]:
        fields = [Path(f"/proc/{one.pid}/stat").read_text().rpartition(")")[2].split() for one in self._processes]
        return sum(int(each[11]) + int(each[12]) for each in fields) / TICKS, time.monotonic()


def measured(way: str, bag: Path, count: int, rate: float) -> Latency:
    """Plays a recording of `count` tosses to one of the ways."""
    with TemporaryDirectory() as folder, free_domain() as domain, Graph(Path(folder), domain) as graph:
        bare = way == "bare"
        moments = Moments(graph, Odometry if bare else TossInformation, ECHO if bare else "/toss_information")
        tosses, rejected = graph.tosses(), graph.rejected()
        nodes = _started(way, graph)
        time.sleep(REST / 2.0)
        busy = Busy(nodes)
        time.sleep(REST)
        at_rest = busy.percent()
        player = graph.start("player", bag=bag, rate=rate, wait_for=20.0, stay=True)
        until(lambda: moments.poses, PATIENCE, "a pose")
        busy.percent()
        until(lambda: "played" in player.log(), PATIENCE + count * 4.0 / rate, "the end of the recording")
        playing = busy.percent()
        until(lambda: bare or len(tosses) + len(rejected) >= count, PATIENCE, "the last toss")
        expected = moments.poses if bare else tosses
        until(lambda: len(moments.results) == len(expected), PATIENCE, "the last result")
        time.sleep(1.0)
        found = moments.latencies()
    median, p90, p99, worst = np.percentile(found, [50.0, 90.0, 99.0, 100.0]).tolist()
    processors, load = os.cpu_count() or 0, os.getloadavg()[0]
    return Latency(way, count, found.size, rate, median, p90, p99, worst, at_rest, playing, processors, load)


def _started(way: str, graph: Graph) -> list[NodeProcess]:
    """Starts the nodes and waits until they work."""
    if way == "bare":
        nodes = [graph.start("benchmarks.speed._echo")]
        until(lambda: graph.listener.node.count_subscribers(TOPIC) > 1, PATIENCE, "the echo")
        return nodes
    heard = graph.diagnostics()
    nodes = [graph.start_together(STAGES)] if way == "container" else [graph.start(name) for name in STAGES]
    named = {f"/{name}" for name in STAGES}
    until(lambda: named <= {node_of(one.status[0].name) for one in heard}, PATIENCE, "all nodes")
    return nodes


WAYS = ("separate", "container", "bare")


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=64, help="how many (default 64)")
    parser.add_argument("--rate", type=float, default=1.0, help="times real time (default 1)")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS, help="which (default all)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with TemporaryDirectory() as folder:
        bag = Path(folder) / "tosses.mcap"
        with BagWriter(bag) as writer:
            tosses = simulated_tosses(arguments.tosses, SEED, RIG_NOISE)
            record(writer, CONTACTNETS_CUBE, tosses, TagslamRig(pause=PAUSE))
        rows = [measured(way, bag, arguments.tosses, arguments.rate) for way in arguments.ways]
    if arguments.json:
        print(json.dumps([asdict(row) for row in rows], indent=1))
        return 0
    print(f"{arguments.tosses} tosses at {148 * arguments.rate:g} Hz, {rows[0].processors} processors")
    print(
        f"{'':10s}{'measured':>9s}{'median':>9s}{'90 %':>9s}{'99 %':>9s}{'worst':>9s}{'at rest':>9s}{'playing':>9s}{'load':>7s}"
    )
    for row in rows:
        times = "".join(f"{value:6.1f} ms" for value in (row.median, row.p90, row.p99, row.worst))
        print(f"{row.way:10s}{row.measured:9d}{times}{row.cpu_at_rest:7.1f} %{row.cpu_playing:7.1f} %{row.load:9.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
