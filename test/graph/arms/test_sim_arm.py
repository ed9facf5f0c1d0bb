"""The simulated arm as a node: throws, refusals, stops, and what is left after a kill."""

import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from contact_curation_msgs.action import ExecuteThrow
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Empty

from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.ros.qos import profile
from contact_curation.simulation.arm.model import ArmConfig
from test.graph.parts.graph import Graph
from test.graph.parts.thrower import STILL, Goal, Thrower, speeds
from test.simulation.throws import PLAIN

MID_THROW = 0.3
"""A body this fast [m/s] is on its way to the release."""

SLOWED = 0.2
"""Rate at which there is time to hear and to stop what happens in half a second."""

LONG = 180.0
"""[s]"""

TRIES = 6
"""A busy machine may hear of the swing when it is over: then the stop comes late, which is tried again."""


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
        goal = thrower.send(PLAIN)
        answer = thrower.ended(goal)
        assert answer.status == GoalStatus.STATUS_SUCCEEDED, graph.logs()
        assert answer.result.success
        executed = answer.result.executed
        assert (executed.throw_id, executed.body, executed.header.frame_id) == ("plain", "cube", "body_surface")
        assert abs(executed.release_linear_velocity.x - 1.0) < 0.03
        assert abs(executed.release_body_angular_velocity.y - 2.0) < 0.1
    phases = ExecuteThrow.Feedback
    order = [phases.PLANNING, phases.MOVING, phases.THROWING, phases.RELEASED]
    assert goal.phases == [one for one in order if one in goal.phases]
    assert goal.phases[-1] == phases.RELEASED  # feedback comes faster here than a busy client may take it
    stamps = [seconds_of(message.header.stamp) for message in thrower.truth]
    assert np.allclose(np.diff(stamps), 1.0 / 148.0, atol=1e-6)
    assert 1000.0 <= stamps[0] < 1001.0
    released = seconds_of(executed.header.stamp)
    flying = thrower.truth[int(np.abs(np.array(stamps) - released).argmin())]
    assert abs(flying.twist.twist.linear.x - executed.release_linear_velocity.x) < 0.1
    assert {message.child_frame_id for message in thrower.truth} == {"body_cube"}
    told = [seconds_of(message.clock) for message in times]
    assert told == sorted(told)
    assert told[-1] <= stamps[-1] + 1e-6


def test_what_cannot_be_thrown_is_refused_with_the_limit_and_what_could_be(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=0.0)

    def refused(change: dict[str, float] | None = None, **twist: float) -> str:
        message = throw_message(PLAIN, Stamped(0, "body_surface"))
        for name, value in twist.items():
            part = message.release_linear_velocity if len(name) == 1 else message.release_body_angular_velocity
            setattr(part, name[-1], value)
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


@pytest.mark.slow
def test_a_stale_goal_and_one_for_another_board_are_refused_and_nothing_moves(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=0.0)
    thrower.trigger("arm")
    stale, elsewhere = Stamped(10**12, "body_surface"), Stamped(0, "camera")
    for header, line in ((stale, "stamp of the goal: found"), (elsewhere, "found camera, expected body_surface")):
        goal = thrower.send(throw_message(PLAIN, header))
        answer = thrower.ended(goal)
        assert answer.status == GoalStatus.STATUS_ABORTED
        assert line in answer.result.message
        assert goal.phases == []


@pytest.mark.slow
def test_of_two_goals_at_once_the_second_is_refused_and_the_first_is_made(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=1.0, armed=True)
    thrower.until_healthy("resting")
    first = thrower.send(PLAIN)
    second = thrower.send(PLAIN)
    assert "busy with throw plain" in thrower.ended(second).result.message
    thrower.set_rate(0.0)
    assert thrower.ended(first).result.success, thrower.ended(first).result.message


def stopped_in_mid_throw(thrower: Thrower, stop: Callable[[Goal], object]) -> Any:
    """Stops a throw in its swing, and gives the answer of its goal."""
    for _ in range(TRIES):
        thrower.set_rate(SLOWED)
        goal = thrower.send(PLAIN)
        thrower.until_body_moves(MID_THROW)
        stop(goal)
        answer = thrower.ended(goal)
        assert not answer.result.success
        thrower.set_rate(0.0)
        if "before the release" in answer.result.message:
            return answer
        thrower.trigger("arm")
        thrower.until_healthy("resting")
    raise AssertionError(f"no throw was stopped before its release: {answer.result.message}")


@pytest.mark.slow
def test_a_stop_in_mid_throw_latches_and_the_loop_goes_on_when_it_is_armed_again(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=0.0)
    thrower.trigger("arm")
    answer = stopped_in_mid_throw(thrower, lambda _: thrower.trigger("stop"))
    assert answer.status == GoalStatus.STATUS_ABORTED
    assert "stopped before the release: the stop service was called" in answer.result.message
    assert not answer.result.executed.throw_id
    thrower.until_healthy("disarmed: the stop service was called")
    stands = thrower.joints[-1].position
    assert "disarmed (the stop service was called)" in thrower.ended(thrower.send(PLAIN)).result.message
    thrower.set_rate(1.0)  # time goes on, the arm does not
    thrower.until_still(frames=60)
    np.testing.assert_allclose(thrower.joints[-1].position, stands, atol=0.02)
    thrower.trigger("arm")
    thrower.set_rate(0.0)
    thrower.until_healthy("resting")
    thrower.throws(PLAIN)


@pytest.mark.slow
def test_a_goal_that_is_cancelled_in_mid_throw_ends_at_home_and_armed(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=0.0)
    thrower.trigger("arm")
    answer = stopped_in_mid_throw(thrower, lambda goal: goal.handle.cancel_goal_async())
    assert answer.status == GoalStatus.STATUS_CANCELED
    assert "stopped before the release: cancelled" in answer.result.message
    thrower.until_healthy("resting")
    thrower.throws(PLAIN)


