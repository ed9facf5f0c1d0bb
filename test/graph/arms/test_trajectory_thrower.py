"""An arm by its description alone, behind a trajectory controller: throws as tracked, and faults that end safely."""

from collections.abc import Iterator

import numpy as np
import pytest

from contact_curation.stages.records import GripperRecord, read_record
from test.foreign_arm.arms import throw
from test.graph.parts.described_arm import ready, started
from test.graph.parts.graph import Graph
from test.graph.parts.lifecycle import changed
from test.graph.parts.processes import NodeProcess
from test.graph.parts.thrower import STILL, Thrower, speeds

pytestmark = [pytest.mark.slow, pytest.mark.live]

FASTEST = np.pi
"""Of each joint of a UR5e [rad/s]."""

THROWS = 4

FAULTS = {
    "slider": "speed scaling: found 80 %, expected 100 %",
    "silent": "joint states: found the last one",
    "abort": "the controller gave up: path tolerance violated",
}
MOVING = 0.5
"""[rad/s]"""


@pytest.fixture
def node(graph: Graph) -> NodeProcess:
    return started(graph)


@pytest.fixture
def thrower(graph: Graph, node: NodeProcess) -> Iterator[Thrower]:
    made = ready(graph)
    yield made
    made.close()


def test_throws_are_made_and_returned_as_the_tracker_saw_them_and_the_delay_is_learned(graph: Graph, thrower: Thrower) -> None:
    assert thrower.trigger("check") == "nothing is missing; disarmed: it was never armed"
    assert not any(speed > STILL for speed in speeds(thrower.joints))
    thrower.trigger("arm")
    for number in range(THROWS):
        wanted, goal = throw(number), thrower.send(throw(number))
        result = thrower.ended(goal).result
        assert result.success, f"{result.message}\n{graph.logs()}"
        found = result.executed.release_linear_velocity
        speed = np.linalg.norm([found.x, found.y, found.z])
        assert abs(speed / np.linalg.norm(wanted.linear_velocity) - 1.0) < 0.05
        assert goal.phases == ["planning", "throwing", "released"]
    assert max(speeds(thrower.joints)) < FASTEST
    record = read_record(graph.folder / "gripper.json", GripperRecord)
    assert record is not None
    assert len(record.seen) == THROWS
    assert abs(np.mean([seen.delay for seen in record.seen]) - 0.05) < 0.02
    assert abs(record.lag - 0.02) < 0.012


def until_it_swings(graph: Graph, thrower: Thrower) -> None:
    seen = len(thrower.joints)
    graph.until(lambda: max(speeds(thrower.joints[seen:]), default=0.0) > MOVING, 90.0, "an arm that swings")


def test_after_a_fault_in_the_motion_the_arm_stands_still_goes_home_when_armed_and_a_node_that_ends_stops_it(
    graph: Graph, thrower: Thrower, node: NodeProcess
) -> None:
    for fault, line in FAULTS.items():
        thrower.trigger("arm")
        thrower.set_parameters("foreign_controller", fault=fault, fault_after=1.5)
        goal = thrower.send(throw(0))
        result = thrower.ended(goal).result
        assert result.message.startswith(f"stopped before the release: {line}"), f"{result.message}\n{graph.logs()}"
        assert not result.executed.throw_id
        thrower.set_parameters("foreign_controller", fault="", fault_after=0.0)
        thrower.until_still(100)
        assert "the arm is disarmed" in thrower.trigger("home")
        thrower.trigger("arm")
        assert "from home" in thrower.ended(thrower.send(throw(0))).result.message
        assert thrower.trigger("home") == "on its way home"
        graph.until(lambda: thrower.trigger("check") == "nothing is missing; armed", 90.0, "an arm at home")
    thrower.send(throw(1))
    until_it_swings(graph, thrower)
    node.ask_to_end()
    assert node.wait(10.0) == 0
    thrower.until_still(100)
    away = np.abs(np.array(thrower.joints[-1].position) - thrower.joints[0].position)
    assert away.max() > 0.1  # it stopped on its way, and did not finish its trajectory
    assert max(speeds(thrower.joints)) < FASTEST


def test_a_node_that_is_deactivated_stops_the_arm_until_it_is_active_and_armed_and_so_does_one_that_is_shut_down(
    graph: Graph, thrower: Thrower, node: NodeProcess
) -> None:
    thrower.trigger("arm")
    goal = thrower.send(throw(0))
    until_it_swings(graph, thrower)
    assert changed(graph.listener, "/trajectory_thrower", "deactivate")
    assert "the node was deactivated" in thrower.ended(goal).result.message
    thrower.until_still(100)
    assert "found it inactive, expected it active" in thrower.trigger("home")
    assert changed(graph.listener, "/trajectory_thrower", "activate")
    assert "the arm is disarmed (the node was deactivated)" in thrower.trigger("home")
    thrower.trigger("arm")
    assert thrower.trigger("home") == "on its way home"
    graph.until(lambda: thrower.trigger("check") == "nothing is missing; armed", 90.0, "an arm at home")
    thrower.send(throw(1))
    until_it_swings(graph, thrower)
    assert changed(graph.listener, "/trajectory_thrower", "shutdown")
    assert node.wait(10.0) == 0
    thrower.until_still(100)
    away = np.abs(np.array(thrower.joints[-1].position) - thrower.joints[0].position)
    assert away.max() > 0.1  # it stopped on its way
    assert max(speeds(thrower.joints)) < FASTEST
