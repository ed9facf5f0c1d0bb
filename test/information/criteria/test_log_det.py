"""Lazy greedy is greedy; copies add little information; the certificate never claims too much (method.md checks 9 and 10)."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, rank, rank_particles
from contact_curation.information.ranking import Certificate, Ranking
from contact_curation.information.record import TossInformation
from test.information.oracles import best_log_det, log_det_value, mean_toss, naive_greedy
from test.information.pools import toss, tosses


def by_log_det(infos: Sequence[TossInformation], top: int, prior: Array | None = None, certificate_steps: int = 0) -> Ranking:
    return rank(infos, RankingConfig("log-det", top=top, certificate_steps=certificate_steps), prior=prior)


def selected_gains(ranking: Ranking) -> list[float]:
    return [entry.marginal_gain for entry in ranking.entries if entry.selected]


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.integers(1, 60), st.integers(1, 7), st.sampled_from([0.0, 1.0, 3.0]))
def test_lazy_greedy_finds_what_naive_greedy_finds(seed: int, count: int, rows: int, spread: float) -> None:
    infos = tosses(count, 5, rows, seed, spread)
    prior = 1e-3 * mean_toss(infos) + 1e-6 * np.eye(5)
    expected = naive_greedy(infos, prior, 12)
    found = by_log_det(infos, 12, prior)
    gains = np.array([gain for _, gain in expected])
    accuracy = 1e-6 if spread < 3.0 else 1e-4  # determinants of tosses of very different sizes have fewer digits
    np.testing.assert_allclose(selected_gains(found), gains, rtol=accuracy, atol=1e-9)
    for one, (other, gain) in zip(found.selected_ids, expected, strict=True):
        if one != other:  # only of two that add as much, to that accuracy; what follows may differ then
            assert np.isclose(dict(expected).get(one, gain), gain, rtol=10 * accuracy)
            break


def test_the_default_prior_is_a_thousandth_of_the_mean_toss() -> None:
    infos = tosses(40, 6, 3, seed=1)
    expected = naive_greedy(infos, 1e-3 * mean_toss(infos), 10)
    found = by_log_det(infos, 10)
    assert list(found.selected_ids) == [toss_id for toss_id, _ in expected]
    np.testing.assert_allclose(selected_gains(found), [gain for _, gain in expected], rtol=1e-8)


def test_gains_never_grow_from_pick_to_pick() -> None:
    for seed in range(10):
        gains = selected_gains(by_log_det(tosses(60, 8, 5, seed), 40))
        assert (np.diff(gains) <= 1e-9).all()


def test_the_others_follow_by_what_they_would_still_add() -> None:
    infos = tosses(30, 6, 4, seed=2)
    ranking = by_log_det(infos, 5)
    by_id = {info.toss_id: info for info in infos}
    prior = 1e-3 * mean_toss(infos)
    kept = [by_id[toss_id] for toss_id in ranking.selected_ids]
    value = log_det_value(kept, prior)
    others = ranking.entries[5:]
    for entry in others:
        assert entry.marginal_gain == pytest.approx(log_det_value([*kept, by_id[entry.toss_id]], prior) - value, rel=1e-7)
        assert entry.score == pytest.approx(log_det_value([by_id[entry.toss_id]], prior), rel=1e-9)
    assert [e.marginal_gain for e in others] == sorted((e.marginal_gain for e in others), reverse=True)


def test_equal_gains_go_to_the_smaller_id() -> None:
    factor = np.random.default_rng(3).standard_normal((3, 6))
    infos = [toss(f"toss-{k:03d}", factor) for k in range(100)]
    assert by_log_det(infos, 20).ids == tuple(info.toss_id for info in infos)


def one_direction_each(count: int, copies: int) -> list[TossInformation]:
    """`count` tosses that each tell one new thing, and copies of the one that tells most."""
    factors = np.diag(np.linspace(2.0, 1.0, count))[:, None, :]
    distinct = [toss(f"toss-{k:02d}", factor) for k, factor in enumerate(factors)]
    return distinct + [toss(f"copy-{k:02d}", factors[0]) for k in range(copies)]


def test_no_copy_is_picked_while_there_is_something_new() -> None:
    infos = one_direction_each(8, copies=12)
    picks = by_log_det(infos, 12).selected_ids
    assert {toss_id for toss_id in picks[:8] if toss_id.startswith("toss")} == {f"toss-{k:02d}" for k in range(1, 8)}
    assert sum(toss_id.startswith("copy") or toss_id == "toss-00" for toss_id in picks[:8]) == 1
    assert all(toss_id.startswith("copy") or toss_id == "toss-00" for toss_id in picks[8:])


def test_the_trace_does_pick_copies() -> None:
    picks = rank(one_direction_each(8, copies=12), RankingConfig("trace", top=12)).selected_ids
    assert all(toss_id.startswith("copy") for toss_id in picks)


def test_a_copy_adds_less_than_the_toss_did() -> None:
    original, copy = (toss(name, np.array([[3.0, 1.0], [0.0, 1.0]])) for name in ("a", "b"))
    prior = np.eye(2)
    first, second = by_log_det([original, copy], 2, prior).entries
    assert second.marginal_gain < first.marginal_gain
    again = np.linalg.slogdet(np.eye(2) + np.linalg.solve(prior + original.fisher(), copy.fisher()))[1]
    assert second.marginal_gain == pytest.approx(again, rel=1e-12)


def test_tosses_that_say_nothing_come_last() -> None:
    infos = [*tosses(10, 4, 3, seed=4), toss("nothing", np.zeros((2, 4))), toss("empty", np.zeros((0, 4)))]
    assert by_log_det(infos, 12).ids[-2:] == ("empty", "nothing")


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("steps", [0, 10])
def test_the_certificate_is_below_the_true_efficiency(seed: int, steps: int) -> None:
    infos = tosses(9, 3, 2, seed)
    prior = 0.1 * mean_toss(infos)
    ranking = by_log_det(infos, 4, prior, steps)
    by_id = {info.toss_id: info for info in infos}
    value = log_det_value([by_id[toss_id] for toss_id in ranking.selected_ids], prior)
    truth = np.exp((value - best_log_det(infos, prior, 4)) / 3)
    assert ranking.certificate is not None
    assert 0.0 < ranking.certificate.kiefer_wolfowitz <= ranking.certificate.subset <= truth + 1e-9


@pytest.mark.parametrize(("share", "rows", "tightest"), [(1.0, 3, 1), (1e-4, 1, 2)])
@pytest.mark.parametrize("seed", range(4))
def test_the_certificate_is_the_best_of_its_bounds(seed: int, share: float, rows: int, tightest: int) -> None:
    infos = tosses(40, 8, rows, seed)
    prior = share * mean_toss(infos)
    ranking = by_log_det(infos, 6, prior)
    kept = [info for info in infos if info.toss_id in ranking.selected_ids]
    inverse = np.linalg.inv(prior + sum(info.fisher() for info in kept))
    slopes = sorted((float(np.trace(inverse @ info.fisher())) for info in infos), reverse=True)
    own = sum(float(np.trace(inverse @ info.fisher())) for info in kept)
    gains = sorted((entry.marginal_gain for entry in ranking.entries if not entry.selected), reverse=True)
    gaps = [6 * slopes[0] - own, sum(slopes[:6]) - own, sum(gains[:6])]
    assert int(np.argmin(gaps)) == tightest
    assert ranking.certificate is not None
    assert ranking.certificate.kiefer_wolfowitz == pytest.approx(np.exp(-gaps[0] / 8), rel=1e-6)
    assert ranking.certificate.subset == pytest.approx(np.exp(-min(gaps) / 8), rel=1e-6)


def test_more_steps_tighten_the_certificate_and_nothing_else() -> None:
    infos = tosses(200, 8, 4, seed=5)
    plain, tight = by_log_det(infos, 16), by_log_det(infos, 16, certificate_steps=10)
    assert plain.entries == tight.entries
    assert isinstance(plain.certificate, Certificate)
    assert isinstance(tight.certificate, Certificate)
    assert tight.certificate.subset > plain.certificate.subset
    assert tight.certificate.kiefer_wolfowitz == plain.certificate.kiefer_wolfowitz
    assert tight.certificate.subset > 0.8


def test_keeping_everything_is_certified_as_the_best() -> None:
    certificate = by_log_det(tosses(6, 3, 2, seed=6), 6).certificate
    assert certificate is not None
    assert certificate.subset == pytest.approx(1.0, abs=1e-9)


def test_the_bound_of_kiefer_and_wolfowitz_is_one_for_a_balanced_design() -> None:
    infos = [toss(f"{k}", 1e3 * np.eye(4)[k : k + 1]) for k in range(4)]
    certificate = by_log_det(infos, 4, 1e-9 * np.eye(4)).certificate
    assert certificate is not None
    assert certificate.kiefer_wolfowitz == pytest.approx(1.0, abs=1e-9)


def test_particles_average_their_log_dets() -> None:
    particles = [tosses(25, 4, 3, seed) for seed in (7, 8, 9)]
    priors = [1e-3 * mean_toss(infos) for infos in particles]
    ranking = rank_particles([pool_of(infos) for infos in particles], RankingConfig("log-det", top=8))
    left, kept = list(range(25)), list[int]()
    for pick in ranking.selected_ids:
        values = {
            index: np.mean([log_det_value([infos[i] for i in [*kept, index]], a0) for infos, a0 in zip(particles, priors)])
            for index in left
        }
        best = max(values, key=lambda index: float(values[index]))
        assert particles[0][best].toss_id == pick
        left.remove(best)
        kept.append(best)


def test_a_particle_twice_is_that_particle() -> None:
    infos = tosses(25, 4, 3, seed=10)
    once = rank_particles([pool_of(infos)], RankingConfig("log-det", top=8, certificate_steps=3))
    twice = rank_particles([pool_of(infos), pool_of(infos)], RankingConfig("log-det", top=8, certificate_steps=3))
    assert once == twice


def test_a_prior_that_is_not_positive_definite_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="positive definite"):
        by_log_det(tosses(3, 2, 2, seed=0), 2, np.diag([1.0, -1.0]))