def moving(thrower: Thrower) -> Goal:
    """A goal that is under way. On a busy machine a heartbeat may be late, which stops the arm, as it must; then once more."""
    end = time.monotonic() + LONG
    while time.monotonic() < end:
        thrower.trigger("arm")
        goal = thrower.send(PLAIN)
        thrower.until_phase(goal, "moving", or_ended=True)
        if "moving" in goal.phases:
            return goal
        assert re.search("no heartbeat for|expected it at rest at home|armed again since", goal.answer.result.message)
    raise AssertionError("no throw was under way before its heartbeat was late")


@pytest.mark.slow
def test_without_a_heartbeat_from_outside_the_arm_stops_within_half_a_second(graph: Graph, thrower: Thrower) -> None:
    graph.start("sim_arm", rate=1.0, armed=True, external_heartbeat=True)
    assert "disarmed (it was never armed)" in thrower.ended(thrower.send(PLAIN)).result.message  # `armed` needs a heartbeat
    beats = graph.listener.node.create_publisher(Empty, "/sim_arm/heartbeat", profile(1, reliable=True, latched=False))
    timer = graph.listener.node.create_timer(0.05, lambda: beats.publish(Empty()))
    thrower.until_healthy("resting", "disarmed: no heartbeat for")  # armed by the first, perhaps until a late one
    goal = moving(thrower)
    timer.cancel()
    message = str(thrower.ended(goal).result.message)
    found = re.search(r"stopped (?:before|after) the release: no heartbeat for (\d\.\d+) s", message)
    assert found is not None, message
    assert float(found[1]) < 0.5
    thrower.until_healthy("disarmed: no heartbeat for")
    thrower.until_still(frames=60)
    timer.reset()  # who beats again does not arm
    thrower.until_healthy("disarmed: no heartbeat for")
    assert "disarmed (no heartbeat for" in thrower.ended(thrower.send(PLAIN)).result.message
    thrower.set_rate(0.0)
    while not (answer := thrower.ended(moving(thrower)).result).success:
        assert "no heartbeat for" in answer.message


@pytest.mark.slow
def test_a_process_that_stood_still_has_missed_no_heartbeat_and_goes_on(graph: Graph, thrower: Thrower) -> None:
    process = graph.start("sim_arm", rate=1.0)
    thrower.trigger("arm")
    goal = thrower.send(PLAIN)
    thrower.until_phase(goal, "moving")
    os.kill(process.pid, signal.SIGSTOP)
    seen = -1
    while seen != len(thrower.joints):  # what it had said has arrived
        seen = len(thrower.joints)
        time.sleep(1.0)
    os.kill(process.pid, signal.SIGCONT)
    assert thrower.ended(goal).result.success, thrower.ended(goal).result.message


@pytest.mark.slow
def test_a_designer_that_dies_in_mid_goal_leaves_an_arm_that_ends_at_home_and_takes_the_next_throw(
    graph: Graph, thrower: Thrower
) -> None:
    graph.start("sim_arm", rate=SLOWED, armed=True)
    thrower.until_healthy("resting")
    designer = subprocess.Popen(
        [sys.executable, "-m", "test.graph.parts.lone_designer"], env={**os.environ, "ROS_DOMAIN_ID": str(graph.domain)}
    )
    thrower.until_body_moves(MID_THROW)
    designer.kill()
    designer.wait()
    assert "busy with throw plain" in thrower.ended(thrower.send(PLAIN)).result.message
    thrower.set_rate(0.0)
    thrower.until_healthy("resting")
    assert max(speeds(thrower.joints[-1:])) < STILL
    thrower.throws(PLAIN)


@pytest.mark.slow
def test_after_a_kill_in_mid_throw_the_arm_is_at_home_and_disarmed_and_time_goes_on_behind(
    graph: Graph, thrower: Thrower
) -> None:
    times: list[Clock] = []
    graph.listener.node.create_subscription(Clock, "/clock", times.append, profile(1000, reliable=True, latched=False))
    settings: dict[str, Any] = {"epoch": 1000.0, "clock": 148.0, "state": graph.folder / "time.json"}
    process = graph.start("sim_arm", rate=SLOWED, **settings)
    thrower.trigger("arm")
    thrower.send(PLAIN)
    thrower.until_body_moves(MID_THROW)
    process.kill()
    graph.start("sim_arm", rate=1.0, **settings)
    thrower.until_healthy("disarmed: it was never armed")
    thrower.until_still(frames=30)
    assert "disarmed (it was never armed)" in thrower.ended(thrower.send(PLAIN)).result.message
    thrower.trigger("arm")
    thrower.set_rate(0.0)
    thrower.throws(PLAIN)
    stamps = [[seconds_of(message.header.stamp) for message in heard] for heard in (thrower.joints, thrower.truth)]
    for heard in (*stamps, [seconds_of(message.clock) for message in times]):
        rises = np.diff(heard)
        assert rises.min() >= 0.0
        assert np.sum(rises > 1.0) == 1  # the jump over what was reserved
        assert rises.max() < 120.0  # 60 s, and what the new process says before it is discovered
    first = int(np.argmax(np.diff(stamps[0]))) + 1  # of the second process
    assert max(speeds(thrower.joints[first : first + 30])) < STILL
    np.testing.assert_allclose(thrower.joints[first].position, ArmConfig().home, atol=0.01)


def seconds_of(stamp: Any) -> float:
    return float(stamp.sec + 1e-9 * stamp.nanosec)
