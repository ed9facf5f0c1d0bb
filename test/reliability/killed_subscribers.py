"""A subscriber that is killed in mid-stream, again and again: what becomes of the publisher, and what is left in /dev/shm.

    python -m test.reliability.killed_subscribers 30             as the nodes of a session are
    python -m test.reliability.killed_subscribers 30 LOCALHOST   as rmw_fastrtps chooses itself: shared memory first

Prints a row of docs/reliability.md. Each subscriber is forked from a process that has not called the middleware yet, and is
killed while messages come.
"""

import os
import signal
import sys
import time
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import contact_curation.nodes  # noqa: F401 - as a node does
from contact_curation.session.free_domain import free_domain
from contact_curation.session.graph import PROFILES, graph_environment

RATE = 500.0
"""[Hz]"""
SILENCE = 2.0
"""[s] of a publisher that count as standing still."""
PATIENCE = 20.0
"""[s] until a subscriber that hears nothing counts as one that the publisher has lost."""


def publish(beats: int) -> None:
    """Publishes messages of 1 kB until its end; each is a byte on `beats`."""
    import rclpy
    from std_msgs.msg import ByteMultiArray

    rclpy.init()
    publisher = rclpy.create_node("publisher").create_publisher(ByteMultiArray, "messages", 100)
    message = ByteMultiArray(data=[b"\1"] * 1000)
    while True:
        publisher.publish(message)
        os.write(beats, b".")
        time.sleep(1.0 / RATE)


def subscribe(heard: int) -> None:
    """Takes messages until its end; each is a byte on `heard`."""
    import rclpy
    from std_msgs.msg import ByteMultiArray

    rclpy.init()
    node = rclpy.create_node("subscriber")
    node.create_subscription(ByteMultiArray, "messages", lambda _: os.write(heard, b".") and None, 100)
    rclpy.spin(node)


def started(work: Any) -> tuple[int, int]:
    """Id of a forked process that does it, and the descriptor to read its beats from."""
    ours, its = os.pipe()
    child = os.fork()
    if not child:
        os.close(ours)
        work(its)
        os._exit(0)
    os.close(its)
    os.set_blocking(ours, False)
    return child, ours


def beats(descriptor: int) -> int:
    """How many came since the last look."""
    try:
        return len(os.read(descriptor, 1 << 16))
    except BlockingIOError:
        return 0


def mapped(process: int) -> set[Path]:
    """Shared memory of the middleware that a process has mapped; other graphs on the machine have their own."""
    lines = Path(f"/proc/{process}/maps").read_text().splitlines()
    return {Path(line[line.index("/") :]) for line in lines if "/dev/shm/fastrtps_" in line}


def main(kills: int, discovery: str = "") -> None:
    """Prints the row."""
    import rclpy  # noqa: F401 - before the forks
    from std_msgs.msg import ByteMultiArray  # noqa: F401

    with free_domain() as domain:
        # A profile of the user's, though it is none, keeps the one for the loopback interface away.
        own = {**os.environ, PROFILES[1]: "", "ROS_AUTOMATIC_DISCOVERY_RANGE": discovery} if discovery else os.environ
        os.environ.update(graph_environment(own, Path(gettempdir()), domain))
        publisher, pulse = started(publish)
        while not beats(pulse):
            time.sleep(0.01)
        longest, last, unheard, stood = 0.0, time.monotonic(), 0, 0
        shared: set[Path] = set()
        for number in range(kills):
            subscriber, heard = started(subscribe)
            began, messages, wanted = time.monotonic(), 0, 5 + 37 * number % 100
            while messages < wanted and time.monotonic() - began < PATIENCE:
                messages += beats(heard)
                time.sleep(0.002)
                if beats(pulse):
                    stood += time.monotonic() - last > SILENCE
                    longest, last = max(longest, time.monotonic() - last), time.monotonic()
            unheard += not messages
            shared |= mapped(publisher) | mapped(subscriber)
            os.kill(subscriber, signal.SIGKILL)
            os.waitpid(subscriber, 0)
            os.close(heard)
        longest = max(longest, time.monotonic() - last)
        os.kill(publisher, signal.SIGKILL)
        os.waitpid(publisher, 0)
    left = sum(path.exists() and path.stat().st_size > 0 for path in shared)
    counts = f"{stood} | {longest:.1f} s | {unheard} | {left}"
    print(f"| `{discovery or 'loopback.xml'}` | {kills} | {counts} |")  # noqa: T201


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:])
