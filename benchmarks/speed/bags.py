"""How fast bags are read and written, and the pose journal filled: messages per second on one core, by format.

The bags are made on the spot from poses like TagSLAM's, in a temporary folder.

    python -m benchmarks.speed.bags [--json] [--messages N] [--repeats N]
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.stores.tosses import JournalPose, TossStore

TOPIC = "/tagslam/odom/body_cube"
ODOMETRY = "nav_msgs/msg/Odometry"
STEP_NS = 6_756_757
BATCH = 30
"""Poses per transaction of the journal."""


@dataclass(frozen=True)
class Rate:
    """The best of some repetitions [1/s]."""

    what: str
    per_second: float


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--messages", type=int, default=20_000, help="messages per bag")
    parser.add_argument("--repeats", type=int, default=3, help="repetitions, of which the best counts")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rates = measured(Path(folder), options.messages, options.repeats)
    if options.json:
        print(json.dumps([asdict(rate) for rate in rates], indent=2))
    else:
        for rate in rates:
            print(f"{rate.what:32} {rate.per_second:12,.0f} per second")
    return 0


def measured(folder: Path, count: int, repeats: int) -> list[Rate]:
    """All rates, of `count` messages each."""
    jazzy, noetic = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS1_NOETIC)
    poses = [_odometry(jazzy, number) for number in range(count)]
    rates = [Rate("write MCAP", _best(lambda: _write(folder / "bag.mcap", poses), count, repeats))]
    bags = {
        "MCAP": folder / "bag.mcap",
        "rosbags' MCAP": _by_rosbags(folder / "mcap", jazzy, poses, StoragePlugin.MCAP),
        "sqlite3": _by_rosbags(folder / "sqlite3", jazzy, poses, StoragePlugin.SQLITE3),
        "ROS 1": _ros1(folder / "ros1.bag", noetic, count),
    }
    for name, path in bags.items():
        rates.append(Rate(f"read and decode {name}", _best(lambda path=path: _read(path), count, repeats)))  # type: ignore[misc]
    rates.append(Rate("read raw MCAP", _best(lambda: _read_raw(bags["MCAP"]), count, repeats)))
    rates.append(Rate("append poses to the journal", _best(lambda: _journal(folder / "tosses.sqlite", count), count, repeats)))
    return rates


def _best(run: Callable[[], object], count: int, repeats: int) -> float:
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        run()
        times.append(time.perf_counter() - began)
    return count / min(times)


def _odometry(store: Typestore, number: int, *sequence: int) -> object:
    t = store.types
    stamp = t["builtin_interfaces/msg/Time"](*divmod(number * STEP_NS, 10**9))
    x, y, z, *q = np.random.default_rng(number).normal(size=7).tolist()
    vector = t["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    pose = t["geometry_msgs/msg/Pose"](t["geometry_msgs/msg/Point"](x, y, z), t["geometry_msgs/msg/Quaternion"](*q))
    return t[ODOMETRY](
        t["std_msgs/msg/Header"](*sequence, stamp, "map"),
        "body_cube",
        t["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)),
        t["geometry_msgs/msg/TwistWithCovariance"](t["geometry_msgs/msg/Twist"](vector, vector), np.zeros(36)),
    )


def _write(path: Path, poses: list[object]) -> None:
    with BagWriter(path) as writer:
        for number, pose in enumerate(poses):
            writer.write(TOPIC, pose, number * STEP_NS)


def _by_rosbags(folder: Path, store: Typestore, poses: list[object], plugin: StoragePlugin) -> Path:
    with Ros2Writer(folder, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection(TOPIC, ODOMETRY, typestore=store)
        for number, pose in enumerate(poses):
            writer.write(connection, number * STEP_NS, store.serialize_cdr(pose, ODOMETRY))
    return folder


def _ros1(path: Path, store: Typestore, count: int) -> Path:
    with Ros1Writer(path) as writer:
        connection = writer.add_connection(TOPIC, ODOMETRY, typestore=store)
        for number in range(count):
            writer.write(connection, number * STEP_NS, store.serialize_ros1(_odometry(store, number, number), ODOMETRY))
    return path


def _read(path: Path) -> None:
    with BagReader(path) as reader:
        for _ in reader.messages():
            pass


def _read_raw(path: Path) -> None:
    with BagReader(path) as reader:
        for _ in reader.raw_messages():
            pass


def _journal(path: Path, count: int) -> None:
    batch = [JournalPose(0, "map", "body_cube", (0.0, 0.0, 0.2), (1.0, 0.0, 0.0, 0.0))] * BATCH
    with TossStore(path) as store:
        for _ in range(count // BATCH):
            store.append_poses(batch)


if __name__ == "__main__":
    sys.exit(main())
