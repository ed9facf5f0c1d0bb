"""A UR5e known by its description, behind the foreign controller, and the node that throws with it."""

from typing import Any

from test.foreign_arm.arms import FILES
from test.graph.parts.graph import LONGEST, Graph
from test.graph.parts.processes import NodeProcess
from test.graph.parts.thrower import Thrower

PATIENT: dict[str, Any] = {
    "trajectory.oldest_state": 0.4, "trajectory.oldest_signal": 1.0, "trajectory.learning": 10, "gate.heartbeat_timeout": 0.5,
}  # fmt: skip
"""For a busy machine; a lab's own bounds are shorter."""


SLOWED = 0.25
"""Simulated seconds a second: a busy machine tells the gripper in time then."""


def started(graph: Graph) -> NodeProcess:
    """Starts controller, gripper and tracker, and `trajectory_thrower`, which is returned."""
    arm = FILES["ur5e"]
    graph.start("test.graph.parts.foreign_controller", arm=arm, rate=SLOWED)
    return graph.start("trajectory_thrower", use_sim_time=True, arm=arm, state=graph.folder / "gripper.json", **PATIENT)


def ready(graph: Graph) -> Thrower:
    """A client of the node, once nothing is missing."""
    made = Thrower(graph, "trajectory_thrower")
    graph.until(lambda: made.trigger("check").startswith("nothing is missing"), LONGEST, "an arm with all that it needs")
    return made
