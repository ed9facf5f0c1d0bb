"""Motions of the arm: accurate and within all limits in simulation, refused where they would not be, and stopped safely."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.simulation.arm.departure import DepartureConfig
from contact_curation.simulation.arm.feasibility import ArmFeasibility, blended
from contact_curation.simulation.arm.frame import Phase
from contact_curation.simulation.arm.limits import CollisionReflex, ReflexConfig
from contact_curation.simulation.arm.path import JointPath, RampConfig
from contact_curation.simulation.arm.safety import GateConfig
from contact_curation.simulation.arm.simulation import ArmSimulation, ControlConfig
from contact_curation.simulation.arm.throw import ArmThrower, ExecutedThrow
from contact_curation.simulation.arm.throw_motion import FRAME_PERIOD, STEP, Refused, ThrowMotion, ThrowPlanner
from test.simulation.throws import PLAIN, random_throws

X, Y, Z = np.eye(3)
BOUNCING_BACK = random_throws(600, seed=0)[226]
"""Its corner hits the board 0.1 s after the release, and it bounces back under the gripper that follows it."""
FAST, HIGH = 3.0, 1.0


def planned(planner: ThrowPlanner) -> ThrowMotion:
    motion = planner.plan(PLAIN)
    assert isinstance(motion, ThrowMotion)
    return motion


def check_execution(executed: ExecutedThrow) -> None:
    """What 'must be shown' asks of each throw, and limits that are never broken."""
    errors, peaks = executed.errors, executed.peaks
    assert errors.speed < 0.03
    assert errors.direction < np.radians(3.0)
    assert errors.spin < 0.5
    assert errors.position < 0.005
    assert peaks.torque.max() < 1.0  # clipped torques would be at 1
    assert peaks.speed.max() < 1.0
    assert peaks.position.max() < 1.0


@pytest.mark.slow
def test_random_throws_are_made_as_commanded_within_all_limits(planner: ThrowPlanner) -> None:
    thrower, made = ArmThrower(planner), 0
    for throw in random_throws(3, seed=3):
        motion = planner.plan(throw)
        if isinstance(motion, Refused):
            continue
        executed = thrower.carry_out(motion)
        check_execution(executed)
        assert executed.rested
        made += 1
    assert made >= 2


def test_positions_speeds_and_accelerations_of_a_motion_belong_together_from_home_to_home(planner: ThrowPlanner) -> None:
    motion = planned(planner)
    whole = JointPath.joined(motion.approach, motion.swing, motion.stopping, motion.returning)
    for changes, rates, least in ((whole.positions, whole.speeds, 1e-6), (whole.speeds, whole.accelerations, 3e-5)):
        np.testing.assert_allclose(np.diff(changes, axis=0), STEP * 0.5 * (rates[1:] + rates[:-1]), rtol=0.0, atol=least)
    assert np.abs(np.diff(whole.accelerations, axis=0)).max() / STEP < 5000.0  # jerk
    np.testing.assert_allclose(whole.positions[[0, -1]], np.tile(planner.config.home_posture, (2, 1)), atol=1e-12)


@pytest.mark.slow
def test_two_hundred_random_throws_are_made_as_commanded_within_all_limits(planner: ThrowPlanner) -> None:
    thrower, motions = ArmThrower(planner), [planner.plan(throw) for throw in random_throws(240, seed=4)]
    executed = [thrower.carry_out(motion) for motion in motions if isinstance(motion, ThrowMotion)]
    assert len(executed) >= 200
    for one in executed:
        check_execution(one)
        assert one.rested
    assert sum(one.touched for one in executed) <= 1  # bounces are not known to the millimetre


def test_the_body_flies_free_from_the_instant_it_is_released_and_comes_to_rest_on_the_board(planner: ThrowPlanner) -> None:
    executed = ArmThrower(planner, ControlConfig(release_jitter=0.0)).execute(PLAIN)
    release, states = executed.release, executed.states
    times = executed.frame_period * np.arange(8)
    np.testing.assert_allclose(states[0], release, atol=1e-9)  # the release falls on a frame
    fallen = release[:3] + times[:, None] * release[7:10] - 0.5 * 9.81 * times[:, None] ** 2 * Z
    np.testing.assert_allclose(states[:8, :3], fallen, atol=1e-3)
    np.testing.assert_allclose(states[:8, 10:], np.broadcast_to(release[10:], (8, 3)), atol=1e-6)
    assert not executed.touched
    heights = CONTACTNETS_CUBE.polytope.corner_heights(states[-1, :3], states[-1, 3:7])
    assert np.abs(np.sort(heights)[:4]).max() < 1e-3
    assert executed.frame_period == FRAME_PERIOD


def test_a_body_that_would_bounce_into_the_arm_is_held_or_thrown_another_way_or_refused(planner: ThrowPlanner) -> None:
    throw = BOUNCING_BACK
    heedless = ThrowPlanner(planner.body, departure=DepartureConfig(at_first=-1.0, opening=0.0))
    reckless = heedless.plan(throw)
    assert isinstance(reckless, ThrowMotion)
    motion = planner.plan(throw)
    if isinstance(motion, ThrowMotion):
        assert not ArmThrower(planner).carry_out(motion).touched
    else:
        assert motion.limit == "distance of the thrown body to the arm"
        assert motion.found < motion.allowed


@pytest.mark.slow
def test_an_arm_that_meets_the_body_gives_way_and_ends_at_home_and_without_the_reflex_it_would_push(
    planner: ThrowPlanner,
) -> None:
    heedless = ThrowPlanner(planner.body, departure=DepartureConfig(at_first=-1.0, opening=0.0))
    motion = heedless.plan(BOUNCING_BACK)
    assert isinstance(motion, ThrowMotion)
    gentle, largest = pushed(motion, ReflexConfig())
    assert gentle.gave_way
    assert gentle.settled
    assert largest < 0.7
    np.testing.assert_allclose(gentle.frame().joints, gentle.config.home_posture, atol=5e-3)
    numb, largest = pushed(motion, ReflexConfig(share=100.0))
    assert not numb.gave_way
    assert largest > 0.99


@pytest.mark.slow
def test_an_arm_that_gives_way_can_be_stopped_and_goes_home_when_it_is_armed_again(planner: ThrowPlanner) -> None:
    motion = ThrowPlanner(planner.body, departure=DepartureConfig(at_first=-1.0, opening=0.0)).plan(BOUNCING_BACK)
    assert isinstance(motion, ThrowMotion)
    simulation = ArmSimulation(CONTACTNETS_CUBE)
    simulation.begin(motion)
    while not simulation.gave_way:
        simulation.advance()
    simulation.stop()
    frames = [simulation.advance() for _ in range(150)]
    assert frames[-1].phase is Phase.STOPPED
    assert max(np.abs(frame.speeds).max() for frame in frames[75:]) < 0.02
    simulation.rearm()
    home = next(frame for frame in iter(simulation.advance, None) if frame.phase is Phase.RESTING or frame.time > 20.0)
    np.testing.assert_allclose(home.joints, simulation.config.home_posture, atol=5e-3)


def pushed(motion: ThrowMotion, reflex: ReflexConfig) -> tuple[ArmSimulation, float]:
    """After a throw, and the largest share of a motor's limit that was used since the body had touched the arm."""
    simulation, largest = ArmSimulation(CONTACTNETS_CUBE, control=ControlConfig(reflex=reflex)), 0.0
    simulation.begin(motion)
    while simulation.phase is not Phase.RESTING:
        frame = simulation.advance()
        assert frame.time < 20.0
        if simulation.touched:
            largest = max(largest, float((np.abs(frame.torques) / simulation.config.limits.torque).max()))
    assert simulation.touched
    return simulation, largest


