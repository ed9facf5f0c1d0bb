"""How much poses scatter, told by themselves."""

import numpy as np
import pytest

from contact_curation.motion.pose_noise import FEWEST, RIG_NOISE, PoseNoise
from test.motion.streams import noisy, stream


def followed(multiple: float, period_ns: int = 10**9 // 148, frames: int | None = None) -> PoseNoise:
    noise = PoseNoise()
    for one in noisy(stream(period_ns=period_ns), multiple)[:frames]:
        noise.push(one.stamp_ns, one.pose.position)
    return noise


@pytest.mark.parametrize("multiple", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("rate", [60, 148, 240])
def test_the_noise_of_a_toss_is_found_at_any_rate(multiple: float, rate: int) -> None:
    assert followed(multiple, 10**9 // rate).multiple == pytest.approx(multiple, rel=0.3)


def test_poses_without_noise_and_too_few_poses_say_nothing() -> None:
    assert followed(0.0).multiple < 0.05
    assert followed(5.0, frames=FEWEST // 2).multiple == 0.0


def test_far_more_noise_than_was_told_is_a_line_that_says_what_to_tell() -> None:
    noise = followed(5.0)
    line = noise.warning(1.0)
    assert line.startswith("found positions that scatter by 0.1")
    assert "expected 0.022 mm" in line
    assert "say segmenter.tracker_noise=" in line
    assert followed(20.0).warning(1.0).endswith("smooth them, or take fewer a second")
    assert noise.warning(5.0) == followed(1.0).warning(1.0) == ""


def test_a_body_that_is_carried_about_is_not_noise() -> None:
    noise, rng = PoseNoise(), np.random.default_rng(0)
    for frame in range(600):
        time = frame / 60.0
        x, y = 0.3 * np.sin(2.0 * time) + RIG_NOISE * rng.standard_normal(), 0.2 * np.cos(3.0 * time)
        noise.push(round(frame * 1e9 / 60.0), (float(x), float(y + RIG_NOISE * rng.standard_normal()), 0.4))
    assert noise.multiple < 1.6


def test_rounded_poses_scatter_by_what_is_rounded_and_poses_told_twice_are_no_rest() -> None:
    rounded, twice = PoseNoise(), PoseNoise()
    for number, one in enumerate(noisy(stream(), 5.0)):
        x, y, z = (round(each, 3) for each in one.pose.position)
        rounded.push(one.stamp_ns, (x, y, z))
        if number < 80:
            twice.push(one.stamp_ns, one.pose.position)
    for number in range(500):
        twice.push(10**11 + number * 10**9 // 148, (0.0, 0.0, 0.05))
    assert rounded.multiple > 5.0
    assert twice.multiple == pytest.approx(5.0, rel=0.4)


def test_poses_that_come_slowly_say_nothing() -> None:
    assert followed(5.0, 10**9 // 20).multiple == 0.0


def test_neither_a_gap_nor_a_jump_of_the_clock_is_noise() -> None:
    noise = PoseNoise()
    for toss, start_ns in enumerate((5 * 10**9, 9 * 10**9, 2 * 10**9)):
        if toss == 2:
            noise.reset()
        for one in stream(start_ns=start_ns)[:: 1 + toss % 2]:
            x, y, z = one.pose.position
            noise.push(one.stamp_ns, (x + 10.0 * toss, y, z))
    assert noise.multiple < 0.5
