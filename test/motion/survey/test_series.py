"""Successive poses: two cameras that see by turns."""

import numpy as np
import pytest

from contact_curation.motion.survey.series import PoseSeries


def series(stamps_ns: np.ndarray) -> PoseSeries:
    count = len(stamps_ns)
    return PoseSeries(stamps_ns, np.arange(3.0 * count).reshape(count, 3), np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)))


@pytest.mark.parametrize("count", [60, 61])
@pytest.mark.parametrize("first", [0, 1])
def test_of_two_cameras_one_is_left(count: int, first: int) -> None:
    """With an odd number of poses both steps are there equally often, and their median is neither."""
    stamps = 10_000_000 * np.arange(count)
    stamps[first::2] += 3_000_000
    found = series(stamps)
    assert found.pair_period == pytest.approx(0.02)
    one = found.of_one_camera()
    assert abs(len(one) - 0.5 * count) <= 1.0
    np.testing.assert_allclose(one.steps[1:], 0.02)  # a first pose may be the other camera's
    assert one.pair_period == 0.0


def test_jitter_and_lost_frames_are_no_second_camera() -> None:
    rng = np.random.default_rng(0)
    even = 10_000_000 * np.arange(400)
    for stamps in (even, even + rng.integers(-2_000_000, 2_000_000, 400), even[rng.random(400) > 0.4]):
        found = series(stamps)
        assert found.pair_period == 0.0
        assert found.of_one_camera() is found