@pytest.mark.slow
def test_a_late_gripper_shifts_the_release_along_the_motion(planner: ThrowPlanner) -> None:
    motion = planned(planner)
    sharp = ArmThrower(planner, ControlConfig(release_jitter=0.0)).carry_out(motion)
    late = ArmThrower(planner, ControlConfig(release_jitter=0.02), seed=2).carry_out(motion)
    assert sharp.errors.position < 1e-3 < late.errors.position
    again = ArmThrower(planner, ControlConfig(release_jitter=0.02), seed=2).carry_out(motion)
    np.testing.assert_array_equal(again.states, late.states)


@pytest.mark.parametrize(
    ("possible", "impossible", "limit"),
    [
        ({"linear_velocity": 1.4 * X}, {"linear_velocity": FAST * X}, "speed of joint"),
        ({"angular_velocity": 4.0 * Y}, {"angular_velocity": 14.0 * Y}, "speed of joint|range of joint"),
        (
            {"position": np.array([-0.3, 0.1, 0.16])},
            {"position": np.array([-0.3, HIGH, 0.16])},
            "reach|range of joint|speed of joint",
        ),
        (
            {"position": np.array([-0.307, 0.0, 0.08])},
            {"position": np.array([-0.307, 0.0, 0.055])},
            "distance of the body and the table|distance of the table",
        ),
    ],
)
def test_throws_beyond_a_limit_are_refused_by_its_name_and_those_before_it_are_planned(
    planner: ThrowPlanner, possible: dict[str, object], impossible: dict[str, object], limit: str
) -> None:
    assert isinstance(planner.plan(replace(PLAIN, **possible)), ThrowMotion)  # type: ignore[arg-type]
    refused = planner.plan(replace(PLAIN, **impossible))  # type: ignore[arg-type]
    assert isinstance(refused, Refused)
    assert any(name in refused.limit for name in limit.split("|")), str(refused)
    assert "found" in str(refused)
    assert "expected at" in str(refused)


