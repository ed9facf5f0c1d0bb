"""What UDP on the loopback interface costs in place of Fast DDS's shared memory: processor time per message, and latency.

    python -m benchmarks.speed.transport

A publisher and a subscriber, processes of their own: 148 poses a second of 1 kB, 30 images a second of 900 kB; each
transport in turn, several times. A ratio is told: times are those of a machine that may do other things.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from tempfile import gettempdir

import contact_curation.nodes  # noqa: F401 - as a node does
from contact_curation.session.free_domain import free_domain
from contact_curation.session.graph import PROFILES, graph_environment

SECONDS, TURNS = 5.0, 3
RATES = {1_000: 148.0, 900_000: 30.0}
"""[Hz] by the size of a message in bytes."""
KINDS = {"shared memory": {PROFILES[1]: ""}, "loopback.xml": {}}  # with a profile of the user's, sessions use LOCALHOST


def subscribe(size: int) -> None:
    """Takes messages until it hears nothing more, then tells latencies and its own processor time."""
    import rclpy
    from std_msgs.msg import UInt8MultiArray

    rclpy.init()
    node, latencies, last = rclpy.create_node("subscriber"), [], [time.monotonic() + 30.0]

    def heard(message: UInt8MultiArray) -> None:
        sent = int.from_bytes(bytes(message.data[:8]), "little")
        latencies.append(time.monotonic_ns() - sent)
        last[0] = time.monotonic()

    node.create_subscription(UInt8MultiArray, "messages", heard, 10)
    began = time.process_time()
    while time.monotonic() - last[0] < 2.0:
        rclpy.spin_once(node, timeout_sec=0.1)
    told = {"heard": len(latencies), "latency": median(latencies) / 1e6, "seconds": time.process_time() - began}
    print(json.dumps(told), flush=True)
    os._exit(0)


def publish(size: int) -> None:
    """Publishes for some seconds, once somebody listens, then tells its own processor time."""
    from array import array

    import rclpy
    from std_msgs.msg import UInt8MultiArray

    rclpy.init()
    publisher = rclpy.create_node("publisher").create_publisher(UInt8MultiArray, "messages", 10)
    while not publisher.get_subscription_count():
        time.sleep(0.05)
    time.sleep(0.5)
    rest, began, count = bytes(size - 8), time.process_time(), round(RATES[size] * SECONDS)
    for _ in range(count):
        publisher.publish(UInt8MultiArray(data=array("B", time.monotonic_ns().to_bytes(8, "little") + rest)))
        time.sleep(1.0 / RATES[size])
    print(json.dumps({"sent": count, "seconds": time.process_time() - began}), flush=True)
    time.sleep(1.0)
    os._exit(0)


def turn(kind: str, size: int) -> tuple[float, float, float]:
    """Processor time per message [ms], median latency [ms], share that was heard."""
    with free_domain() as domain:
        environment = graph_environment({**os.environ, **KINDS[kind]}, Path(gettempdir()), domain)
        command = [sys.executable, "-m", "benchmarks.speed.transport"]
        both = [
            subprocess.Popen([*command, one, str(size)], env=environment, stdout=subprocess.PIPE)
            for one in ("subscribe", "publish")
        ]
        heard, sent = (json.loads(process.communicate()[0]) for process in both)
    return 1e3 * (heard["seconds"] + sent["seconds"]) / sent["sent"], heard["latency"], heard["heard"] / sent["sent"]


def main() -> None:
    """Prints the table."""
    print("| message | transport | processor time per message, ms | median latency, ms | heard |\n|---|---|---|---|---|")
    for size in RATES:
        found: dict[str, list[tuple[float, float, float]]] = {kind: [] for kind in KINDS}
        for _ in range(TURNS):
            for kind in KINDS:
                found[kind].append(turn(kind, size))
        for kind, turns in found.items():
            seconds, latency, heard = (median(column) for column in zip(*turns, strict=True))
            print(f"| {size // 1000} kB | {kind} | {seconds:.2f} | {latency:.2f} | {heard:.1%} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:]:
        {"subscribe": subscribe, "publish": publish}[sys.argv[1]](int(sys.argv[2]))
    else:
        main()
