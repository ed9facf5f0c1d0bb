"""Curates the tosses of a live topic: whenever a toss comes, the best of all so far are selected anew.

pose_ingest --ros-args -p topic:=/my_tracker/brick      # makes tosses of poses
python examples/curate_live_topic.py                    # in another terminal; Ctrl-C ends it
"""

from contextlib import suppress

import rclpy
from contact_curation_msgs.msg import Toss
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.nodes.messages.toss import toss_of

TOP = 4


class LiveCurator(Node):
    """Keeps all tosses that it hears, and says which are the best."""

    def __init__(self) -> None:
        super().__init__("live_curator")
        self.tosses: dict[str, cc.Toss] = {}
        qos = QoSProfile(depth=100, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(Toss, "toss", self.hear, qos)

    def hear(self, message: Toss) -> None:
        toss = toss_of(message)
        self.tosses[toss.toss_id] = toss
        ranking = cc.rank(cc.Tosses.of(list(self.tosses.values()), CONTACTNETS_CUBE), top=TOP)
        print(f"{len(self.tosses)} tosses, selected: {', '.join(ranking.selected_ids)}", flush=True)


rclpy.init()
with suppress(KeyboardInterrupt, ExternalShutdownException):
    rclpy.spin(LiveCurator())