def test_torques_change_no_faster_than_the_motors_can(planner: ThrowPlanner) -> None:
    sudden = ThrowPlanner(planner.body, ramp=RampConfig(rise=0.005))
    refused = sudden.plan(PLAIN)
    assert isinstance(refused, Refused)
    assert refused.limit.startswith("torque's rate of joint")
    simulation = ArmSimulation(CONTACTNETS_CUBE)
    simulation.begin(planned(planner))
    torques = []
    while simulation.phase is not Phase.RELEASED:
        torques.append(simulation.advance().torques)
    changes = np.abs(np.diff(torques, axis=0)).max(axis=0) / FRAME_PERIOD
    assert 100.0 < changes.max() < 0.95 * simulation.config.limits.torque_rate.max()


def test_torques_that_the_motors_lack_are_refused() -> None:
    heavy = replace(CONTACTNETS_CUBE, mass=9.0, inertia=np.full(3, 2e-2))
    refused = ThrowPlanner(heavy).plan(PLAIN)
    assert isinstance(refused, Refused)
    assert refused.limit.startswith("torque of joint")
    assert refused.found > refused.allowed


@pytest.mark.slow
def test_the_nearest_feasible_throw_is_feasible_and_a_little_more_is_not(planner: ThrowPlanner) -> None:
    feasible = ArmFeasibility(planner, GateConfig())
    wanted = replace(PLAIN, angular_velocity=np.array([-9.0, 4.0, -4.0]))
    assert feasible((PLAIN, wanted))[0] is None
    assert feasible((PLAIN, wanted))[1] is not None
    nearest = feasible.nearest(wanted)
    assert nearest is not None
    assert feasible.refusal(nearest) is None
    assert 0.1 < np.linalg.norm(nearest.linear_velocity) < np.linalg.norm(wanted.linear_velocity)
    np.testing.assert_allclose(nearest.position, wanted.position)
    assert feasible.refusal(blended(nearest, wanted, 0.05)) is not None
    far = replace(PLAIN, position=np.array([0.45, 0.4, 0.2]))
    moved = feasible.nearest(far)
    assert moved is not None
    assert feasible.refusal(moved) is None
    assert feasible.refusal(replace(PLAIN, body="brick")) == "body: found brick, expected cube"


