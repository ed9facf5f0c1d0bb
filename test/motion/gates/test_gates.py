"""The gates accept good tosses and reject tracking outliers (method.md 2.1, check 11)."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.motion import gates
from contact_curation.motion.gate_config import TURN_NOISE, GateBounds, GateConfig
from contact_curation.motion.gates import (
    REST_FRAMES,
    ROCKING_FRAMES,
    Steps,
    cone_gate,
    impulse_gate,
    inspect,
    rest_normal,
    steps_of,
    twist_gate,
)
from contact_curation.motion.pose_noise import RIG, RIG_TURN, TrackerScale
from contact_curation.motion.scales import scale_of
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.survey.lost_frames import lost_frames
from contact_curation.motion.toss import Toss
from test.motion.faults import contaminated, with_outliers
from test.motion.streams import CUBE, PERIOD_NS, noisy, stream
from test.motion.test_segmenter import cut

CONFIG = GateConfig()
BOUNDS = CONFIG.bounds(scale_of(CUBE), RIG)
PERIOD = PERIOD_NS / 1e9


@pytest.fixture(scope="module")
def good() -> Toss:
    (toss,) = cut(stream())
    assert isinstance(toss, Toss)
    return toss


def changed(toss: Toss, name: str, frame: int, by: list[float]) -> Toss:
    """The toss with one row of one field shifted."""
    values = getattr(toss, name).copy()
    values[frame] += by
    return replace(toss, **{name: values})


def falling(**given: Any) -> Toss:
    """Four frames in the air with consistent velocities, to be changed from."""
    times = PERIOD * np.arange(4)
    velocities = np.outer(1.0 - 9.81 * times, [0.0, 0.0, 1.0])
    positions = np.array([0.0, 0.0, 0.3]) + PERIOD * np.cumsum(velocities, axis=0)
    parts: dict[str, Any] = {
        "stamps_ns": PERIOD_NS * np.arange(4),
        "positions": positions,
        "orientations_wxyz": np.tile(quaternions.IDENTITY, (4, 1)),
        "linear_velocities": velocities,
        "angular_velocities": np.zeros((4, 3)),
    }
    return Toss("t", "cube", "s", PERIOD, **(parts | given))


def pulled(gained: list[float]) -> Toss:
    """Contact gives the velocity `gained` [m/s] between frames 1 and 2."""
    toss = falling()
    velocities = toss.linear_velocities.copy()
    velocities[2:] += gained
    return replace(toss, linear_velocities=velocities)


def test_a_clean_toss_passes(good: Toss) -> None:
    assert inspect(good, CUBE, CONFIG) == ()
    assert inspect(falling(), CUBE, CONFIG) == ()


@pytest.mark.parametrize(
    ("gained", "passes"),
    [
        ([0.0, 0.0, -0.156], True),
        ([0.0, 0.0, -0.158], False),
        ([0.0, 0.0, 5.0], True),
        ([0.156, 0.0, 0.0], True),
        ([0.112, 0.112, 0.0], False),
        ([0.0, -0.6, 1.0], True),  # 0.157 + 0.5
        ([0.0, -0.66, 1.0], False),
        ([0.158, 0.0, -0.1], False),
    ],
)
def test_impulses_point_up_and_stay_in_the_cone_from_both_sides(gained: list[float], passes: bool) -> None:
    steps = steps_of(pulled(gained), CUBE, BOUNDS)
    assert (not impulse_gate(steps, BOUNDS) and not cone_gate(steps, BOUNDS)) is passes


def test_a_reason_says_what_was_found_where_and_what_was_expected() -> None:
    steps = steps_of(pulled([0.0, 0.0, -0.3]), CUBE, BOUNDS)
    assert impulse_gate(steps, BOUNDS) == "impulse that pulls down: found 0.3 m/s at frame 2, expected at most 0.1572 m/s"


@pytest.mark.parametrize(
    ("toss", "reason"),
    [
        (falling(stamps_ns=PERIOD_NS * np.array([0, 10, 26, 36]) // 10), "time between frames: found 1.6"),
        (
            falling(orientations_wxyz=1.0002 * np.tile(quaternions.IDENTITY, (4, 1))),
            "quaternion norm beside 1: found 0.0002 at frame 0",
        ),
        (
            falling(positions=np.array([0.0, 0.0, 0.0524 - 0.0079]) + np.zeros((4, 3))),
            "depth in the board: found 0.0079 m at frame 0",
        ),
        (pulled([0.0, 0.06, 0.0]), "acceleration in the air beyond gravity: found 8.88 m/s^2 at frame 2"),
        (changed(falling(), "angular_velocities", 2, [2.1, 0.0, 0.0]), "change of spin in the air: found 2.1 rad/s at frame 2"),
        (pulled([0.0, 0.0, 0.15]), "energy gained in the air: found 0."),
        (changed(falling(), "positions", 2, [0.003, 0.0, 0.0]), "displacement beside the velocity: found 0.444 m/s"),
        (
            changed(falling(), "angular_velocities", 2, [0.0, 26.0, 0.0]),
            "turn beside the angular velocity: found 26 rad/s at frame 2",
        ),
    ],
)
def test_each_kind_of_fault_has_its_own_reason(toss: Toss, reason: str) -> None:
    assert any(line.startswith(reason) for line in inspect(toss, CUBE, CONFIG)), inspect(toss, CUBE, CONFIG)


@pytest.mark.parametrize(
    "toss",
    [
        falling(stamps_ns=PERIOD_NS * np.array([0, 10, 24, 34]) // 10),
        falling(orientations_wxyz=1.00009 * np.tile(quaternions.IDENTITY, (4, 1))),
        pulled([0.0, 0.057, 0.0]),
        changed(falling(), "angular_velocities", 2, [1.9, 0.0, 0.0]),
        changed(falling(), "positions", 2, [0.0025, 0.0, 0.0]),
    ],
)
def test_what_is_just_inside_the_bounds_passes(toss: Toss) -> None:
    assert inspect(toss, CUBE, CONFIG) == ()


def bounced(restitution: float, lost: list[int], *, restored: bool = False) -> Toss:
    """A cube falls flat, and bounces between frames 20 and 21; without some frames, whose stamps are closed up or restored."""
    frames = np.setdiff1d(np.arange(32), lost)
    times = PERIOD * (frames - 20.4)[:, np.newaxis]
    velocities = np.where(times < 0.0, [0.6, 0.0, -2.0], [0.4, 0.0, 2.0 * restitution])
    positions = [0.0, 0.0, 0.0524] + velocities * times - 0.5 * 9.81 * times**2 * [0.0, 0.0, 1.0]
    orientations = quaternions.exp(np.maximum(times, 0.0) * [0.0, 8.0, 0.0])
    steps = np.ones(len(frames) - 1, dtype=np.int64)
    if restored:
        steps += lost_frames(positions, orientations, PERIOD, scale_of(CUBE).reach, CUBE.gravity)
    stamps = PERIOD_NS * np.append(0, np.cumsum(steps))
    rates = kinematics(stamps, positions, orientations)
    seen = slice(1, None)  # the first velocity is only the second, repeated
    velocities, spins = rates.linear_velocities[seen], rates.angular_velocities[seen]
    return Toss("t", "cube", "s", PERIOD, stamps[seen], positions[seen], orientations[seen], velocities, spins)


@pytest.mark.parametrize("restitution", [0.5, 0.7, 0.9])
def test_a_bounce_passes(restitution: float) -> None:
    assert inspect(bounced(restitution, []), CUBE, CONFIG) == ()


@pytest.mark.parametrize("lost", [[4], [20], [21], [20, 21]])
@pytest.mark.parametrize("restitution", [0.7, 0.9])
def test_a_bounce_that_lacks_frames_passes_only_once_its_stamps_are_restored(restitution: float, lost: list[int]) -> None:
    assert inspect(bounced(restitution, lost), CUBE, CONFIG)
    assert inspect(bounced(restitution, lost, restored=True), CUBE, replace(CONFIG, largest_gap=4.0)) == ()


def test_a_body_that_bounces_off_a_wall_is_rejected() -> None:
    sliding = falling(
        positions=np.tile([0.0, 0.0, 0.0524], (4, 1)),
        linear_velocities=np.array([[-0.4, 0.0, 0.0], [-0.4, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.0, 0.0]]),
    )
    assert cone_gate(steps_of(sliding, CUBE, BOUNDS), BOUNDS).startswith("impulse outside the friction cone: found 0.5669 m/s")


def slowed(deceleration: float, frames: int) -> Toss:
    """A cube slides along at 1 m/s, and is slowed down over some frames [m/s^2]."""
    braked = np.clip(np.arange(40) - 10, 0, frames)
    velocities = np.outer(1.0 - deceleration * PERIOD * braked, [1.0, 0.0, 0.0])
    positions = [0.0, 0.0, 0.0524] + PERIOD * np.cumsum(velocities, axis=0)
    turns, spins = np.tile(quaternions.IDENTITY, (40, 1)), np.zeros((40, 3))
    return Toss("t", "cube", "s", PERIOD, PERIOD_NS * np.arange(40), positions, turns, velocities, spins)


@pytest.mark.parametrize(
    ("deceleration", "frames", "passes"),
    [
        (4.9, 29, True),  # by friction, as long as it slides
        (8.0, 4, True),
        (8.0, 10, False),  # 10 (8 - 4.9) / 148 = 0.209, in each frame no more than 0.021
        (12.0, 5, False),
    ],
)
def test_a_hand_that_slows_a_body_down_on_the_board_is_seen_over_some_frames(
    deceleration: float, frames: int, passes: bool
) -> None:
    assert (inspect(slowed(deceleration, frames), CUBE, CONFIG) == ()) is passes


def twisted(spin: float, push: float = 0.0, late: int = 0) -> Toss:
    """On the board, it comes to turn by `spin` [rad/s] from frame 2 on, with a push up [m/s] so many frames later."""
    toss = falling(
        positions=np.tile([0.0, 0.0, 0.0524], (4, 1)), linear_velocities=np.outer(-9.81 * PERIOD * np.arange(4), [0, 0, 1])
    )
    velocities, spins = toss.linear_velocities.copy(), toss.angular_velocities.copy()
    velocities[2 + late :, 2] += push
    spins[2:, 0] += spin
    return replace(toss, linear_velocities=velocities, angular_velocities=spins)


@pytest.mark.parametrize(
    ("toss", "passes"),
    [
        (twisted(1.9), True),
        (twisted(2.1), False),
        (twisted(42.0, push=1.0), True),  # 2 + sqrt(2) 0.0524 0.37 / 8.1e-4 (sqrt(1.25) + 9.81 / 148)
        (twisted(42.2, push=1.0), False),
        (twisted(42.0, push=1.0, late=-1), True),
        (twisted(42.0, push=1.0, late=1), True),
        (twisted(232.0), False),
    ],
)
def test_a_body_is_twisted_by_a_push_or_not_at_all(toss: Toss, passes: bool) -> None:
    assert (not twist_gate(steps_of(toss, CUBE, BOUNDS), BOUNDS)) is passes


def test_a_body_turns_most_about_the_axis_of_its_least_inertia_and_by_its_own_inertia() -> None:
    half = np.array([0.2, 0.03, 0.02])
    inertia = 2.0 / 3.0 * np.array([0.03**2 + 0.02**2, 0.2**2 + 0.02**2, 0.2**2 + 0.03**2])
    rod = Body("rod", box(half).vertices, 2.0, inertia, 0.2, 0.05)
    levers = np.sqrt([0.03**2 + 0.02**2, 0.2**2 + 0.02**2, 0.2**2 + 0.03**2]) * 2.0 / inertia
    assert scale_of(rod).levers == pytest.approx(levers)
    assert scale_of(replace(rod, inertia=0.5 * inertia)).levers == pytest.approx(2.0 * levers)


def test_an_inertia_that_is_not_well_known_may_be_given_more_leverage() -> None:
    loose = replace(CONFIG, twist_leverage=1.2).bounds(scale_of(CUBE), RIG)
    steps = steps_of(twisted(45.0, push=1.0), CUBE, BOUNDS)
    assert twist_gate(steps, BOUNDS).startswith("change of spin beyond what a contact's impulse gives: found 4.9")
    assert not twist_gate(steps, loose)


def test_tags_that_are_swapped_in_the_last_frame_alone_are_seen(good: Toss) -> None:
    orientations = good.orientations_wxyz.copy()
    orientations[-1] = quaternions.multiply(orientations[-1], quaternions.exp(np.array([0.0, 0.0, 0.5 * np.pi])))
    seen = kinematics(good.stamps_ns, good.positions, orientations)
    bad = replace(good, orientations_wxyz=orientations, angular_velocities=seen.angular_velocities)
    assert any(line.startswith("change of spin beyond") for line in inspect(bad, CUBE, CONFIG))


def lying(toss: Toss, degrees: float, metres: float) -> Toss:
    """The toss as on a board that leans and is too low, its face on average so high."""
    turn = quaternions.exp(np.radians([degrees, 0.0, 0.0]))
    middle = toss.positions[-1] * [1.0, 1.0, 0.0]
    return replace(
        toss,
        positions=quaternions.rotate(turn, toss.positions - middle) + middle + [0.0, 0.0, metres],
        orientations_wxyz=quaternions.multiply(turn, toss.orientations_wxyz),
        linear_velocities=quaternions.rotate(turn, toss.linear_velocities),
        angular_velocities=quaternions.rotate(turn, toss.angular_velocities),
    )


@pytest.mark.parametrize(
    ("degrees", "metres", "reason"),
    [
        (1.0, 0.0, None),
        (0.0, 0.0025, None),
        (0.0, -0.0025, None),
        (2.0, 0.0, "tilt at rest: found 2"),
        (0.0, 0.0035, "height at rest: found 0.003"),
        (0.0, -0.0035, "height at rest: found -0.003"),
    ],
)
def test_a_body_at_rest_lies_flat_on_the_board(good: Toss, degrees: float, metres: float, reason: str | None) -> None:
    reasons = inspect(lying(good, degrees, metres), CUBE, CONFIG)
    assert not reasons if reason is None else any(line.startswith(reason) for line in reasons)


def test_of_a_body_that_still_moves_nothing_is_said_of_its_rest(good: Toss) -> None:
    moving = replace(lying(good, 2.0, 0.0), angular_velocities=good.angular_velocities + np.array([0.0, 0.0, 1.0]))
    assert not any("at rest" in line for line in inspect(moving, CUBE, CONFIG))


def test_the_cone_is_wide_enough_for_a_body_with_much_friction() -> None:
    rubber = CONFIG.bounds(scale_of(replace(CUBE, friction=1.0)), RIG)
    assert (BOUNDS.largest_friction, rubber.largest_friction) == (0.5, 1.5)
    steps = steps_of(pulled([1.2, 0.0, 1.0]), CUBE, BOUNDS)
    assert "outside the friction cone" in cone_gate(steps, BOUNDS)
    assert not cone_gate(steps, rubber)


@pytest.mark.parametrize(
    ("rate", "growth"), [(60, (9.81 / 60 + 8 * 1.6 * 2.2e-5 * 60) / 0.1572), (100, 1.6 / 1.5), (148, 1.0), (300, 2.0)]
)
def test_bounds_grow_with_the_noise_of_a_faster_tracker(rate: float, growth: float) -> None:
    for share in (0.99, 1.01):
        pull = replace(pulled([0.0, 0.0, -share * growth * BOUNDS.impulse_tolerance]), frame_period=1.0 / rate)
        assert (impulse_gate(steps_of(pull, CUBE, BOUNDS), BOUNDS) == "") == (share < 1.0)


def test_a_bound_on_accelerations_that_is_set_grows_with_the_noise_and_the_square_of_the_rate() -> None:
    config = GateConfig(airborne_acceleration=7.0)
    (line,) = (
        line for line in inspect(tumbling(1, 300), ROD, config, TrackerScale(3.0, 2.0)) if line.startswith("acceleration")
    )
    assert line.endswith("expected at most 84 m/s^2")  # 3 times 2^2


def test_a_toss_tracked_240_times_a_second_with_the_rigs_noise_passes() -> None:
    (toss,) = cut(noisy(stream(period_ns=10**9 // 240), 1.0))
    assert isinstance(toss, Toss)
    assert inspect(toss, CUBE, CONFIG) == ()


def test_a_gate_that_is_added_to_the_table_is_asked(good: Toss, monkeypatch: pytest.MonkeyPatch) -> None:
    def longest_gate(steps: Steps, bounds: GateBounds) -> str:
        return f"frames: found {steps.toss.frames}, expected at most 2"

    monkeypatch.setattr(gates, "GATES", (*gates.GATES, longest_gate))
    assert inspect(good, CUBE, CONFIG) == (f"frames: found {good.frames}, expected at most 2",)


ROD = Body("rod", box(np.array([0.2, 0.03, 0.02])).vertices, 2.0, np.array([8.6667e-4, 0.026933, 0.027267]), 0.4, 0.05)
"""Another lever about each axis."""


def tumbling(seed: int, rate: float) -> Toss:
    """A rod in the air at random places, orientations, velocities and spins, some frames of which are late."""
    rng, frames = np.random.default_rng(seed), 16
    places = np.cumsum(rng.normal(0.0, 0.02, (frames, 3)), axis=0) + np.array([0.0, 0.0, 0.3])
    turns = np.cumsum(rng.normal(0.0, 0.1, (frames, 3)), axis=0)
    periods = round(1e9 / rate) * rng.choice([1.0, 1.0, 1.7], frames - 1)
    stamps = np.cumsum(np.append(0, periods.astype(np.int64)))
    norms = 1.0 + 3e-4 * rng.normal(size=(frames, 1))
    velocities, spins = rng.normal(0.0, 1.0, (frames, 3)), rng.normal(0.0, 4.0, (frames, 3))
    return Toss("t", "rod", "s", 1.0 / rate, stamps, places, quaternions.exp(turns) * norms, velocities, spins)


@pytest.mark.parametrize(
    ("seed", "rate", "tracker", "found"),
    [
        (
            0,
            148,
            RIG,
            [
                "time between frames: found 1.7 frame periods at frame 2, expected at most 1.5 frame periods",
                "quaternion norm beside 1: found 0.000675 at frame 4, expected at most 0.0001",
                "impulse that pulls down: found 3.237 m/s at frame 15, expected at most 0.1525 m/s",
                "impulse outside the friction cone: found 3.412 m/s at frame 6, expected at most 0.1525 m/s",
                "acceleration in the air beyond gravity: found 516.8 m/s^2 at frame 6, expected at most 8.481 m/s^2",
                "change of spin in the air: found 15.26 rad/s at frame 14, expected at most 2 rad/s",
                (
                    "change of spin beyond what a contact's impulse gives: found 10.46 rad/s at frame 7, "
                    "expected at most 2.562 rad/s"
                ),
                "energy gained in the air: found 2.595 m^2/s^2 at frame 13, expected at most 0.1 m^2/s^2",
                "displacement beside the velocity: found 8.473 m/s at frame 15, expected at most 0.4 m/s",
                "turn beside the angular velocity: found 27.93 rad/s at frame 8, expected at most 10.96 rad/s",
            ],
        ),
        (
            1,
            300,
            TrackerScale(3.0, 2.0),
            [
                "time between frames: found 1.7 frame periods at frame 3, expected at most 1.5 frame periods",
                "quaternion norm beside 1: found 0.000526 at frame 4, expected at most 0.0001",
                "impulse that pulls down: found 3.71 m/s at frame 12, expected at most 0.305 m/s",
                "impulse outside the friction cone: found 3.274 m/s at frame 1, expected at most 0.305 m/s",
                "acceleration in the air beyond gravity: found 1330 m/s^2 at frame 1, expected at most 104.5 m/s^2",
                "change of spin in the air: found 18.45 rad/s at frame 9, expected at most 8 rad/s",
                "energy gained in the air: found 1.618 m^2/s^2 at frame 15, expected at most 0.6 m^2/s^2",
                "displacement beside the velocity: found 20.03 m/s at frame 8, expected at most 0.8 m/s",
                "turn beside the angular velocity: found 66.1 rad/s at frame 15, expected at most 21.91 rad/s",
            ],
        ),
    ],
    ids=["rig", "fast and noisy"],
)
def test_every_gate_names_its_worst_frame_and_the_bound_of_the_tracker(
    seed: int, rate: float, tracker: TrackerScale, found: list[str]
) -> None:
    assert list(inspect(tumbling(seed, rate), ROD, CONFIG, tracker)) == found


DERIVED = {
    "gravity": 9.81,
    "largest_friction": 0.6,  # 1.5 of 0.4
    "impulse_tolerance": 0.15251660,  # 0.219 sqrt(size g), size (0.2 0.03 0.02)^(1/3) = 0.0493
    "airborne_clearance": 0.0094130,  # 0.191 size
    "airborne_acceleration": 5.886,  # 0.6 g
    "airborne_noise": 0.0003872,  # 11 standard deviations of 22 um, 1.6 times as loud
    "airborne_spin_change": 2.0,
    "levers": [83.204709, 14.925743, 14.833864],
    "twist_tolerance": 2.5616588,  # 8 of 22 um 150 times a second, sqrt(1 + 0.6^2), the largest lever
    "energy_tolerance": 0.1,
    "energy_speed": 0.04,
    "least_impulse": 0.000176,
    "least_jump": 0.000176,
    "jump_velocity": 0.4,
    "jump_spins": [61.450430, 11.023334, 10.955478],
    "depth": 0.0073986,  # 0.15 size
    "rest_tilt": 0.024434610,  # 1.4 degrees
    "rest_height": 0.0028239,
    "resting_speed": 0.05,
    "resting_spin": 0.5,
    "quaternion_tolerance": 1e-4,
    "largest_gap": 1.5,
}
NOISY = {
    "airborne_clearance": 0.034710509,  # 10 standard deviations of a vertex, 0.2 m away
    "airborne_noise": 0.0011616,
    "least_impulse": 0.000528,
    "least_jump": 0.000528,
    "depth": 0.034710509,
    "rest_tilt": 0.134041287,  # 8 of 40 times 0.024 degrees
    "rest_height": 0.034710509,
    "resting_speed": 0.15,
    "resting_spin": 20.0,
}
SET = {
    "gravity": 3.0,
    "largest_friction": 0.7,
    "impulse_tolerance": 0.11,
    "airborne_clearance": 0.02,
    "airborne_acceleration": 7.0,
    "airborne_spin_change": 1.5,
    "twist_leverage": 1.2,
    "twist_tolerance": 3.0,
    "energy_tolerance": 0.3,
    "jump_velocity": 0.6,
    "jump_spin": 12.0,
    "depth": 0.004,
    "rest_tilt": 0.05,
    "rest_height": 0.006,
    "resting_speed": 0.08,
    "resting_spin": 0.9,
    "quaternion_tolerance": 2e-4,
    "largest_gap": 1.7,
}
OF_SET = {
    "airborne_noise": 0.0,
    "energy_speed": 0.0,
    "least_impulse": 0.0,
    "least_jump": 0.0,
    "levers": [1.2 * lever for lever in (83.204709, 14.925743, 14.833864)],
    "jump_spins": [12.0, 12.0, 12.0],
}


@pytest.mark.parametrize(
    ("config", "tracker", "expected"),
    [
        (CONFIG, RIG, DERIVED),
        (CONFIG, TrackerScale(3.0, 40.0), DERIVED | NOISY),
        (GateConfig(**SET), RIG, {key: value for key, value in SET.items() if key in DERIVED} | OF_SET),  # type: ignore[arg-type]
    ],
    ids=["rig", "noisy", "set"],
)
def test_bounds_follow_from_the_body_and_the_tracker_unless_they_are_set(
    config: GateConfig, tracker: TrackerScale, expected: dict[str, Any]
) -> None:
    found = vars(config.bounds(scale_of(ROD), tracker))
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-5, atol=1e-12, err_msg=name)


def resting(frames: int, tilts: dict[int, float] | None = None) -> Toss:
    """The cube flat on the board, turned about the vertical, in so many frames; tilted in some of them [rad]."""
    turns = np.zeros((frames, 3))
    for frame, tilt in (tilts or {}).items():
        turns[frame, 0] = tilt
    yaw = quaternions.exp(np.array([0.0, 0.0, 0.3]))
    return falling(
        stamps_ns=PERIOD_NS * np.arange(frames),
        positions=np.tile([0.1, 0.2, 0.0524], (frames, 1)),
        orientations_wxyz=quaternions.multiply(quaternions.exp(turns), np.tile(yaw, (frames, 1))),
        linear_velocities=np.zeros((frames, 3)),
        angular_velocities=np.zeros((frames, 3)),
    )


def test_a_footing_is_three_corners_of_the_face_on_the_board() -> None:
    footing = steps_of(resting(14), CUBE, BOUNDS).footing
    assert footing is not None
    np.testing.assert_allclose(footing[:, 2], 0.0, atol=1e-12)
    sides = np.linalg.norm(footing - np.roll(footing, 1, axis=0), axis=1)
    np.testing.assert_allclose(np.sort(sides), 0.1048 * np.array([1.0, 1.0, np.sqrt(2.0)]), rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(footing[:, :2] - [0.1, 0.2], axis=1), 0.0524 * np.sqrt(2.0), rtol=1e-9)
    for corners in (footing, footing[[1, 0, 2]]):
        np.testing.assert_allclose(rest_normal(corners), [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(("turn", "rests"), [(0.99, True), (1.01, False)])
@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_a_body_that_tilts_in_the_last_frames_does_not_rest(turn: float, noise: float, rests: bool) -> None:
    tilt = turn * TURN_NOISE * RIG_TURN * noise
    tracker = TrackerScale(1.0, noise)
    first = 20 - ROCKING_FRAMES - 1
    for frame in (first, 17):
        assert (steps_of(resting(20, {frame: tilt}), CUBE, BOUNDS, tracker).footing is not None) is rests
    assert steps_of(resting(20, {first - 1: tilt}), CUBE, BOUNDS, tracker).footing is not None


@pytest.mark.parametrize("name", ["linear_velocities", "angular_velocities"])
def test_a_body_rests_that_is_slow_in_most_of_the_last_frames(name: str) -> None:
    toss, fast = resting(14), np.zeros((14, 3))

    def rests() -> bool:
        moving: dict[str, Any] = {name: fast}
        return steps_of(replace(toss, **moving), CUBE, BOUNDS).footing is not None

    fast[-REST_FRAMES // 2 + 1 :] = [0.3, 0.0, 0.5]
    assert rests()
    fast[-REST_FRAMES // 2 :] = [0.3, 0.0, 0.5]
    assert not rests()


@pytest.mark.parametrize(
    ("degrees", "metres", "lines"),
    [
        (2.0, 0.0, ["tilt at rest: found 2 degrees, expected at most 1.4 degrees"]),
        (-3.0, 0.0, ["tilt at rest: found 3 degrees, expected at most 1.4 degrees"]),
        (0.0, 0.0035, ["height at rest: found 0.0035 m, expected at most 0.003 m over or under the board"]),
        (
            0.0,
            -0.02,
            [
                "depth in the board: found 0.02 m at frame 0, expected at most 0.00786 m",
                "height at rest: found -0.02 m, expected at most 0.003 m over or under the board",
            ],
        ),
    ],
)
def test_a_body_that_rests_wrongly_is_told_by_how_much(degrees: float, metres: float, lines: list[str]) -> None:
    assert list(inspect(lying(resting(14), degrees, metres), CUBE, CONFIG)) == lines


def test_a_disabled_gate_lets_everything_pass() -> None:
    assert inspect(pulled([0.0, 0.0, -3.0]), CUBE, GateConfig(enabled=False)) == ()


@pytest.mark.parametrize(
    ("name", "value"), [("impulse_tolerance", -1.0), ("depth", 0.0), ("quaternion_tolerance", 0.0), ("largest_gap", np.nan)]
)
def test_bounds_that_make_no_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(InvalidValueError) as refused:
        GateConfig(**{name: value})  # type: ignore[arg-type]
    assert str(refused.value) == f"{name}: found {value}, expected a positive number"


@pytest.mark.parametrize("velocities", ["raw", "filtered", "hidden"])
@pytest.mark.parametrize("frames", [1, 2, 3])
def test_an_outlier_in_a_synthetic_toss_is_caught_however_the_tracker_filters(good: Toss, velocities: str, frames: int) -> None:
    rng = np.random.default_rng(7)
    assert all(inspect(with_outliers(good, rng, frames=frames, velocities=velocities), CUBE, CONFIG) for _ in range(20))


class TestOnTheRealTosses:
    """Numbers of method.md 2.1 and check 11; the tosses are ContactNets' 570."""

    def impulse_flags(self, tosses: list[Toss], config: GateConfig) -> set[int]:
        bounds = config.bounds(scale_of(CUBE), RIG)
        steps = (steps_of(toss, CUBE, bounds) for toss in tosses)
        return {number for number, step in enumerate(steps) if impulse_gate(step, bounds) or cone_gate(step, bounds)}

    def test_no_clean_toss_is_flagged(self, real_tosses: list[Toss]) -> None:
        flagged = [toss.toss_id for toss in real_tosses if inspect(toss, CUBE, CONFIG)]
        assert len(real_tosses) == 570
        assert flagged == []

    @pytest.mark.parametrize("tolerance", [1.5, 3.0, 6.0])
    @pytest.mark.parametrize("seed", [0, 1])
    def test_the_impulse_gate_finds_28_of_28_outliers_without_a_false_alarm(
        self, real_tosses: list[Toss], tolerance: float, seed: int
    ) -> None:
        """In half widths per second, as method.md 2.1 has them."""
        config = GateConfig(impulse_tolerance=tolerance * CONTACTNETS_CUBE.length_scale)
        tosses, outliers = contaminated(real_tosses, 28, seed)
        assert self.impulse_flags(tosses, config) == outliers

    def test_with_a_narrow_cone_two_clean_tosses_are_flagged(self, real_tosses: list[Toss]) -> None:
        config = GateConfig(impulse_tolerance=1.5 * CONTACTNETS_CUBE.length_scale, largest_friction=0.3)
        assert len(self.impulse_flags(real_tosses, config)) == 2

    def test_a_median_hides_outliers_from_the_impulse_gate_but_not_from_the_jump_gate(self, real_tosses: list[Toss]) -> None:
        tosses, outliers = contaminated(real_tosses, 28, 0, velocities="filtered")
        assert len(self.impulse_flags(tosses, CONFIG)) <= 1
        jumps = {
            number
            for number, toss in enumerate(tosses)
            if any(line.startswith("displacement") for line in inspect(toss, CUBE, CONFIG))
        }
        assert jumps == outliers

    @pytest.mark.parametrize("frames", [2, 3])
    def test_outliers_of_two_and_three_frames_after_filtering_are_caught(self, real_tosses: list[Toss], frames: int) -> None:
        tosses, outliers = contaminated(real_tosses, 28, 0, frames=frames)
        assert self.impulse_flags(tosses, CONFIG) == outliers


@pytest.mark.parametrize("rate", [60, 120])
def test_an_outlier_of_a_slow_camera_is_found_wherever_it_is_and_none_without(rate: int) -> None:
    (toss,) = cut(stream(period_ns=round(1e9 / rate)))
    assert isinstance(toss, Toss)
    assert inspect(toss, CUBE, CONFIG) == ()
    for frame in range(3, toss.frames - 3):
        positions = toss.positions.copy()
        positions[frame] += [0.004, -0.006, 0.006]
        rates = kinematics(toss.stamps_ns, positions, toss.orientations_wxyz)
        velocities = np.concatenate([toss.linear_velocities[:1], rates.linear_velocities[1:]])  # the first knows one frame more
        assert inspect(replace(toss, positions=positions, linear_velocities=velocities), CUBE, CONFIG), frame
