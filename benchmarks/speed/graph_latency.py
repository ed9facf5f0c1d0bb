"""How long after a toss's last pose its information is published, in a live graph of four processes at 148 Hz.

Both moments are times of publication by the middleware's clock, on one machine: of the pose with the stamp of the toss's last
frame, and of the information. A toss is known to be over one frame after its last (6.8 ms), which is part of the latency.

    python -m benchmarks.speed.graph_latency [--tosses N] [--rate R] [--json]
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from contact_curation_msgs.msg import TossInformation
from nav_msgs.msg import Odometry

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.nodes.messages.headers import nanoseconds_of
from contact_curation.nodes.ros.qos import latched
from contact_curation.session.free_domain import free_domain
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.datasets.tagslam_bag import TagslamRig, record
from test.graph.parts.graph import Graph, until
from test.simulated import RIG_NOISE, simulated_tosses

TOPIC = "/tagslam/odom/body_cube"
PAUSE = 0.5
"""Time without poses between tosses [s]."""

SEED = 5
PATIENCE = 30.0
"""[s] for what is still on its way at the end."""


@dataclass(frozen=True)
class Latency:
    """From last pose to information [ms]."""

    tosses: int
    scored: int
    rate: float
    median: float
    p90: float
    p99: float
    worst: float
    processors: int
    load: float


class Moments:
    """Times of publication [ns] by header stamp."""

    def __init__(self, graph: Graph) -> None:
        self.poses: dict[int, int] = {}
        self.informations: dict[int, int] = {}
        node = graph.listener.node
        node.create_subscription(Odometry, TOPIC, self._pose, latched(10000))
        node.create_subscription(TossInformation, "/toss_information", self._information, latched(100))

    def _pose(self, message: Any, info: Mapping[str, int]) -> None:
        self.poses[nanoseconds_of(message.header.stamp)] = info["source_timestamp"]

    def _information(self, message: Any, info: Mapping[str, int]) -> None:
        self.informations[nanoseconds_of(message.header.stamp)] = info["source_timestamp"]

    def latencies(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """(scored,) [ms]."""
        return np.array([(at - self.poses[stamp]) * 1e-6 for stamp, at in self.informations.items()])


def measured(count: int, rate: float) -> Latency:
    """Plays `count` simulated tosses through a graph."""
    with TemporaryDirectory() as folder:
        bag = Path(folder) / "tosses.mcap"
        with BagWriter(bag) as writer:
            record(writer, CONTACTNETS_CUBE, simulated_tosses(count, SEED, RIG_NOISE), TagslamRig(pause=PAUSE))
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        with free_domain() as domain, Graph(Path(folder), domain) as graph:
            moments = Moments(graph)
            tosses = graph.tosses()
            for stage in ("pose_ingest", "fisher_scorer", "curator"):
                graph.start(stage)
            player = graph.start("player", bag=bag, rate=rate, wait_for=20.0, stay=True)
            until(lambda: "played" in player.log(), 60.0 + count * 4.0 / rate, "the end of the recording")
            until(lambda: len(moments.informations) == len(tosses), PATIENCE, "the last information")
            time.sleep(1.0)
            found = moments.latencies()
    median, p90, p99, worst = np.percentile(found, [50.0, 90.0, 99.0, 100.0]).tolist()
    return Latency(count, found.size, rate, median, p90, p99, worst, os.cpu_count() or 0, os.getloadavg()[0])


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=64, help="how many (default 64)")
    parser.add_argument("--rate", type=float, default=1.0, help="times real time (default 1)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    latency = measured(arguments.tosses, arguments.rate)
    if arguments.json:
        print(json.dumps(asdict(latency), indent=1))
        return 0
    print(f"{latency.scored} of {latency.tosses} tosses at {148 * latency.rate:g} Hz, {latency.processors} processors")
    print(f"load average {latency.load:.1f}")
    for name in ("median", "p90", "p99", "worst"):
        print(f"{name:8s}{getattr(latency, name):8.1f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