def test_half_way_between_two_throws_is_half_a_turn_and_half_the_speed() -> None:
    turned = replace(PLAIN, orientation_wxyz=quaternions.exp(np.array([0.0, 0.0, 1.0])), linear_velocity=2.0 * X)
    between = blended(PLAIN, turned, 0.5)
    np.testing.assert_allclose(quaternions.log(between.orientation_wxyz), [0.0, 0.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(between.linear_velocity, 1.5 * X)


@pytest.mark.parametrize("when", [Phase.MOVING, Phase.THROWING, Phase.RELEASED])
def test_a_stop_brakes_within_the_limits_latches_and_ends_at_home_when_armed_again(planner: ThrowPlanner, when: Phase) -> None:
    simulation = ArmSimulation(CONTACTNETS_CUBE)
    simulation.begin(planned(planner))
    while simulation.phase is not when:
        simulation.advance()
    frames = [simulation.advance() for _ in range(5)]
    simulation.stop()
    while simulation.phase is not Phase.STOPPED:
        frames.append(simulation.advance())
        assert len(frames) < 250
    changes = np.diff([frame.speeds for frame in frames], axis=0) / FRAME_PERIOD
    assert np.abs(changes).max() < 10.5  # 10 rad/s^2, and what the controller corrects
    frames = [simulation.advance() for _ in range(20)]
    assert max(np.abs(frame.speeds).max() for frame in frames[10:]) < 0.01
    assert frames[-1].free is (when is Phase.RELEASED)
    with pytest.raises(InvalidValueError, match="rests at home"):
        simulation.begin(planned(planner))
    simulation.rearm()
    home = next(frame for frame in iter(simulation.advance, None) if frame.phase is Phase.RESTING or frame.time > 40.0)
    assert home.phase is Phase.RESTING
    np.testing.assert_allclose(simulation.frame().joints, simulation.config.home_posture, atol=5e-3)
    peaks = simulation.peaks
    assert max(peaks.torque.max(), peaks.speed.max()) < 1.0


def test_other_convex_bodies_are_thrown_too() -> None:
    corners = 0.06 * np.concatenate([np.eye(3), -np.eye(3)])
    octahedron = Body("octahedron", corners, 0.2, np.full(3, 2e-4), 0.3, 0.06)
    throw = replace(PLAIN, body="octahedron", orientation_wxyz=quaternions.exp(np.array([0.3, 0.2, 0.1])))
    executed = ArmThrower(ThrowPlanner(octahedron)).execute(throw)
    check_execution(executed)
    assert executed.rested


def test_the_same_seed_throws_the_same(planner: ThrowPlanner) -> None:
    one, other = (ArmThrower(planner, seed=5).execute(PLAIN) for _ in range(2))
    np.testing.assert_array_equal(one.states, other.states)
    with pytest.raises(InvalidValueError, match="throw plain: found speed"):
        ArmThrower(planner).execute(replace(PLAIN, linear_velocity=FAST * X))


def test_the_reflex_feels_a_push_that_lasts_and_not_one_step_of_noise() -> None:
    limits = np.array([10.0, 100.0])
    reflex = CollisionReflex(limits, ReflexConfig(share=0.1, time=0.005))
    assert not reflex.feels(np.array([5.0, 0.0]), 0.001)
    assert not reflex.feels(np.array([-3.0, 0.0]), 0.001)
    assert not any(reflex.feels(np.array([0.9, 9.0]), 0.001) for _ in range(100))
    assert any(reflex.feels(np.array([0.0, -12.0]), 0.001) for _ in range(15))
    reflex.forget()
    assert not reflex.feels(np.zeros(2), 0.001)
    for wrong in ({"share": 0.0}, {"time": np.nan}):
        with pytest.raises(InvalidValueError, match="reflex"):
            ReflexConfig(**wrong)
