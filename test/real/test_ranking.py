"""What rankings of ContactNets' tosses must satisfy, and how near they come to the figures of method.md 1.5 and 1.9."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator, evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.trace import NORMALISATIONS, TraceHeap, toss_trace
from contact_curation.information.curation import curate
from contact_curation.information.diagnostics import smallest_sufficient_k, spectral_distance
from contact_curation.information.factors import Compression
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, criterion_names, rank, rank_particles
from contact_curation.information.ranking import Ranking, spearman, top_overlap
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.information.subspace import identifiable_subspace
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions
from test.contact.cases import noisy_geometry
from test.information.toss_fishers import fisher_coherent, fisher_mean, fisher_sum
from test.real.scored_pools import TRUE, scored_pool

Tosses = tuple[Toss, ...]
ESTIMATORS = pytest.mark.parametrize("estimator", list(Estimator))
EPSILONS = (0.5, 0.2, 0.1)


def by(criterion: str, pool: Pool, top: int = 32, seed: int = 0) -> Ranking:
    return rank_particles([pool], RankingConfig(criterion, top=top, seed=seed))


# What a trace is


@pytest.mark.slow
def test_every_trace_is_that_of_the_scores_of_its_transitions(real_tosses: Tosses, real_transitions: Transitions) -> None:
    """method.md 6.6: sum and mean differ by exactly the number of transitions."""
    rows = real_transitions
    chart = parameter_form(TRUE, Form.CONTACTNETS).chart
    scores = evaluate(TRUE, CONTACTNETS_CUBE, rows.before, rows.after, rows.dt).scores @ chart
    pool = scored_pool(real_tosses, Estimator.EMPIRICAL, Form.CONTACTNETS)
    by_normalisation = {"sum": fisher_sum, "mean": fisher_mean, "coherent": fisher_coherent}
    for info, first, last in zip(pool.infos, rows.starts[:-1], rows.starts[1:], strict=True):
        found = {name: toss_trace(info, name) for name in NORMALISATIONS}
        for name, fisher in by_normalisation.items():
            assert found[name] == pytest.approx(np.trace(fisher(scores[first:last])), rel=1e-9), name
        assert found["mean"] * (last - first) == pytest.approx(found["sum"], rel=1e-15)


@pytest.mark.slow
@ESTIMATORS
def test_the_trace_of_a_union_is_the_sum_of_the_traces(real_tosses: Tosses, estimator: Estimator) -> None:
    """method.md 6.6, of pooled information as rankings use it: 24 rows of each toss keep 99.9 % of the smallest of them."""
    infos = scored_pool(real_tosses, estimator, Form.CONTACTNETS).infos
    together = np.trace(pool_of(infos).fisher)
    for seed, cut in enumerate((1, 200, 569)):
        order = np.random.default_rng(seed).permutation(len(infos))
        parts = [pool_of(infos[i] for i in part) for part in (order[:cut], order[cut:])]
        assert together == pytest.approx(sum(np.trace(part.fisher) for part in parts), rel=1e-12)
    assert all(0.999 < np.trace(info.fisher()) / info.trace < 1.0 + 1e-7 for info in infos)


@pytest.mark.slow
@ESTIMATORS
@pytest.mark.parametrize("normalisation", NORMALISATIONS)
def test_a_stream_keeps_exactly_the_top_k(real_tosses: Tosses, estimator: Estimator, normalisation: str) -> None:
    """method.md 6.6, for tosses in any order."""
    pool = scored_pool(real_tosses, estimator)
    for top in (1, 32, 200):
        batch = rank_particles([pool], RankingConfig("trace", top=top, normalisation=normalisation)).selected_ids
        for seed in range(2):
            heap = TraceHeap(top, normalisation)
            for index in np.random.default_rng(seed).permutation(len(pool)):
                heap.offer(pool.infos[index])
            assert tuple(info.toss_id for info in heap.selected) == batch


# What a ranking does not depend on


@pytest.mark.parametrize(
    "criterion",
    [pytest.param(one, marks=pytest.mark.slow if one in ("v-optimal", "min-eig") else ()) for one in criterion_names()],
)
def test_curating_does_not_depend_on_the_order_of_the_tosses(real_tosses: Tosses, criterion: str) -> None:
    infos = scored_pool(real_tosses, Estimator.GAUSS_NEWTON).infos
    expected = curate(infos, RankingConfig(criterion))
    shuffled = [infos[i] for i in np.random.default_rng(1).permutation(len(infos))]
    found = curate(shuffled, RankingConfig(criterion))
    assert found.ranking == expected.ranking  # to the last bit of every score
    np.testing.assert_array_equal(found.spectrum, expected.spectrum)
    assert (found.efficiency, found.epsilon) == (expected.efficiency, expected.epsilon)
    assert (found.block_shares, found.warnings) == (expected.block_shares, expected.warnings)


def in_units(info: TossInformation, scale: Array) -> TossInformation:
    """The same toss in parameters theta / scale (P,), for a form without a tilt."""
    factor = info.factor * scale
    traces = np.array([np.square(factor[:, block.start : block.stop]).sum() for block in info.blocks])
    return replace(info, factor=factor, score_sum=info.score_sum * scale, block_traces=traces)


@pytest.mark.slow
@ESTIMATORS
@pytest.mark.parametrize("seed", range(2))
def test_units_turn_the_order_of_the_trace_over_and_move_no_toss_of_the_others(
    real_tosses: Tosses, estimator: Estimator, seed: int
) -> None:
    """method.md 6.17 over all 570 places, in the 57 published parameters; of the first 32 by trace, units leave 3 to 19."""
    pool = scored_pool(real_tosses, estimator, Form.CONTACTNETS)
    scale = 10.0 ** np.random.default_rng(seed).uniform(-3.0, 3.0, pool.parameters)
    there = pool_of([in_units(info, scale) for info in pool.infos])
    for criterion in ("log-det", "leverage"):
        assert by(criterion, there).ids == by(criterion, pool).ids, criterion
    assert top_overlap(by("trace", there), by("trace", pool), 32) < 0.7


# The figures of method.md


@pytest.mark.slow
@pytest.mark.parametrize(
    ("estimator", "criterion", "method", "measured"),
    [
        (Estimator.EMPIRICAL, "trace", (415, 510, 555), (364, 505, 544)),
        (Estimator.EMPIRICAL, "leverage", (300, 430, 500), (286, 414, 490)),
        (Estimator.EMPIRICAL, "random", (510, 563, 569), (533, 563, 564)),
        (Estimator.GAUSS_NEWTON, "trace", (350, 495, 525), (360, 475, 536)),
        (Estimator.GAUSS_NEWTON, "leverage", (335, 495, 540), (308, 476, 523)),
        (Estimator.GAUSS_NEWTON, "random", (562, 562, 562), (467, 540, 558)),
    ],
)
def test_most_of_the_tosses_are_needed_to_stand_for_all(
    real_tosses: Tosses,
    fitted: ContactGeometry,
    estimator: Estimator,
    criterion: str,
    method: tuple[int, ...],
    measured: tuple[int, ...],
) -> None:
    """method.md 0.8 and 1.9: tosses until plain sums are within epsilon 0.5, 0.2, 0.1 of the pool, at a trained theta.

    The thetas are trained alike but are not the same; `measured` is at ours. By random order method.md gives one shuffle and we
    the mean of five, which range from 421 to 505 at epsilon 0.5 by Gauss-Newton: 562 was bad luck.
    """
    pool = scored_pool(real_tosses, estimator, Form.CONTACTNETS, fitted)
    subspace = identifiable_subspace(pool.fisher)
    assert subspace.dimension == 56
    orders = [by(criterion, pool, seed=seed).ids for seed in range(5 if criterion == "random" else 1)]
    counts = [[smallest_sufficient_k(pool, subspace, order, epsilon) for epsilon in EPSILONS] for order in orders]
    found = np.mean(np.array(counts, dtype=float), axis=0)
    np.testing.assert_allclose(found, measured, rtol=0.05)
    np.testing.assert_allclose(found, method, rtol=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("criterion", "kept", "method"),
    [
        ("trace", 64, (0.03, 8.7)),
        ("trace", 128, (0.31, 4.4)),
        ("leverage", 64, (0.09, 8.8)),
        ("leverage", 128, (0.89, 4.4)),
    ],
)
def test_rescaling_a_kept_set_does_not_make_it_stand_for_all(
    real_tosses: Tosses, fitted: ContactGeometry, criterion: str, kept: int, method: tuple[float, float]
) -> None:
    """method.md 1.9: ends of the spectrum of K / k times the kept information.

    Measured in this order: 0.026 to 8.62, 0.300 to 4.39, 0.125 to 8.72, 0.744 to 4.41.
    """
    pool = scored_pool(real_tosses, Estimator.EMPIRICAL, Form.CONTACTNETS, fitted)
    subspace = identifiable_subspace(pool.fisher)
    ids = by(criterion, pool).ids[:kept]
    spectrum = spectral_distance(pool, subspace, ids, len(pool) / kept).eigenvalues
    assert spectrum[-1] == pytest.approx(method[1], rel=0.03)
    assert spectrum[0] == pytest.approx(method[0], rel=0.5)


@pytest.mark.slow
def test_by_the_empirical_matrix_no_toss_tells_every_direction(real_tosses: Tosses) -> None:
    """method.md 0.3, of factors in full: 22 to 42 of 52 eigenvalues are over 1e-10 of the largest; by Gauss-Newton 48 to 52."""
    ranges = {Estimator.EMPIRICAL: (22, 42), Estimator.GAUSS_NEWTON: (48, 52)}
    for estimator, (fewest, most) in ranges.items():
        scorer = Scorer(TRUE, CONTACTNETS_CUBE, ScoringConfig(estimator, compression=Compression(max_rows=52)))
        infos = [info for info in scorer.score(real_tosses) if isinstance(info, TossInformation)]
        values = [np.square(np.linalg.norm(info.factor, axis=1)) for info in infos]  # rows are orthogonal, strongest first
        counts = [int(np.count_nonzero(each > 1e-10 * each[0])) for each in values]
        assert (min(counts), max(counts)) == pytest.approx((fewest, most), abs=1)


def test_sum_and_mean_rank_alike_and_the_coherent_matrix_does_not(real_tosses: Tosses) -> None:
    """method.md 1.5, at the truth: 0.99 to 1.00 and 0.71; measured 0.99 and 0.78."""
    pool = scored_pool(real_tosses, Estimator.EMPIRICAL)
    ranked = {name: rank(pool.infos, RankingConfig("trace", normalisation=name)) for name in NORMALISATIONS}
    assert spearman(ranked["sum"], ranked["mean"]) > 0.985
    assert spearman(ranked["sum"], ranked["coherent"]) == pytest.approx(0.75, abs=0.08)


@pytest.mark.slow
def test_a_ranking_at_a_noisy_theta_says_little_about_the_ranking_at_the_truth(real_tosses: Tosses) -> None:
    """method.md 0.6: 0.13 and 0.03 at other initialisations; measured 0.16 and 0.04, by Gauss-Newton 0.31 and 0.31."""
    thetas = (TRUE, noisy_geometry(0), noisy_geometry(1))
    for estimator, lowest, highest in ((Estimator.EMPIRICAL, -0.1, 0.25), (Estimator.GAUSS_NEWTON, 0.2, 0.45)):
        truth, *others = (by("trace", scored_pool(real_tosses, estimator, Form.CONTACTNETS, theta)) for theta in thetas)
        for other in others:
            assert lowest < spearman(truth, other) < highest


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "expected"), [(0, 5), (1, 12)])
def test_literal_orthogonality_likes_tosses_that_say_nothing(real_tosses: Tosses, seed: int, expected: int) -> None:
    """method.md 0.5: 11 of 16 picks among the 14 smallest scores of 570, where chance has 0.4; measured 5 and 12."""
    pool = scored_pool(real_tosses, Estimator.EMPIRICAL, Form.CONTACTNETS, noisy_geometry(seed))
    lengths = np.linalg.norm(pool.toss_scores, axis=1)
    smallest = {pool.ids[index] for index in np.argsort(lengths)[:14]}
    literal = rank_particles([pool], RankingConfig("orthogonal", top=16, variant="literal")).selected_ids
    assert len(smallest & set(literal)) == expected
    assert not smallest & set(by("orthogonal", pool, top=16).selected_ids)
