"""The gate: deny by default, limits from both sides, a watchdog that latches, and nothing that resumes by itself."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.simulation.arm.limits import FR3_LIMITS
from contact_curation.simulation.arm.path import DEFAULT_RAMP, JointPath, moving
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate, out_of_limits, path_out_of_limits
from test.simulation.throws import PLAIN

X, Z = np.eye(3)[0], np.eye(3)[2]
HOME = np.array([0.0, -0.6, 0.0, -1.9, 0.0, 1.3, 0.785])


def test_a_gate_that_nobody_armed_admits_nothing() -> None:
    gate = SafetyGate(GateConfig())
    assert "disarmed (it was never armed)" in str(gate.admits(PLAIN, 0.0))
    assert not gate.watch(0.0)


def test_a_stop_latches_until_the_next_arming_which_has_another_number() -> None:
    gate = SafetyGate(GateConfig())
    first = gate.arm(0.0)
    assert gate.arm(0.05) == first
    assert gate.admits(PLAIN, 0.1) is None
    gate.stop("a hand")
    gate.stop("another hand")
    gate.heartbeat(0.2)
    assert not gate.watch(0.2)
    assert "disarmed (a hand)" in str(gate.admits(PLAIN, 0.2))
    assert gate.arm(0.3) == first + 1
    assert gate.watch(0.3)
    assert gate.reason == ""


def test_the_watchdog_waits_for_its_time_and_latches_even_if_the_heartbeat_comes_back() -> None:
    gate = SafetyGate(GateConfig(heartbeat_timeout=0.4))
    gate.arm(10.0)
    assert gate.watch(10.39)
    gate.heartbeat(10.4)
    assert gate.watch(10.79)
    assert not gate.watch(10.81)
    gate.heartbeat(10.82)
    assert not gate.watch(10.82)
    assert "no heartbeat" in gate.reason


def test_a_stop_by_hand_is_told_from_a_heartbeat_that_failed_even_if_it_comes_after_it() -> None:
    gate = SafetyGate(GateConfig(heartbeat_timeout=0.4))
    gate.arm(0.0)
    assert not gate.watch(1.0)
    failed = gate.was_stopped
    gate.stop("the stop service was called")
    stopped, reason = gate.was_stopped, gate.reason
    gate.arm(2.0)
    assert (failed, stopped, gate.was_stopped) == (False, True, False)
    assert "no heartbeat" in reason  # the first one


def test_an_old_heartbeat_does_not_put_the_watch_back() -> None:
    gate = SafetyGate(GateConfig(heartbeat_timeout=0.4))
    gate.arm(10.0)
    gate.heartbeat(9.7)
    assert gate.watch(10.3)


def test_the_watchdog_goes_on_watching_where_the_clock_begins_anew() -> None:
    gate = SafetyGate(GateConfig(heartbeat_timeout=0.4))
    gate.arm(100.0)
    gate.heartbeat(0.1)
    assert gate.watch(0.4)
    assert not gate.watch(0.6)
    assert gate.reason.startswith("no heartbeat for 0.50 s")


def test_throws_follow_each_other_no_faster_than_allowed() -> None:
    gate = SafetyGate(GateConfig(least_pause=2.0))
    gate.arm(0.0)
    assert gate.admits(PLAIN, 0.1) is None
    gate.heartbeat(2.0)
    assert "pause since the last throw: found 1.90 s" in str(gate.admits(PLAIN, 2.0))
    assert gate.admits(PLAIN, 2.1) is None
    assert gate.admits(PLAIN, 1.0) is None  # the clock was set back


@pytest.mark.parametrize(
    ("inside", "outside", "name"),
    [
        ({"linear_velocity": 1.399 * X}, {"linear_velocity": 1.401 * X}, "speed"),
        ({"angular_velocity": 10.99 * X}, {"angular_velocity": 11.01 * X}, "spin"),
        ({"position": np.array([-0.3, 0.0, 0.091])}, {"position": np.array([-0.3, 0.0, 0.089])}, "release height"),
        ({"position": np.array([-0.3, 0.0, 0.239])}, {"position": np.array([-0.3, 0.0, 0.241])}, "release height"),
        ({"position": np.array([-0.499, 0.0, 0.16])}, {"position": np.array([-0.501, 0.0, 0.16])}, "board's middle"),
        ({"position": np.array([-0.307, -0.249, 0.16])}, {"position": np.array([-0.307, -0.251, 0.16])}, "arm's foot"),
        ({"linear_velocity": X}, {"linear_velocity": 50.0 * X}, "speed"),
    ],
)
def test_commands_are_limited_on_both_sides_of_each_limit(
    inside: dict[str, object], outside: dict[str, object], name: str
) -> None:
    assert out_of_limits(replace(PLAIN, **inside), GateConfig()) is None  # type: ignore[arg-type]
    line = out_of_limits(replace(PLAIN, **outside), GateConfig())  # type: ignore[arg-type]
    assert line is not None
    assert name in line
    assert "expected at" in line


def test_numbers_that_are_not_finite_never_pass_even_if_a_record_let_them_in() -> None:
    throw = replace(PLAIN)
    object.__setattr__(throw, "linear_velocity", np.array([np.nan, 0.0, 0.0]))
    assert "not finite" in str(out_of_limits(throw, GateConfig()))


def test_a_path_is_looked_at_again_before_it_is_sent() -> None:
    path = moving(HOME, HOME + 0.3, FR3_LIMITS.speed, 1e-3, DEFAULT_RAMP)
    assert path_out_of_limits(path, FR3_LIMITS) is None
    nan = JointPath(path.positions, np.where(path.speeds > 0.1, np.nan, path.speeds), path.accelerations)
    assert "not finite" in str(path_out_of_limits(nan, FR3_LIMITS))
    assert "position of joint 4" in str(
        path_out_of_limits(JointPath(path.positions + 2.0 * np.eye(7)[3], path.speeds, path.accelerations), FR3_LIMITS)
    )
    assert "speed of joint" in str(
        path_out_of_limits(JointPath(path.positions, 20.0 * path.speeds, path.accelerations), FR3_LIMITS)
    )
    assert "acceleration" in str(
        path_out_of_limits(JointPath(path.positions, path.speeds, 9.0 * path.accelerations), FR3_LIMITS)
    )


@pytest.mark.parametrize(
    "change",
    [
        {"largest_speed": 0.0},
        {"least_pause": -1.0},
        {"lowest_release": 0.3},
        {"keep_out_place": (0.0,)},
        {"heartbeat_timeout": 0.6},
    ],
)
def test_limits_that_limit_nothing_are_refused(change: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError, match="gate"):
        GateConfig(**change)  # type: ignore[arg-type]
