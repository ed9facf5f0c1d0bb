"""A throw by trajectory: the gripper opens at its moment, the tracker's release is told, and every fault ends safely."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.design.release_delay import Seen
from contact_curation.errors import InvalidValueError
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.throw_motion import STEP
from contact_curation.stages.arm import Ending
from contact_curation.stages.joint_gains import JointGains
from contact_curation.stages.records import GripperRecord, record_bytes, record_of
from contact_curation.stages.trajectory_throw import Sent, TrajectoryConfig
from test.stages.trajectory_cell import JOINTS, LIMITS, RELEASE, THROW, VELOCITY, Cell

LEARNED = GripperRecord(tuple(Seen(0.05 + 0.001 * (-1) ** k, 5e-4) for k in range(8)), 0.02)


def speed_of(ending: Ending) -> float:
    assert ending.executed is not None, ending.message
    return float(np.linalg.norm(ending.executed.linear_velocity))


def first_sent(cell: Cell) -> JointPath:
    assert cell.stage.admits(THROW) is None
    began = cell.stage.begin()
    assert isinstance(began, Sent)
    return began.path


def test_the_body_leaves_at_the_planned_moment_once_the_delay_is_known() -> None:
    cell = Cell(record=LEARNED)
    planned = cell.now + cell.stage.config.lead + RELEASE + cell.lag
    ending = cell.throw()
    assert ending.success, ending.message
    assert ending.executed is not None
    assert ending.released_at == pytest.approx(cell.fell, abs=0.002)
    assert ending.released_at == pytest.approx(planned, abs=0.006)
    np.testing.assert_allclose(ending.executed.linear_velocity, VELOCITY, atol=0.02)
    assert ending.executed.throw_id == "one"


def test_lag_and_delay_are_learned_from_nothing_and_outlive_a_restart() -> None:
    cell = Cell(lag=0.03)
    endings = [cell.throw() for _ in range(3)]
    assert [one.success for one in endings] == [True] * 3, endings
    assert cell.stage.lag == pytest.approx(0.03, abs=0.002)
    assert cell.stage.delay.mean == pytest.approx(0.05, abs=0.004)
    again = Cell(record=record_of(GripperRecord, record_bytes(cell.stage.record), "test"))
    assert again.stage.delay == cell.stage.delay
    assert again.stage.lag == cell.stage.lag


def test_a_changed_delay_is_noticed_within_three_throws() -> None:
    cell = Cell(record=LEARNED)
    cell.delay = 0.085
    messages = [cell.throw().message for _ in range(3)]
    assert any("the gripper's delay changed from 50 to 8" in line for line in messages), messages


def test_a_gripper_that_jitters_beyond_the_window_is_refused_once_that_is_known() -> None:
    wild = GripperRecord(tuple(Seen(0.05 + 0.03 * (-1) ** k, 5e-4) for k in range(8)))
    cell = Cell(record=wild)
    line = cell.throw().message
    assert line.startswith("jitter of the gripper: found at least 2")
    assert "expected at most 15.0 ms; raise steady.window" in line
    assert not cell.sent


def test_few_throws_of_a_gripper_that_jitters_do_not_lock_the_arm() -> None:
    few = GripperRecord(tuple(Seen(0.05 + 0.02 * (-1) ** k, 5e-4) for k in range(4)))
    assert Cell(record=few).throw().success


def test_joints_that_go_too_far_are_told_to_go_less_far_from_the_second_throw_on_and_after_a_restart() -> None:
    cell = Cell(record=LEARNED)
    cell.gain = 1.02
    speeds = [speed_of(cell.throw()) for _ in range(3)]
    again = Cell(record=record_of(GripperRecord, record_bytes(cell.stage.record), "test"))
    again.gain = 1.02
    speeds.append(speed_of(again.throw()))
    np.testing.assert_allclose(speeds, np.linalg.norm(VELOCITY) * np.array([1.02, 1.0, 1.0, 1.0]), rtol=4e-3)
    assert cell.stage.record.joints.gains[0] == pytest.approx(1.02, abs=2e-3)
    np.testing.assert_allclose(cell.stage.record.joints.gains[1:], 1.0)


@pytest.mark.parametrize(
    ("gains", "weights"), [((0.0,), (1.0,)), ((float("nan"),), (1.0,)), ((1.0, 1.0), (1.0,)), ((1.0,), (-1.0,))]
)
def test_gains_that_cannot_be_are_refused(gains: tuple[float, ...], weights: tuple[float, ...]) -> None:
    with pytest.raises(InvalidValueError, match="gains"):
        JointGains(gains, weights)


@pytest.mark.parametrize("lag", [-0.1, float("nan"), float("inf")])
def test_a_lag_that_cannot_be_is_refused(lag: float) -> None:
    with pytest.raises(InvalidValueError, match="lag of an arm"):
        GripperRecord(lag=lag)


def test_a_correction_that_would_pass_a_limit_is_not_made() -> None:
    short = replace(LEARNED, joints=JointGains((0.96,) * JOINTS, (1e3,) * JOINTS))
    fastest = np.abs(first_sent(Cell(record=LEARNED)).speeds).max()
    for limit, share in ((fastest / 0.95, 1.0 / 0.96), (fastest / 0.97, 1.0)):
        cell = Cell(record=short, limits=replace(LIMITS, speed=limit * np.ones(JOINTS)))
        assert np.abs(first_sent(cell).speeds).max() == pytest.approx(share * fastest)


def silent(cell: Cell) -> None:
    cell.silent = True


def slower(cell: Cell) -> None:
    cell.slider = 0.8


def inactive(cell: Cell) -> None:
    cell.active = False


def astray(cell: Cell) -> None:
    cell.off = 0.1


def aborting(cell: Cell) -> None:
    cell.aborts = "path tolerance violated"


def set_back(cell: Cell) -> None:
    cell.now -= 50.0


def stopped_by_hand(cell: Cell) -> None:
    cell.gate.stop("the stop service was called")


REFUSED: dict[Callable[[Cell], None], str] = {
    silent: "joint states: found the last one",
    slower: "speed scaling: found 80 %, expected 100 %",
    inactive: "controller: found no state of it",
    astray: "joint 2: found it 0.100 rad from home",
    stopped_by_hand: "the arm is disarmed (the stop service was called)",
}


@pytest.mark.parametrize("fault", REFUSED)
def test_a_fault_before_the_throw_is_refused_and_nothing_is_sent(fault: Callable[[Cell], None]) -> None:
    cell = Cell(record=LEARNED)
    fault(cell)
    for _ in range(200):
        cell.tick()
    ending = cell.throw()
    assert not ending.success
    assert ending.message.startswith(REFUSED[fault])
    assert not cell.sent


STOPS: dict[Callable[[Cell], None], str] = {
    silent: "joint states: found the last one",
    slower: "speed scaling: found 80 %, expected 100 %",
    inactive: "controller: found no state of it",
    astray: "joint 2: found it 0.100 rad from its path",
    aborting: "the controller gave up: path tolerance violated",
    stopped_by_hand: "the stop service was called",
    set_back: "the clock was set back by at least 49.",
}


@pytest.mark.parametrize("fault", STOPS)
def test_a_fault_in_the_swing_stops_the_arm_latches_and_never_opens_the_gripper(fault: Callable[[Cell], None]) -> None:
    cell = Cell(record=LEARNED, config=TrajectoryConfig(oldest_state=0.05, oldest_signal=0.05))
    trajectories: list[int] = []

    def meanwhile() -> None:
        if cell.sent and cell.elapsed > 0.2:
            fault(cell)
        trajectories.append(len(cell.sent))

    ending = cell.throw(meanwhile)
    assert not ending.success
    assert ending.message.startswith(f"stopped before the release: {STOPS[fault]}"), ending.message
    assert ending.executed is None
    assert cell.opened is None
    assert max(trajectories) == (1 if fault is aborting else 2)
    assert "disarmed" in str(cell.stage.admits(THROW)) or cell.stage.signals.missing()
    assert cell.gate.arming == 0


def test_a_stop_stays_on_the_path_and_within_the_limits() -> None:
    cell = Cell(record=LEARNED)
    sent: list[Sent] = []

    def meanwhile() -> None:
        if cell.sent and cell.elapsed > 0.38:
            stopped_by_hand(cell)
        sent[:] = cell.sent

    cell.throw(meanwhile)
    whole, stop = sent
    row = round((stop.begin - whole.begin) / STEP)
    np.testing.assert_allclose(stop.path.positions[0], whole.path.positions[row], atol=2e-3)
    assert (np.abs(stop.path.accelerations) <= LIMITS.acceleration).all()
    assert not stop.path.speeds[-1].any()
    assert (np.diff(stop.path.positions[:, 0]) >= -1e-9).all()
    steps = np.gradient(stop.path.positions, STEP, axis=0)
    np.testing.assert_allclose(steps[1:-1], stop.path.speeds[1:-1], atol=0.02)


def stop_in_the_swing(cell: Cell) -> None:
    """After a stop the arm stands away from home, and is armed again."""
    ending = cell.throw(lambda: stopped_by_hand(cell) if cell.sent and cell.elapsed > 0.38 else None)
    assert "the stop service was called" in ending.message
    assert cell.joints[0] > 0.05
    for _ in range(40):
        cell.tick()


def test_after_a_stop_the_arm_goes_home_when_it_is_armed_again_and_throws() -> None:
    cell = Cell(record=LEARNED)
    stop_in_the_swing(cell)
    assert "the arm is disarmed (the stop service was called)" in cell.go_home().message
    cell.gate.arm(cell.now)
    assert "bring the arm home, by hand or by ~/home" in cell.throw().message
    assert cell.go_home() == (True, "at home", None, 0.0)
    assert abs(cell.joints[0]) < 1e-3
    assert cell.throw().success


def test_a_fault_on_the_way_home_stops_the_arm_and_latches() -> None:
    cell = Cell(record=LEARNED)
    stop_in_the_swing(cell)
    cell.gate.arm(cell.now)
    assert cell.stage.admits_homeward() is None
    assert cell.stage.admits(THROW) == "the arm is on its way home, expected one goal at a time; wait until it is there"
    began = cell.stage.begin_homeward()
    assert isinstance(began, Sent)
    cell.sent, ending = [began], None
    while ending is None:
        cell.aborts = "path tolerance violated" if cell.elapsed > 0.1 else ""
        ending = cell.tick()
    assert ending.message == "stopped on the way home: the controller gave up: path tolerance violated"
    assert not cell.gate.arming


def test_the_way_home_is_refused_while_the_arm_moves_and_may_be_cancelled() -> None:
    cell = Cell(record=LEARNED)
    stop_in_the_swing(cell)
    cell.gate.arm(cell.now)
    for pushed in (0.0, 0.01):
        cell.stage.signals.joints_seen(cell.now + pushed, cell.joints + pushed)
    assert str(cell.stage.admits_homeward()).startswith("joint 1: found it moving at 0.10 rad/s, expected the arm at rest")
    for _ in range(40):
        cell.tick()
    assert cell.stage.admits_homeward() is None
    began = cell.stage.begin_homeward()
    assert isinstance(began, Sent)
    cell.sent = [began]
    step = cell.stage.cancel("the node has ended")
    assert step.stop is not None
    assert not step.stop.path.speeds[-1].any()
    assert cell.gate.arming


def test_a_stop_that_the_controller_does_not_follow_is_told() -> None:
    cell = Cell(record=LEARNED)

    def reject_the_stop() -> None:
        if cell.sent and cell.elapsed > 0.2:
            stopped_by_hand(cell)
        cell.aborts = "it rejected the trajectory" if len(cell.sent) > 1 else ""

    line = (
        "stopped before the release: the stop service was called; the controller did not follow the stop: it rejected the traj"
    )
    assert cell.throw(reject_the_stop).message.startswith(line)
    deaf = Cell(record=LEARNED)

    def never_end_it() -> None:
        if deaf.sent and deaf.elapsed > 0.2:
            stopped_by_hand(deaf)
            deaf.lag = 9.0

    assert deaf.throw(never_end_it).message.endswith("3 s after the stop, the arm may still move")


def test_a_throw_waits_for_the_body_in_the_gripper_and_gives_up_with_what_it_found() -> None:
    cell, far = Cell(config=TrajectoryConfig(grip_patience=4.0), record=LEARNED), np.array([0.0, 0.1, 0.0])
    cell.misplaced = far
    waited_from = cell.now

    def put_in() -> None:
        cell.misplaced = far if cell.now < waited_from + 2.0 else np.zeros(3)

    ending = cell.throw(put_in)
    assert ending.success, ending.message
    cell.misplaced = far
    ending = cell.throw()
    assert ending.message.startswith("body: found it 100 mm and 0.00 rad from where the throw holds it, expected at most 20 mm")
    assert not cell.sent


def test_a_goal_that_is_cancelled_while_it_waits_for_the_body_ends_at_once() -> None:
    cell = Cell(record=LEARNED)
    cell.misplaced = np.array([0.0, 0.1, 0.0])
    cell.tick()
    assert cell.stage.admits(THROW) is None
    assert cell.stage.begin() is None
    step = cell.stage.cancel()
    assert step.ending is not None
    assert step.ending.message == "cancelled before it began"
    assert not cell.stage.busy


def test_a_cancel_stops_and_the_gate_stays_armed() -> None:
    cell = Cell(record=LEARNED)

    def meanwhile() -> None:
        if cell.sent and 0.2 < cell.elapsed < 0.21:
            step = cell.stage.cancel()
            cell.sent += [step.stop] if step.stop else []

    ending = cell.throw(meanwhile)
    assert ending.message == "stopped before the release: cancelled"
    assert cell.opened is None
    assert cell.gate.arming


def test_a_plan_that_leads_through_the_stand_and_a_second_goal_are_refused() -> None:
    cell = Cell(record=LEARNED)
    ending = cell.throw(throw=replace(THROW, throw_id="through the stand"))
    assert "obstacle 1" in ending.message
    assert cell.stage.admits(THROW) is None
    assert cell.stage.admits(THROW) == "busy with throw one, expected one goal at a time; wait for its end"


def test_a_gripper_that_does_not_open_makes_no_throw() -> None:
    cell = Cell(record=LEARNED)
    cell.delay = 1e9
    ending = cell.throw()
    assert not ending.success
    assert "no fall found" in ending.message
    failed = cell.throw(lambda: cell.stage.gripper_failed("no air") if cell.opened else None)
    assert failed.message.endswith("; the gripper said: no air")
    assert cell.stage.record.seen == LEARNED.seen


def test_stamps_ahead_of_the_clock_and_numbers_that_are_none_keep_the_arm_from_moving() -> None:
    cell = Cell()
    cell.now -= 5.0
    lines = cell.stage.signals.missing()
    assert [line.split(",")[0] for line in (lines[0], lines[-1])] == [
        "joint states: found the last one 5.00 s ahead of the clock",
        "tracker: found the last pose of the body 5.00 s ahead of the clock",
    ]
    unclear = Cell()
    unclear.stage.signals.scaling_seen(float("nan"))
    assert "speed scaling: found nan %" in unclear.stage.signals.missing()[0]
    unclear.stage.signals.scaling_seen(1.0)
    for _ in range(40):
        unclear.now += 0.004
        unclear.stage.signals.controller_seen()
        unclear.stage.signals.scaling_seen(1.0)
        unclear.stage.signals.joints_seen(unclear.now, np.full(JOINTS, np.nan))
    assert unclear.stage.signals.missing()[0].startswith("joint states: found the last one 0.16 s old")


def test_one_stamp_ahead_of_the_clock_keeps_no_sound_signals_out() -> None:
    cell = Cell(record=LEARNED)

    def stray() -> None:
        cell.stage.signals.joints_seen(cell.now + 86400.0, cell.joints)
        cell.stage.signals.body_seen(cell.now + 86400.0, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))

    stray()
    assert not cell.stage.signals.missing()
    assert cell.throw(stray).success
    cell.now += 10.0
    stray()
    lines = cell.stage.signals.missing()
    assert lines[0].startswith("joint states: found the last one 86400.00 s ahead of the clock"), lines
    assert lines[-1].startswith("tracker: found the last pose of the body 86400.00 s ahead of the clock")
    for _ in range(2):
        cell.tick()
    assert not cell.stage.signals.missing()


def test_signals_count_again_as_soon_as_they_come_after_the_clock_was_set_back() -> None:
    cell = Cell(record=LEARNED)
    cell.now -= 50.0
    assert [line.split(":")[0] for line in cell.stage.signals.missing()][1:3] == ["controller", "speed scaling"]
    for _ in range(2):
        cell.tick()
    assert not cell.stage.signals.missing()
    assert cell.throw().success
    cell.now -= 1000.0
    for _ in range(2):
        cell.tick()
    assert cell.throw().success


def test_what_is_missing_is_said_line_by_line_and_nothing_moves() -> None:
    cell = Cell()
    assert not cell.stage.signals.missing()
    cell.now += 10.0
    lines = cell.stage.signals.missing()
    assert [line.split(":")[0] for line in lines] == ["joint states", "controller", "speed scaling", "tracker"]
    assert not cell.sent
    assert len(cell.joints) == JOINTS
