"""Tilt and height of the ground can be taken about any point: the information is the same, in other coordinates.

The tosses here come from first principles: with the gap phi = n(tilt) . (y - pivot) - height the score of a contact at y is
f (b_a . (y - pivot)) in the tilts and -f in the height, f being the derivative by phi.
"""

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import about_centroids, pool_centroid, pool_of, sheared
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from test.information.pools import blocks_of, toss

AXES = np.array([[1.0, 0.0, 0.1], [0.0, 1.0, -0.2]])
BLOCKS = blocks_of([("vertices", 3), ("tilt", 2), ("height", 1)])


def scored(toss_id: str, seed: int, pivot: Array | None = None, moved: Array | None = None) -> TossInformation:
    """A toss of 40 contacts about `pivot`, its own centroid when not given; the whole board may be moved."""
    rng = np.random.default_rng(seed)
    positions = rng.normal(0.0, 2.0, 3) + rng.standard_normal((40, 3)) + (0.0 if moved is None else moved)
    forces = rng.standard_normal(40)
    origin = positions.mean(axis=0) if pivot is None else pivot
    tilt = forces[:, None] * ((positions - origin) @ AXES.T)
    scores = np.concatenate([rng.standard_normal((40, 3)), tilt, -forces[:, None]], axis=1)
    return toss(toss_id, scores, blocks=BLOCKS, centroid=origin, tilt_axes=AXES)


POINT = np.array([3.0, -2.0, 0.5])


def moved_to(info: TossInformation, pivot: Array) -> tuple[Array, Array]:
    """Factor and score sum of a toss about another pivot."""
    shift = AXES @ (pivot - info.centroid)
    return sheared(info.factor.astype(float), BLOCKS, shift), sheared(info.score_sum, BLOCKS, shift)


def test_moving_the_pivot_gives_what_scoring_about_it_gives() -> None:
    direct = scored("a", 0, pivot=POINT)
    factor, score_sum = moved_to(scored("a", 0), POINT)
    np.testing.assert_allclose(factor, direct.factor, atol=1e-12)
    np.testing.assert_allclose(score_sum, direct.score_sum, atol=1e-12)


def test_only_the_tilt_changes() -> None:
    before, (after, _) = scored("a", 1).factor, moved_to(scored("a", 1), POINT)
    np.testing.assert_array_equal(before[:, [0, 1, 2, 5]], after[:, [0, 1, 2, 5]])
    assert abs(np.square(after[:, 3:5]).sum() / np.square(before[:, 3:5]).sum() - 1.0) > 0.1


def test_whole_matrices_move_as_their_factors_do() -> None:
    infos = [scored(name, seed, pivot=np.zeros(3)) for seed, name in enumerate("abc")]
    centroids = np.random.default_rng(9).standard_normal((3, 3))
    fishers = np.stack([info.fisher() for info in infos])
    moved, score_sums = about_centroids(fishers, np.stack([info.score_sum for info in infos]), BLOCKS, centroids @ AXES.T)
    for k, centroid in enumerate(centroids):
        direct = scored("abc"[k], k, pivot=centroid)
        np.testing.assert_allclose(moved[k], direct.fisher(), atol=1e-10)
        np.testing.assert_allclose(score_sums[k], direct.score_sum, atol=1e-11)


def test_the_centroid_of_a_pool_weighs_tosses_by_their_transitions() -> None:
    one, other = (
        toss(name, np.ones((count, 2)), centroid=np.full(3, place)) for name, count, place in (("a", 3, 0.0), ("b", 1, 4.0))
    )
    np.testing.assert_allclose(pool_centroid([one, other]), [1.0, 1.0, 1.0])


def test_models_without_a_tilt_stay_as_they_are() -> None:
    infos = [toss("a", np.ones((2, 3))), toss("b", np.eye(3))]
    np.testing.assert_array_equal(pool_of(infos).stacked([1])[0], np.eye(3))


def test_a_pool_adds_its_tosses_about_its_centroid() -> None:
    infos = [scored(name, seed) for seed, name in enumerate("abcd")]
    pool = pool_of(infos)
    direct = [scored(name, seed, pivot=pool.pivot) for seed, name in enumerate("abcd")]
    np.testing.assert_allclose(pool.fisher, sum(info.fisher() for info in direct), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(pool.toss_scores, [info.score_sum for info in direct], atol=1e-11)
    np.testing.assert_allclose(pool.stacked([2])[0], direct[2].factor, atol=1e-12)


@pytest.mark.parametrize("criterion", ["trace", "log-det", "min-eig", "orthogonal", "leverage"])
def test_no_ranking_depends_on_where_the_boards_origin_lies(criterion: str) -> None:
    names = [f"toss-{k:02d}" for k in range(20)]
    here = [scored(name, seed) for seed, name in enumerate(names)]
    there = [scored(name, seed, moved=np.array([30.0, -20.0, 0.0])) for seed, name in enumerate(names)]
    config = RankingConfig(criterion=criterion, top=6)
    one, other = rank(here, config), rank(there, config)
    assert one.ids == other.ids
    np.testing.assert_allclose([e.score for e in one.entries], [e.score for e in other.entries], rtol=1e-8)
