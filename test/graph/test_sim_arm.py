"""The simulated arm as a node: throws, refusals, stops, and what is left after a kill."""

import math
import time
from collections.abc import Iterator

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from rosgraph_msgs.msg import Clock

from contact_curation.design.throw import Throw
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.qos import profile
from test.graph.graph import Graph
from test.graph.thrower import LONG, Thrower, speeds

THROW = Throw(
    throw_id="plain",
    body="cube",
    position=np.array([-0.307, 0.0, 0.16]),
    orientation_wxyz=np.array([1.0, 0.0, 0.0, 0.0]),
    linear_velocity=np.array([1.0, 0.0, 0.0]),
    angular_velocity=np.array([0.0, 2.0, 0.0]),
)

MID_THROW = 0.4
"""A body this fast [m/s] is on its way to the release."""

SLOWED = 0.5
"""Rate at which there is time to hear and to stop what happens in half a second."""


@pytest.fixture
def thrower(graph: Graph) -> Iterator[Thrower]:
    made = Thrower(graph)
    yield made
    made.close()


@pytest.mark.slow
def test_a_throw_is_made_and_told_as_it_was_and_the_next_one_too(graph: Graph, thrower: Thrower) -> None:
    times: list[Clock] = []
    graph.listener.node.create_subscription(Clock, "/clock", times.append, profile(100, reliable=True, latched=False))
    graph.start("sim_arm", rate=0.0, clock=50.0, epoch=1000.0)
    assert "armed" in thrower.trigger("arm")
    for _ in range(2):
        goal = thrower.send(THROW)
        answer = thrower.ended(goal)
        assert answer.status == GoalStatus.STATUS_SUCCEEDED, graph.logs()
        assert answer.result.success
        executed = answer.result.executed
        assert (executed.throw_id, executed.body, executed.header.frame_id) == ("plain", "cube", "body_surface")
        assert abs(executed.release_twist.linear.x - 1.0) < 0.03
        assert abs(executed.release_twist.angular.y - 2.0) < 0.1
    assert goal.phases == ["planning", "moving", "throwing", "released"]
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in thrower.truth]
    assert np.allclose(np.diff(stamps), 1.0 / 148.0, atol=1e-6)
    assert 1000.0 <= stamps[0] < 1001.0
    released = executed.header.stamp.sec + 1e-9 * executed.header.stamp.nanosec
    flying = thrower.truth[int(np.abs(np.array(stamps) - released).argmin())]
    assert abs(flying.twist.twist.linear.x - executed.release_twist.linear.x) < 0.1
    assert {message.child_frame_id for message in thrower.truth} == {"body_cube"}
    told = [message.clock.sec + 1e-9 * message.clock.nanosec for message in times]
    assert told == sorted(told)
    assert told[-1] <= stamps[-1] + 1e-6


def test_what_cannot_be_thrown_is_refused_with_the_limit_and_what_could_be(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=0.0)

    def refused(change: dict[str, float] | None = None, **twist: float) -> str:
        message = throw_message(THROW, Stamped(0, "body_surface"))
        for name, value in twist.items():
            setattr(message.release_twist.linear if len(name) == 1 else message.release_twist.angular, name[-1], value)
        for name, value in (change or {}).items():
            setattr(message.release_pose.position, name, value)
        answer = thrower.ended(thrower.send(message))
        assert answer.status == GoalStatus.STATUS_ABORTED
        assert not answer.result.success
        assert "\n" not in answer.result.message
        return str(answer.result.message)

    assert "disarmed (it was never armed)" in refused()
    thrower.trigger("arm")
    assert "not finite" in refused(x=math.nan)
    assert "speed: found 50 m/s, expected at most 1.4" in refused(x=50.0)
    assert "release height: found 0.5 m" in refused({"z": 0.5})
    line = refused(x=0.5, wx=-7.0, wy=5.0, wz=-4.0)
    assert "joint" in line
    assert "the nearest feasible throw is from" in line
    assert not any(speed > 0.05 for speed in speeds(thrower.joints))


@pytest.mark.slow  # a starved heartbeat stops the arm, as it should: not for a machine that is busy with other tests
def test_of_two_goals_at_once_the_second_is_refused_and_the_first_is_made(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=0.0, armed=True)
    graph.until(lambda: thrower.ended(thrower.send(THROW)).result.success, LONG, "a throw of an arm that begins armed")
    first, second = thrower.send(THROW), thrower.send(THROW)
    assert "busy with throw plain" in thrower.ended(second).result.message
    assert thrower.ended(first).result.success


@pytest.mark.slow
def test_a_stop_in_mid_throw_latches_and_the_loop_goes_on_when_it_is_armed_again(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=SLOWED)
    thrower.trigger("arm")
    goal = thrower.send(THROW)
    thrower.until_body_moves(MID_THROW)
    thrower.trigger("stop")
    answer = thrower.ended(goal)
    assert "stopped before the release: the stop service was called" in answer.result.message
    assert not answer.result.executed.throw_id
    stood = len(thrower.joints)
    graph.until(lambda: len(thrower.joints) > stood + 30, LONG, "frames of an arm that stands")
    assert max(speeds(thrower.joints[stood + 5 :])) < 0.02
    assert "disarmed (the stop service was called)" in thrower.ended(thrower.send(THROW)).result.message
    thrower.trigger("arm")
    thrower.set_rate(0.0)
    graph.until(lambda: _tried(thrower), LONG, "a throw after the stop")


def _tried(thrower: Thrower) -> bool:
    return bool(thrower.ended(thrower.send(THROW)).result.success)


@pytest.mark.slow
def test_a_cancelled_goal_ends_at_home_and_armed(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=2.0)
    thrower.trigger("arm")
    goal = thrower.send(THROW)
    thrower.until_body_moves(0.05)
    goal.handle.cancel_goal_async()
    answer = thrower.ended(goal)
    assert answer.status == GoalStatus.STATUS_CANCELED
    assert "cancelled" in answer.result.message
    graph.until(lambda: _tried(thrower), LONG, "a throw after the cancelled one")


@pytest.mark.slow
def test_without_a_heartbeat_from_outside_the_arm_stops_within_half_a_second(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=1.0, armed=True, external_heartbeat=True)
    assert "disarmed (it was never armed)" in thrower.ended(thrower.send(THROW)).result.message
    thrower.trigger("arm")
    time.sleep(0.5)
    assert "disarmed (no heartbeat for" in thrower.ended(thrower.send(THROW)).result.message
    assert max(speeds(thrower.joints)) < 0.01


@pytest.mark.slow
def test_after_a_kill_in_mid_throw_the_arm_is_at_home_and_disarmed(graph: Graph, thrower: Thrower) -> None:
    process = graph.start("sim_arm", rate=SLOWED)
    thrower.trigger("arm")
    thrower.send(THROW)
    thrower.until_body_moves(MID_THROW)
    process.kill()
    thrower.joints.clear()
    graph.start("sim_arm", rate=0.0)
    graph.until(
        lambda: "disarmed (it was never armed)" in thrower.ended(thrower.send(THROW)).result.message, LONG, "a clean start"
    )
    thrower.trigger("arm")
    assert thrower.ended(thrower.send(THROW)).result.success
    assert speeds(thrower.joints[:1]) < [0.05]
