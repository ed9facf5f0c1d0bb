"""Throws of arms that are known by their description alone, against a controller that shares no code with the package."""

import numpy as np
import pytest

from test.foreign_arm.arms import FILES, throw
from test.foreign_arm.throwing import FAULTS, Lab

pytestmark = pytest.mark.slow

THROWS = 6
FIRST, WITHIN = 0.02, 0.002
"""Error of the release speed in the first throw, in which each joint is off by 1 %, and after it."""


@pytest.fixture(scope="module", params=FILES)
def lab(request: pytest.FixtureRequest) -> Lab:
    return Lab(FILES[request.param])


def test_releases_are_told_as_they_were_and_the_delay_is_learned(lab: Lab) -> None:
    for number in range(THROWS):
        ending = lab.throw(throw(number))
        assert ending.success, ending.message
        assert ending.executed is not None
        when, pose, twist = lab.cell.released[-1]
        assert abs(ending.released_at - when) < 0.004
        np.testing.assert_allclose(ending.executed.position, pose[:3], atol=4e-3)
        np.testing.assert_allclose(ending.executed.linear_velocity, twist[:3], atol=0.02)
        speed, told, wanted = (
            float(np.linalg.norm(velocity))
            for velocity in (twist[:3], ending.executed.linear_velocity, throw(number).linear_velocity)
        )
        assert abs(told / speed - 1.0) < 0.02
        assert abs(speed / wanted - 1.0) < (WITHIN if number else FIRST)
        if number:
            np.testing.assert_allclose(twist[:3], throw(number).linear_velocity, atol=0.005)
        assert max(lab.used().values()) <= 1.0
        lab.rest()
    assert lab.stage.lag == pytest.approx(lab.cell.lag, abs=0.002)
    assert lab.stage.delay.mean == pytest.approx(lab.cell.delay, abs=0.01)


@pytest.mark.parametrize("name", FAULTS)
def test_after_a_fault_in_the_motion_the_arm_stops_and_goes_home_when_it_is_armed_again(lab: Lab, name: str) -> None:
    happens, line = FAULTS[name]
    began = lab.cell.time

    def meanwhile() -> None:
        if lab.cell.time - began > 1.5:
            happens(lab)

    opened, lab.meanwhile = len(lab.cell.released), meanwhile
    ending = lab.throw(throw(0))
    lab.meanwhile, lab.cell.fault = lambda: None, ""
    assert ending.message.startswith(f"stopped before the release: {line}"), ending.message
    assert len(lab.cell.released) == opened
    lab.rest()
    assert not lab.cell.joint_speeds.any()
    assert "the arm is disarmed" in lab.go_home().message
    lab.gate.arm(lab.cell.time)
    assert "from home" in lab.throw(throw(0)).message
    assert lab.go_home().message == "at home"
    np.testing.assert_allclose(lab.cell.joints, lab.cell.home, atol=1e-3)
