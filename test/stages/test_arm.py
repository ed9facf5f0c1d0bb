"""What sim_arm does with goals, stops and cancels, frame by frame and without threads: each ends safe, and the loop goes on."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.simulation.arm.feasibility import ArmFeasibility
from contact_curation.simulation.arm.frame import ArmFrame, Phase
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.simulation.arm.simulation import ControlConfig
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD, ThrowPlanner
from contact_curation.stages.arm import ArmStage, Ending
from test.simulation.throws import PLAIN

LONGEST = 40.0
"""Simulated seconds in which everything is over."""


@pytest.fixture(scope="module")
def feasibility() -> ArmFeasibility:
    return ArmFeasibility(ThrowPlanner(CONTACTNETS_CUBE), GateConfig())


class Run:
    """A stage with a watch that goes with simulated time."""

    def __init__(self, feasibility: ArmFeasibility) -> None:
        self.gate = SafetyGate(GateConfig())
        self.stage = ArmStage(feasibility, self.gate, ControlConfig(), seed=0)
        self.now = 0.0
        self.frames: list[ArmFrame] = []
        self.beating = True

    def arm(self) -> None:
        self.gate.arm(self.now)

    def advance(self) -> Ending | None:
        self.now += FRAME_PERIOD
        if self.beating:
            self.gate.heartbeat(self.now)
        frame, ending = self.stage.advance(self.now)
        self.frames.append(frame)
        return ending

    def until(self, true: Callable[[], bool]) -> Ending | None:
        """Frames until something is true; what ended meanwhile."""
        ended = None
        while not true():
            ended = self.advance() or ended
            assert self.now < LONGEST
        return ended

    def until_phase(self, phase: Phase) -> Ending | None:
        return self.until(lambda: self.stage.phase is phase)

    def begin(self) -> None:
        assert self.stage.admits(PLAIN, self.now) is None
        assert self.stage.begin() is None

    def throws(self) -> Ending:
        """Throws, and gives what became of it."""
        self.begin()
        self.advance()
        ending = self.until_phase(Phase.RESTING)
        assert ending is not None
        return ending


@pytest.fixture
def run(feasibility: ArmFeasibility) -> Run:
    return Run(feasibility)


def test_a_throw_is_made_and_told_as_it_was(run: Run) -> None:
    run.arm()
    ending = run.throws()
    assert (ending.success, ending.message) == (True, "thrown")
    assert ending.executed is not None
    np.testing.assert_allclose(ending.executed.linear_velocity, PLAIN.linear_velocity, atol=0.03)
    free = next(frame for frame in run.frames if frame.free)
    assert 0.0 < free.time - ending.released_at < FRAME_PERIOD  # the gripper opens between two frames
    flown = ending.executed.position + (free.time - ending.released_at) * ending.executed.linear_velocity
    np.testing.assert_allclose(free.body[:2], flown[:2], atol=1e-6)


def test_the_same_throw_is_made_in_the_same_way_whatever_was_thrown_before_and_another_one_is_not(run: Run) -> None:
    run.arm()
    other = replace(PLAIN, throw_id="other")
    flights = []
    for throw in (PLAIN, other, PLAIN):
        first = len(run.frames)
        assert run.stage.admits(throw, run.now) is None
        assert run.stage.begin() is None
        run.advance()
        run.until_phase(Phase.RESTING)
        flights.append(np.array([frame.body for frame in run.frames[first:] if frame.free]))
    np.testing.assert_array_equal(flights[0], flights[2])
    assert not np.array_equal(flights[0][0], flights[1][0])  # the gripper opens at another time


def test_a_goal_that_is_taken_between_two_frames_waits_for_its_beginning_and_not_for_its_end(run: Run) -> None:
    run.arm()
    assert run.stage.admits(PLAIN, run.now) is None
    waited = [(run.advance(), run.stage.waits) for _ in range(5)]
    assert waited == [(None, True)] * 5
    assert run.stage.begin() is None
    assert run.until(lambda: not run.stage.busy) is not None


def test_of_two_goals_at_once_the_second_is_refused_and_the_first_is_made(run: Run) -> None:
    run.arm()
    run.begin()
    assert run.stage.admits(replace(PLAIN, throw_id="second"), run.now) == "busy with throw plain, expected one goal at a time"
    run.advance()
    ending = run.until_phase(Phase.RESTING)
    assert ending is not None
    assert ending.success


@pytest.mark.parametrize("when", [Phase.MOVING, Phase.THROWING, Phase.RELEASED])
def test_a_stop_ends_the_goal_latches_and_the_loop_goes_on_when_it_is_armed_again(run: Run, when: Phase) -> None:
    run.arm()
    run.begin()
    run.until_phase(when)
    run.gate.stop("the stop service was called")
    ending = run.until_phase(Phase.STOPPED)
    assert ending is not None
    assert not ending.success
    assert (
        ending.message == f"stopped {'after' if when is Phase.RELEASED else 'before'} the release: the stop service was called"
    )
    assert (ending.executed is None) == (when is not Phase.RELEASED)
    stood = len(run.frames) + 15
    for _ in range(200):
        assert run.advance() is None
    assert max(np.abs(frame.speeds).max() for frame in run.frames[stood:]) < 0.02
    assert run.stage.phase is Phase.STOPPED
    assert "disarmed (the stop service was called)" in str(run.stage.admits(PLAIN, run.now))
    run.arm()
    assert run.until_phase(Phase.RESTING) is None  # nothing that waited resumes
    run.begin()


def test_a_stop_before_a_goal_begins_keeps_it_from_beginning(run: Run) -> None:
    run.arm()
    assert run.stage.admits(PLAIN, run.now) is None
    run.gate.stop("the stop service was called")
    ending = run.stage.begin()
    assert ending is not None
    assert ending.message == "stopped before it began: the stop service was called"
    run.arm()
    run.until_phase(Phase.RESTING)
    run.begin()


def test_a_heartbeat_that_fails_stops_the_arm_within_half_a_second(run: Run) -> None:
    run.arm()
    run.begin()
    run.until_phase(Phase.MOVING)
    failed = run.now
    run.beating = False
    run.until_phase(Phase.STOPPING)
    assert run.now - failed < 0.5
    ending = run.until_phase(Phase.STOPPED)
    assert ending is not None
    assert "no heartbeat for 0.4" in ending.message
    run.beating = True
    for _ in range(50):
        run.advance()
    assert run.stage.phase is Phase.STOPPED  # it latches
    run.arm()
    run.until_phase(Phase.RESTING)
    run.begin()


def test_a_cancelled_goal_ends_and_the_arm_goes_home_by_itself(run: Run) -> None:
    run.arm()
    run.begin()
    run.until_phase(Phase.MOVING)
    run.stage.cancel()
    ending = run.until_phase(Phase.RETURNING)
    assert ending is not None
    assert ending.message == "stopped before the release: cancelled"
    run.until_phase(Phase.RESTING)
    run.begin()


def test_what_is_not_finite_or_too_fast_never_begins(run: Run) -> None:
    run.arm()
    assert "speed: found 50 m/s" in str(run.stage.admits(replace(PLAIN, linear_velocity=np.array([50.0, 0.0, 0.0])), run.now))
    assert "speed: found 1.41" in str(run.stage.admits(replace(PLAIN, linear_velocity=np.array([1.41, 0.0, 0.0])), run.now))
    assert not run.stage.busy
