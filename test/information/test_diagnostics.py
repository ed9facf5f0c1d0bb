"""A selected set is measured against its pool: spectrum, efficiencies, shares (method.md 1.9, 2.2, 2.3)."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.linalg import eigh

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.curation import curate
from contact_curation.information.diagnostics import (
    block_shares,
    dominance_warnings,
    efficiency,
    smallest_sufficient_k,
    spectral_distance,
)
from contact_curation.information.optimum_shift import PoolScores, optimum_shift
from contact_curation.information.pool import CHUNK, pool_of
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.subspace import identifiable_subspace
from test.information.pools import rescaled, toss, tosses

INFOS = tosses(90, 5, 4, seed=0)
POOL = pool_of(INFOS)
SUBSPACE = identifiable_subspace(POOL.fisher)
KEPT = ("toss-0003", "toss-0010", "toss-0020", "toss-0080")


def relative_spectrum(kept: Sequence[str], weights: Sequence[float]) -> Array:
    """Generalised eigenvalues of the weighted selected set against the pool."""
    by_id = {info.toss_id: info for info in INFOS}
    subset = sum(weight * by_id[toss_id].fisher() for toss_id, weight in zip(kept, weights, strict=True))
    return np.asarray(eigh(subset, sum(info.fisher() for info in INFOS), eigvals_only=True))


def test_the_spectrum_is_that_of_the_kept_set_relative_to_the_pool() -> None:
    plain = spectral_distance(POOL, SUBSPACE, KEPT)
    np.testing.assert_allclose(plain.eigenvalues, relative_spectrum(KEPT, [1.0] * 4), rtol=1e-8)
    rescaled_set = spectral_distance(POOL, SUBSPACE, KEPT, 90 / 4)
    np.testing.assert_allclose(rescaled_set.eigenvalues, plain.eigenvalues * 90 / 4, rtol=1e-12)
    weights = np.array([1.0, 2.0, 3.0, 0.5])
    weighted = spectral_distance(POOL, SUBSPACE, KEPT, weights)
    np.testing.assert_allclose(weighted.eigenvalues, relative_spectrum(KEPT, weights.tolist()), rtol=1e-8)


def test_epsilon_looks_at_both_ends_of_the_spectrum() -> None:
    plain = spectral_distance(POOL, SUBSPACE, KEPT)
    assert plain.epsilon == pytest.approx(1.0 - plain.eigenvalues[0])
    inflated = spectral_distance(POOL, SUBSPACE, KEPT, 1e3)
    assert inflated.epsilon == pytest.approx(inflated.eigenvalues[-1] - 1.0)
    assert spectral_distance(POOL, SUBSPACE, POOL.ids).epsilon < 1e-9


def test_horvitz_thompson_weights_are_right_on_average() -> None:
    rng = np.random.default_rng(1)
    chances = rng.uniform(0.2, 0.9, len(POOL))
    total = np.zeros((5, 5))
    for _ in range(400):
        drawn = rng.uniform(size=len(POOL)) < chances
        rows = POOL.stacked(np.flatnonzero(drawn)) @ SUBSPACE.whitening
        total += np.einsum("kra,krb,k->ab", rows, rows, 1.0 / chances[drawn]) / 400
        kept = [POOL.ids[i] for i in np.flatnonzero(drawn)]
        distance = spectral_distance(POOL, SUBSPACE, kept, 1.0 / chances[drawn])
        assert distance.eigenvalues.sum() == pytest.approx(np.einsum("kra,kra,k->", rows, rows, 1.0 / chances[drawn]))
    np.testing.assert_allclose(total, np.eye(5), atol=0.1)


@pytest.mark.parametrize("rescale", [False, True])
@pytest.mark.parametrize("epsilon", [3.0, 0.9, 0.45, 0.3, 0.2, 0.05])
@pytest.mark.parametrize("criterion", ["leverage", "random"])
def test_the_smallest_sufficient_set_is_the_first_that_is_near_enough(epsilon: float, criterion: str, rescale: bool) -> None:
    assert len(POOL) > CHUNK
    order = rank(INFOS, RankingConfig(criterion)).ids
    found = smallest_sufficient_k(POOL, SUBSPACE, order, epsilon, rescaled=rescale)
    distances = [spectral_distance(POOL, SUBSPACE, order[:k], 90 / k if rescale else 1.0).epsilon for k in range(1, 91)]
    assert found == 1 + next(i for i, distance in enumerate(distances) if distance <= epsilon)


def test_a_set_that_is_just_near_enough_is_sufficient() -> None:
    pool = pool_of([toss(name, np.eye(2)) for name in "abcd"])
    subspace = identifiable_subspace(pool.fisher)
    assert [smallest_sufficient_k(pool, subspace, pool.ids, epsilon) for epsilon in (0.75, 0.5, 0.49, 0.25)] == [1, 2, 3, 3]


def test_no_part_of_an_order_may_be_sufficient() -> None:
    assert smallest_sufficient_k(POOL, SUBSPACE, POOL.ids[:2], 0.1) is None
    assert smallest_sufficient_k(POOL, SUBSPACE, (), 0.1) is None


def test_the_whole_pool_has_efficiency_one() -> None:
    whole = efficiency(POOL, SUBSPACE, POOL.ids)
    assert whole.determinant == pytest.approx(1.0)
    assert whole.smallest == pytest.approx(1.0)
    assert efficiency(POOL, SUBSPACE, POOL.ids, per_transition=True).determinant == pytest.approx(1.0)


def test_efficiency_is_per_toss_or_per_transition() -> None:
    values = relative_spectrum(KEPT, [1.0] * 4)
    per_toss = efficiency(POOL, SUBSPACE, KEPT)
    assert per_toss.determinant == pytest.approx(np.prod(values * 90 / 4) ** (1 / 5), rel=1e-8)
    assert per_toss.smallest == pytest.approx(values[0] * 90 / 4, rel=1e-8)
    counts = {info.toss_id: info.transitions for info in INFOS}
    share = sum(counts[toss_id] for toss_id in KEPT) / sum(counts.values())
    assert efficiency(POOL, SUBSPACE, KEPT, per_transition=True).smallest == pytest.approx(values[0] / share, rel=1e-8)


def test_a_curation_is_the_ranking_with_its_diagnostics() -> None:
    config = RankingConfig("trace", top=4)
    found = curate(INFOS, config)
    selected = found.ranking.selected_ids
    assert found.ranking == rank(INFOS, config)
    assert found.dimension == 5
    plain, scaled = (spectral_distance(POOL, SUBSPACE, selected, weight) for weight in (1.0, 90 / 4))
    np.testing.assert_allclose(found.spectrum, scaled.eigenvalues, rtol=1e-12)
    assert (found.raw_epsilon, found.epsilon) == pytest.approx((plain.epsilon, scaled.epsilon), rel=1e-12)
    assert found.sufficient_k == smallest_sufficient_k(POOL, SUBSPACE, found.ranking.ids, 0.5)
    assert found.efficiency == efficiency(POOL, SUBSPACE, selected)
    assert found.frame_efficiency == efficiency(POOL, SUBSPACE, selected, per_transition=True) != found.efficiency
    assert found.block_shares == block_shares(INFOS)
    assert found.warnings == found.ranking.diagnostics
    shift = optimum_shift(POOL, SUBSPACE.per_mean_toss(90), POOL.indices_of(selected), 1e-3)
    assert found.optimum_shift == shift
    assert shift.to_mapping() == {"distance": shift.distance, "at_random": shift.at_random}


def test_the_optimum_of_a_set_is_its_newton_step_beside_the_pools() -> None:
    delta, chosen = 0.2, np.array([3, 10, 20])
    coordinates = SUBSPACE.per_mean_toss(90)
    scores = np.array([info.score_sum for info in INFOS]) @ coordinates
    scores /= np.sqrt(scores.var(axis=0).mean())
    matrix = delta * np.eye(5) + coordinates.T @ sum(INFOS[i].fisher() for i in chosen) @ coordinates
    off = np.linalg.solve(matrix, scores[chosen].sum(axis=0)) - scores.sum(axis=0) / (delta + 90)
    found = optimum_shift(POOL, coordinates, chosen, delta)
    assert found.distance == pytest.approx(np.sqrt(np.square(off).mean()), rel=1e-9)
    assert 0.1 * found.distance < found.at_random < 10.0 * found.distance
    alike = pool_of([toss(name, np.eye(2)) for name in "abc"])
    same = PoolScores.of(alike, np.eye(2), delta)
    assert same.scatter == 0.0
    np.testing.assert_allclose(same.scores, np.ones((3, 2)))
    silent = pool_of([toss(name, np.zeros((1, 2))) for name in "abc"])
    assert not PoolScores.of(silent, np.eye(2), delta).scores.any()


def test_efficiency_does_not_depend_on_units() -> None:
    scaled = pool_of([rescaled(info, np.array([1e3, 1e-3, 1.0, 5.0, 0.1])) for info in INFOS])
    there = efficiency(scaled, identifiable_subspace(scaled.fisher), KEPT)
    assert there.determinant == pytest.approx(efficiency(POOL, SUBSPACE, KEPT).determinant, rel=1e-8)


def test_a_set_that_misses_a_direction_has_no_efficiency() -> None:
    nearly = pool_of([toss("toss-other", np.eye(3)), toss("toss-single", np.diag([3.0, 1e-2, 0.7e-6]))])
    for pool in (pool_of([*INFOS, toss("toss-single", np.eye(5)[:1])]), nearly):
        nothing = efficiency(pool, identifiable_subspace(pool.fisher), ["toss-single"])
        assert nothing.determinant == nothing.smallest == 0.0


def test_impossible_questions_are_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"^selected tosses: found none, expected at least one$"):
        efficiency(POOL, SUBSPACE, [])
    with pytest.raises(InvalidValueError, match=r"^weights of the selected tosses: found shape \(3,\), expected \(4,\)$"):
        spectral_distance(POOL, SUBSPACE, KEPT, np.ones(3))
    with pytest.raises(InvalidValueError, match="nobody"):
        spectral_distance(POOL, SUBSPACE, ["nobody"])
    with pytest.raises(InvalidValueError, match=r"^tosses: found none, expected at least one$"):
        block_shares([])


def test_a_block_with_over_half_of_the_trace_is_warned_of() -> None:
    even = [toss("a", np.eye(4)), toss("b", np.eye(4))]
    assert [share.share for share in block_shares(even)] == [0.5, 0.5]
    assert dominance_warnings(block_shares(even)) == ()
    uneven = [*even, toss("c", np.array([[0.0, 0.0, 0.0, 2.0]]))]
    shares = block_shares(uneven)
    assert [(share.name, round(share.share, 12)) for share in shares] == [
        ("first", round(4 / 12, 12)),
        ("second", round(8 / 12, 12)),
    ]
    assert dominance_warnings(shares) == (
        "block second holds 67 % of the trace: a trace ranking is mostly a ranking by that block",
    )
    assert rank(uneven, RankingConfig("trace", top=2)).diagnostics == dominance_warnings(shares)
    assert rank(uneven, RankingConfig("longest", top=2)).diagnostics == ()  # which no trace decides
    assert [share.share for share in block_shares([toss("silent", np.zeros((1, 4)))])] == [0.0, 0.0]
