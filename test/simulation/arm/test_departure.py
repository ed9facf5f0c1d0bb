"""A body that has left the gripper, and where the arm would meet it."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.simulation.arm.departure import DEFAULT_DEPARTURE, Departure, DepartureConfig
from contact_curation.simulation.arm.model import DEFAULT_ARM
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD, STEP, STEPS_PER_FRAME, ThrowMotion, ThrowPlanner
from contact_curation.simulation.world import free_motion
from test.simulation.throws import PLAIN


@pytest.fixture(scope="module")
def motion(planner: ThrowPlanner) -> ThrowMotion:
    planned = planner.plan(PLAIN)
    assert isinstance(planned, ThrowMotion)
    return planned


def departure(config: DepartureConfig = DEFAULT_DEPARTURE) -> Departure:
    return Departure(CONTACTNETS_CUBE, DEFAULT_ARM, STEP, STEPS_PER_FRAME, config)


def standing(path: JointPath, row: int) -> JointPath:
    """An arm that does not move on from a sample of a path."""
    return JointPath(path.positions[row : row + 1], 0.0 * path.speeds[:1], 0.0 * path.accelerations[:1])


def test_the_flight_is_the_motion_of_the_world_that_throws_land_in_until_the_body_rests() -> None:
    flight = departure().flight(PLAIN.release)
    np.testing.assert_array_equal(flight, free_motion(CONTACTNETS_CUBE, PLAIN.release, len(flight), FRAME_PERIOD))
    assert 0.3 < FRAME_PERIOD * len(flight) < 3.0
    assert np.abs(flight[-1, 7:10]).max() < DepartureConfig().rest_speed
    still = PLAIN.release.copy()
    still[7:] = 0.0
    assert len(departure().flight(still)) > 20  # a body that is let go at rest falls all the same


def test_a_planned_arm_keeps_away_and_one_that_stays_over_a_body_at_rest_does_not(motion: ThrowMotion) -> None:
    check = departure()
    assert check.too_near(check.flight(PLAIN.release), motion.stopping) is None
    held = np.tile(PLAIN.release, (30, 1))  # as if it hung in the air where it was let go
    gap = check.too_near(held, standing(motion.stopping, 0))
    assert gap is not None
    assert gap.found == pytest.approx(0.005, abs=2e-3)  # the pad's soft part
    assert gap.wanted == DepartureConfig().apart


def test_the_gap_has_to_open_at_its_pace_and_no_further_than_is_enough(motion: ThrowMotion) -> None:
    held, arm = np.tile(PLAIN.release, (3, 1)), standing(motion.stopping, 0)
    assert (
        departure(DepartureConfig(at_first=0.001, opening=0.15)).too_near(held, arm) is None
    )  # 1 + 0.15 * 13.5 = 3 mm, and there are 5
    gap = departure(DepartureConfig(at_first=0.001, opening=1.0)).too_near(held, arm)
    assert gap is not None
    assert gap.wanted == pytest.approx(0.001 + 2.0 * FRAME_PERIOD)
    assert departure(DepartureConfig(at_first=0.001, opening=1.0, apart=0.004)).too_near(held, arm) is None
