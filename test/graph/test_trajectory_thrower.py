"""An arm by its description alone, behind a trajectory controller: throws as tracked, and faults that end safely."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from contact_curation.design.throw import Throw
from contact_curation.geometry.quaternions import IDENTITY
from contact_curation.stages.records import GripperRecord, read_record
from test.graph.parts.graph import Graph
from test.graph.parts.thrower import STILL, Thrower, speeds

pytestmark = [pytest.mark.slow, pytest.mark.live]

UR5E = Path(__file__).resolve().parents[1] / "foreign_arm" / "ur5e.yaml"
FASTEST = np.pi
"""Of each joint of a UR5e [rad/s]."""

THROWS = 5
PATIENT = {"trajectory.oldest_state": 0.4, "trajectory.oldest_signal": 1.0, "gate.heartbeat_timeout": 0.5}
"""For a busy machine; a lab's own bounds are shorter."""


def throw(number: int) -> Throw:
    speed = 0.5 + 0.04 * number
    return Throw(
        f"throw-{number}", "cube", np.array([-0.3, 0.02 * number, 0.17]), IDENTITY, np.array([speed, 0.0, 0.1]),
        np.array([0.0, 0.8, 0.0]),
    )  # fmt: skip


@pytest.fixture
def thrower(graph: Graph) -> Iterator[Thrower]:
    graph.start("test.graph.parts.foreign_controller", arm=UR5E)
    graph.start("trajectory_thrower", arm=UR5E, state=graph.folder / "gripper.json", **PATIENT)
    made = Thrower(graph, "trajectory_thrower")
    graph.until(lambda: made.trigger("check").startswith("nothing is missing"), 90.0, "an arm with all that it needs")
    yield made
    made.close()


def test_throws_are_made_and_returned_as_the_tracker_saw_them_and_the_delay_is_learned(graph: Graph, thrower: Thrower) -> None:
    assert thrower.trigger("check") == "nothing is missing; disarmed: it was never armed"
    assert not any(speed > STILL for speed in speeds(thrower.joints))
    thrower.trigger("arm")
    for number in range(THROWS):
        wanted, result = throw(number), thrower.ended(thrower.send(throw(number))).result
        assert result.success, f"{result.message}\n{graph.logs()}"
        found = result.executed.release_linear_velocity
        speed = np.linalg.norm([found.x, found.y, found.z])
        assert abs(speed / np.linalg.norm(wanted.linear_velocity) - 1.0) < 0.03
    assert max(speeds(thrower.joints)) < FASTEST
    record = read_record(graph.folder / "gripper.json", GripperRecord)
    assert record is not None
    assert len(record.seen) == THROWS
    assert abs(np.mean([seen.delay for seen in record.seen]) - 0.05) < 0.02
    assert abs(record.lag - 0.02) < 0.012
