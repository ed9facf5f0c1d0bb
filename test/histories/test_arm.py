"""Goals, cancels, stops, failing heartbeats and pauses, in any order: no sample outside the limits, and a stop latches.

Every sample counts: those that are published once per frame, and the controller's reference at each of its steps. ARM_HISTORIES
says how many histories; a frame takes about a millisecond, and a history has hundreds.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.feasibility import ArmFeasibility
from contact_curation.simulation.arm.frame import ArmFrame, Phase
from contact_curation.simulation.arm.limits import FR3_LIMITS
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.simulation.arm.simulation import ArmSimulation, ControlConfig
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD, STEP, ThrowPlanner
from contact_curation.stages.arm import ArmStage, Ending
from test.histories.history import Histories, try_histories
from test.simulation.throws import PLAIN, random_throws

THROWS = [PLAIN, *random_throws(4, seed=3), replace(PLAIN, linear_velocity=np.array([30.0, 0.0, 0.0]))]
CORRECTED = 1.05
"""The controller may correct what the reference does by this share of a limit, as a published sample shows it."""
LARGEST_JERK = 5000.0
"""Of a Franka Research 3 [rad/s^3] (libfranka, kMaxJointJerk)."""
STILL = 0.02
"""A stopped arm is slower than this [rad/s]."""
LONGEST = 60.0
"""Simulated seconds in which an arm that nobody disturbs is at home."""


class Reference(ArmSimulation):
    """The simulation, whose controller's reference is checked at each step; its largest acceleration is remembered."""

    asked = 0.0

    def _step(self) -> None:
        before = self._reference(self._at, self._rate)[1]
        super()._step()
        posture, speed = self._reference(self._at, self._rate)
        Reference.asked = max(Reference.asked, float((np.abs(speed - before) / STEP / FR3_LIMITS.acceleration).max()))
        assert (posture >= FR3_LIMITS.lowest).all()
        assert (posture <= FR3_LIMITS.highest).all()
        assert FR3_LIMITS.speed_use(posture, speed).max() <= 1.0 + 1e-9


class Arm:
    """A stage, its gate and a watch; every frame is looked at."""

    def __init__(self, feasibility: ArmFeasibility) -> None:
        self.gate = SafetyGate(GateConfig())
        self.stage = ArmStage(feasibility, self.gate, ControlConfig(), seed=0)
        self.now = 0.0
        self.beating, self.latched = True, True
        self.under_way = 0
        self.endings: list[Ending] = []
        self._last: list[ArmFrame] = []
        self._stood = 0

    def go_on(self, frames: int) -> None:
        for _ in range(frames):
            self.advance()

    def go_on_into(self, phase: Phase, frames: int) -> None:
        """Until something new begins, and a little more."""
        while self.stage.busy and self.stage.phase not in (phase, Phase.STOPPED) and not self.stage.waits:
            self.advance()
        self.go_on(frames)

    def advance(self) -> None:
        self.now += FRAME_PERIOD
        if self.beating:
            self.gate.heartbeat(self.now)
        frame, ending = self.stage.advance(self.now)
        self._took(ending)
        self._check(frame)

    def goal(self, number: int, begins: bool) -> None:
        if self.stage.admits(THROWS[number], self.now) is None:
            assert not self.latched
            self.under_way += 1
            assert self.under_way == 1
            if begins:
                self.begin()

    def begin(self) -> None:
        if self.stage.waits:
            self._took(self.stage.begin())

    def stop(self) -> None:
        self.gate.stop("somebody stopped it")
        self.latched = True

    def arm(self) -> None:
        self.gate.arm(self.now)
        self.latched = False

    def arm_and_throw(self, number: int) -> None:
        self.arm()
        self.goal(number, begins=True)

    def cancel(self) -> None:
        self.stage.cancel()

    def heartbeat(self, beating: bool) -> None:
        self.beating = beating

    def hush(self, seconds: float) -> None:
        """Real time goes on while the simulation waits, and no heartbeat comes."""
        if not self.beating:
            self.now += seconds

    def finish(self) -> None:
        """Armed, and with a heartbeat, it goes home; every goal that was taken has ended."""
        until = self.now + LONGEST
        self.beating = True
        self.begin()
        self.gate.heartbeat(self.now)
        self.arm()
        while self.stage.phase is not Phase.RESTING or self.under_way:
            self.advance()
            assert self.now < until, f"the arm is {self.stage.phase}"

    def _took(self, ending: Ending | None) -> None:
        if ending is not None:
            self.endings.append(ending)
            self.under_way -= 1
            assert self.under_way == 0, "an ending without a goal"

    def _check(self, frame: ArmFrame) -> None:
        if not self.gate.arming:
            self.latched = True
        self._last = [*self._last[-2:], frame]
        assert (frame.joints >= FR3_LIMITS.lowest).all()
        assert (frame.joints <= FR3_LIMITS.highest).all()
        assert FR3_LIMITS.speed_use(frame.joints, np.where(np.abs(frame.speeds) < STILL, 0.0, frame.speeds)).max() <= 1.0
        assert (np.abs(frame.torques) <= FR3_LIMITS.torque).all()
        accelerations = _changes([one.speeds for one in self._last])
        assert (np.abs(accelerations) <= CORRECTED * FR3_LIMITS.acceleration).all()
        assert (np.abs(_changes(list(accelerations))) <= LARGEST_JERK).all()
        self._check_latch(frame)

    def _check_latch(self, frame: ArmFrame) -> None:
        """Disarmed it brakes, stands, and does nothing else until it is armed."""
        if not self.latched:
            self._stood = 0
            return
        assert frame.phase in (Phase.STOPPING, Phase.STOPPED)
        self._stood = self._stood + 1 if frame.phase is Phase.STOPPED else 0
        if self._stood > 20:
            assert np.abs(frame.speeds).max() < STILL


def _changes(values: list[Array]) -> Array:
    """(N - 1, 7) per second."""
    return np.diff(np.array(values).reshape(-1, 7), axis=0) / FRAME_PERIOD


GOALS = range(len(THROWS))
STEPS = (
    ("go_on", range(1, 121)),
    ("go_on_into", (Phase.THROWING, Phase.RELEASED, Phase.RETURNING), range(31)),
    ("goal", GOALS, (False, True)),
    ("arm_and_throw", GOALS),
    ("begin",),
    ("cancel",),
    ("stop",),
    ("arm",),
    ("heartbeat", (False, True)),
    ("hush", (0.3, 0.5, 5.0)),
)


@pytest.fixture(scope="module")
def watched(planner: ThrowPlanner) -> Iterator[ArmFeasibility]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("contact_curation.stages.arm.ArmSimulation", Reference)
        yield ArmFeasibility(planner, GateConfig())


def test_no_sample_is_ever_outside_the_limits_and_a_stop_latches(watched: ArmFeasibility) -> None:
    @contextmanager
    def fresh() -> Iterator[Arm]:
        yield Arm(watched)

    Reference.asked = 0.0
    try_histories(Histories(fresh, (), STEPS, length=14), "ARM_HISTORIES", 8)
    assert 0.3 < Reference.asked <= 1.0
