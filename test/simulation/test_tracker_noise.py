"""The tracker's faults have the sizes and shares that are asked for, and hang on seed and stamp alone."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.tracker_noise import BLOCK, TrackerNoise, TrackerNoiseConfig
from test.simulated import RIG_NOISE

TRUE = Pose(np.array([0.1, -0.2, 0.3]), quaternions.normalized([0.8, 0.3, -0.4, 0.2]))
NONE = TrackerNoiseConfig(position=0.0, turn=0.0)
FRAMES = 4000
PERIOD_NS = round(TrackerNoiseConfig().frame_period * 1e9)


def errors_of(config: TrackerNoiseConfig, seed: int = 0, frames: int = FRAMES) -> list[Array | None]:
    """Per frame the position's error [m] and the turn's about the body's axes [rad] (6,); None where it is lost."""
    tracker = TrackerNoise(config, seed)
    found = [tracker.seen(stamp_ns, TRUE) for stamp_ns in range(0, frames * PERIOD_NS, PERIOD_NS)]
    return [None if pose is None else _error(pose) for pose in found]


def test_white_noise_is_that_of_the_real_rig() -> None:
    errors = np.array(errors_of(TrackerNoiseConfig()))
    np.testing.assert_allclose(errors.std(axis=0), np.repeat([RIG_NOISE.position, RIG_NOISE.orientation], 3), rtol=0.05)
    np.testing.assert_allclose(errors.mean(axis=0) / errors.std(axis=0), 0.0, atol=0.06)
    successive = (errors[1:] * errors[:-1]).mean(axis=0) / errors.var(axis=0)
    np.testing.assert_allclose(successive, 0.0, atol=0.06)


def test_spikes_come_as_often_and_are_as_far_off_as_wanted() -> None:
    errors = np.array(errors_of(replace(NONE, spike_rate=0.1, spike_position=0.01, spike_turn=0.2)))
    spikes = np.abs(errors).max(axis=1) > 1e-12
    assert spikes.mean() == pytest.approx(0.1, abs=0.015)
    np.testing.assert_allclose(errors[spikes].std(axis=0), [0.01] * 3 + [0.2] * 3, rtol=0.15)


def test_losses_begin_as_often_and_last_as_long_as_wanted() -> None:
    lost = np.array([error is None for error in errors_of(replace(NONE, dropout_rate=0.02, dropout_frames=5.0))])
    ends = np.flatnonzero(np.diff(np.concatenate([[0], lost.astype(int), [0]])))
    lengths = ends[1::2] - ends[::2]
    begun = len(lengths) / (~lost).sum()
    assert begun == pytest.approx(0.02, rel=0.25)
    assert lengths.mean() == pytest.approx(5.0, rel=0.25)


def test_without_faults_poses_come_as_they_are() -> None:
    np.testing.assert_allclose(np.array(errors_of(NONE, frames=20)), 0.0, atol=1e-15)


def test_noise_hangs_on_seed_and_stamp_alone() -> None:
    config = TrackerNoiseConfig()
    late = TrackerNoise(config, 5).seen(77 * PERIOD_NS, TRUE)
    assert late is not None
    np.testing.assert_array_equal(_error(late), errors_of(config, seed=5, frames=78)[77])
    other = TrackerNoise(config, 6).seen(77 * PERIOD_NS, TRUE)
    assert other is not None
    assert not np.array_equal(other.position, late.position)


def test_a_tracker_that_is_started_again_says_the_same_of_every_instant() -> None:
    config = TrackerNoiseConfig(spike_rate=0.05, dropout_rate=0.03, dropout_frames=40.0)
    whole = errors_of(config, seed=2, frames=2500)
    assert any(one is None for one in whole)
    for frame in np.random.default_rng(0).permutation(2500)[:400].tolist():
        pose = TrackerNoise(config, 2).seen(frame * PERIOD_NS, TRUE)
        assert (pose is None) == (whole[frame] is None)
        if pose is not None:
            np.testing.assert_array_equal(_error(pose), whole[frame])


def test_a_throw_is_seen_in_the_same_way_whenever_it_is_made_and_another_one_in_another_way() -> None:
    tracker = TrackerNoise(TrackerNoiseConfig(dropout_rate=0.05), 3)

    def seen(throw_id: str, begun_ns: int, jitter_ns: int = 0) -> list[Array | None]:
        stamps_ns = [begun_ns + frame * PERIOD_NS + jitter_ns for frame in range(300)]
        poses = [tracker.seen(stamp_ns - begun_ns, TRUE, throw_id) for stamp_ns in stamps_ns]
        return [None if pose is None else pose.position for pose in poses]

    def same(one: list[Array | None], other: list[Array | None]) -> bool:
        return all(np.array_equal(a, b) if a is not None and b is not None else a is b for a, b in zip(one, other, strict=True))

    first = seen("cube-throw-1", 10**18)
    assert same(first, seen("cube-throw-1", 5 * 10**17 + 12345, jitter_ns=1))
    assert not same(first, seen("cube-throw-2", 10**18))


def test_of_the_spoilt_throw_as_many_poses_are_far_off_as_asked_for_and_of_no_other() -> None:
    tracker = TrackerNoise(replace(NONE, spoilt_throw="cube-throw-5", spoilt_rate=0.1), 0)

    def far(throw_id: str) -> float:
        poses = [tracker.seen(frame * PERIOD_NS, TRUE, throw_id) for frame in range(2000)]
        return float(np.mean([pose is not None and not np.array_equal(pose.position, TRUE.position) for pose in poses]))

    assert far("cube-throw-5") == pytest.approx(0.1, abs=0.02)
    assert far("cube-throw-4") == far("") == 0.0


def test_losses_go_on_from_one_block_of_frames_into_the_next() -> None:
    config = replace(NONE, dropout_rate=0.02, dropout_frames=100.0)
    across = 0
    for seed in range(20):
        tracker = TrackerNoise(config, seed)
        before, after = (tracker.seen(frame * PERIOD_NS, TRUE) for frame in (BLOCK - 1, BLOCK))
        across += before is None and after is None
    assert across > 5  # two thirds of the time is lost


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("position", -1.0),
        ("turn", np.nan),
        ("spike_rate", 1.1),
        ("dropout_rate", -0.1),
        ("dropout_frames", 0.5),
        ("dropout_frames", 1e4),
        ("frame_period", 0.0),
        ("latency", -1.0),
        ("spoilt_rate", 1.5),
    ],
)
def test_faults_that_cannot_be_are_refused(field: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=field):
        replace(TrackerNoiseConfig(), **{field: value})  # type: ignore[arg-type]


def _error(pose: Pose) -> Array:
    turn = quaternions.log(quaternions.multiply(quaternions.conjugate(TRUE.orientation_wxyz), pose.orientation_wxyz))
    return np.concatenate([pose.position - TRUE.position, turn])
