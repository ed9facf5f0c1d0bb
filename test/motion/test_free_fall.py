"""The detector of free fall, frame by frame, sees what the kinematics of the whole run show."""

import numpy as np
import pytest

from contact_curation.geometry import quaternions
from contact_curation.motion.smoothing import kinematics
from contact_curation.motion.toss_rules import MEMORY, FallDetector


def test_its_accelerations_are_those_of_the_kinematics_one_frame_later() -> None:
    rng = np.random.default_rng(2)
    stamps = np.cumsum(rng.integers(6_000_000, 7_500_000, 30)).astype(np.int64)
    heights = rng.normal(size=30)
    positions = np.outer(heights, [0.0, 0.0, 1.0])
    whole = kinematics(stamps, positions, np.tile(quaternions.IDENTITY, (30, 1)))
    detector = FallDetector()
    for frame, (stamp, height) in enumerate(zip(stamps.tolist(), heights.tolist())):
        detector.push(stamp, height)
        if frame >= 2:
            assert detector.velocity == pytest.approx(whole.linear_velocities[frame - 1, 2], rel=1e-12)
            assert detector.accelerations[0] == pytest.approx(whole.accelerations[frame - 1, 2], rel=1e-12, abs=1e-9)


def test_the_last_frames_give_back_its_state() -> None:
    rng = np.random.default_rng(5)
    frames = [(6_756_757 * (number + 1), float(height)) for number, height in enumerate(rng.normal(size=25))]
    through, again = FallDetector(), FallDetector()
    for stamp, height in frames:
        through.push(stamp, height)
    for stamp, height in frames[-MEMORY:]:
        again.push(stamp, height)
    assert again == through


@pytest.mark.parametrize(
    ("earlier", "later", "falls"),
    [
        (-9.81, -9.81, True),
        (-6.80, -12.8, False),  # one does not fall fast enough
        (-6.82, -12.0, True),
        (-8.80, -8.79, False),  # the mean is off by more than 1
        (-8.82, -8.82, True),
        (-10.9, -10.8, False),
        (0.0, 0.0, False),
    ],
)
def test_the_published_bounds_hold_from_both_sides(earlier: float, later: float, falls: bool) -> None:
    assert FallDetector(accelerations=(later, earlier)).falls(9.81, 3.0, 1.0) is falls
