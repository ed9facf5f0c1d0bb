"""Bodies that slide tell their friction; those in the air do not, and the interval of a median of few holds the truth."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.learning.evaluation.misfit import sliding_of
from contact_curation.motion.survey.sliding import Sliding, sliding
from contact_curation.motion.toss import Toss

FRICTION, GRAVITY, RATE = 0.4, 9.81, 250.0
RADIUS = float(np.linalg.norm(CUBE.vertices, axis=1).max())


def thrown(flight: int, slide: int, seed: int = 0, friction: float = FRICTION) -> Toss:
    """So many frames about the top of a flight, then others in which it slides; it never turns."""
    falls = -GRAVITY * (np.arange(flight) - 0.5 * flight) / RATE
    forward = np.concatenate([np.full(flight, 1.5), 1.5 - friction * GRAVITY * np.arange(slide) / RATE])
    count = flight + slide
    linear = np.column_stack([forward, np.zeros(count), np.concatenate([falls, np.zeros(slide)])])
    linear += 1e-3 * np.random.default_rng(seed).standard_normal((count, 3))
    positions = np.cumsum(linear, axis=0) / RATE
    stamps = np.rint(1e9 * np.arange(count) / RATE).astype(np.int64)
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    return Toss("one", "cube", "here", 1.0 / RATE, stamps, positions, turns, linear, np.zeros((count, 3)))


def test_a_body_at_the_top_of_its_flight_does_not_slide() -> None:
    assert len(sliding([thrown(10, 0, seed) for seed in range(8)], RADIUS, GRAVITY).friction) == 0


def test_frames_in_the_air_before_it_slides_do_not_lower_its_friction() -> None:
    found = sliding([thrown(60, 30)], RADIUS, GRAVITY)
    assert found.friction == pytest.approx([FRICTION], rel=0.02)


def test_no_real_toss_slides_otherwise_than_the_others(real_tosses: list[Toss]) -> None:
    found = sliding(real_tosses, RADIUS, GRAVITY)
    off = np.abs(found.friction - found.median)
    assert len(found.friction) == 528
    assert not found.apart.any()
    assert (off / found.median).max() < 0.23
    assert (off / np.hypot(found.scatter, found.error)).max() < 4.0


@pytest.mark.parametrize(
    ("scatter", "other", "apart"),
    [(0.01, 0.40, True), (0.005, 0.25, False), (0.05, 0.40, False), (0.01, 0.05, True)],
    ids=["far", "less than 0.3 of the median", "less than five deviations", "far below"],
)
def test_a_toss_slides_otherwise_where_its_friction_is_far_and_surely_off(scatter: float, other: float, apart: bool) -> None:
    friction = np.append(0.2 + scatter * np.array([-1.5, -1.0, -0.5, 0.0, 0.0, 0.5, 1.0, 1.5]), other)
    found = Sliding(friction, np.full(len(friction), 1e-3))
    assert found.apart.tolist() == [False] * 8 + [apart]


def test_a_toss_that_is_pushed_along_so_that_it_becomes_faster_slides_otherwise() -> None:
    tosses = [thrown(0, 30, seed, -0.1 if seed == 3 else FRICTION) for seed in range(8)]
    found = sliding_of(tosses, CUBE)
    assert found is not None
    assert np.flatnonzero(found.apart).tolist() == [3]
    assert sliding_of(tosses[3:4] * 5, CUBE) is None


@pytest.mark.parametrize("count", [5, 8, 16])
def test_the_interval_of_a_median_of_few_tosses_holds_the_truth_in_95_of_100(count: int) -> None:
    drawn = FRICTION + 0.02 * np.random.default_rng(count).standard_normal((2000, count))
    found = [Sliding(friction, np.full(count, 1e-6)) for friction in drawn]
    assert np.mean([abs(one.median - FRICTION) < one.median_interval for one in found]) == pytest.approx(0.945, abs=0.02)
