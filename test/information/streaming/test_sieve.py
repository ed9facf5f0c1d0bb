"""Sieve-Streaming keeps its promise in every order, and exchanges do better in practice (METHOD check 10)."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import LogDetPrior, log_det_prior, prior_of_matrix
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming.sieve import SieveStreaming
from contact_curation.information.streaming.swap import GuardedSwap, SwapStreaming
from test.information.oracles import log_det_value, mean_toss, sieve_streaming
from test.information.pools import toss, tosses
from test.information.test_recentring import scored

TOP = 12
EPSILON = 0.2
POOL = tosses(150, 8, 4, seed=0, spread=2.0)


def prior_of(infos: list[TossInformation]) -> LogDetPrior:
    return log_det_prior(pool_of(infos), 1e-3)


def greedy_value(infos: list[TossInformation], top: int) -> float:
    return sum(entry.marginal_gain for entry in rank(infos, RankingConfig("log-det", top=top)).entries if entry.kept)


def orders(infos: list[TossInformation]) -> dict[str, list[TossInformation]]:
    """Twenty random orders and four that are meant to hurt: by size up and down, copies first, and silence first."""
    made = {f"random {k}": [infos[i] for i in np.random.default_rng(k).permutation(len(infos))] for k in range(20)}
    by_size = sorted(infos, key=lambda info: info.trace)
    made |= {"growing": by_size, "shrinking": by_size[::-1]}
    smallest = by_size[0]
    made["copies first"] = [toss(f"copy-{k:03d}", smallest.factor) for k in range(60)] + infos
    made["silence first"] = [toss(f"silent-{k:03d}", np.zeros((1, 8))) for k in range(20)] + infos
    return made


@pytest.mark.parametrize("name", orders(POOL))
def test_the_guarantee_holds_in_every_order(name: str) -> None:
    sieve = SieveStreaming(prior_of(POOL), TOP, EPSILON)
    guarded = GuardedSwap(prior_of(POOL), TOP, EPSILON)
    for info in orders(POOL)[name]:
        sieve.offer(info)
        guarded.offer(info)
    greedy = greedy_value(POOL, TOP)
    assert sieve.value >= (0.5 - EPSILON) * greedy
    assert guarded.value >= 0.97 * greedy
    assert len(sieve.selected) <= TOP
    if name.startswith("random"):
        assert sieve.value > 0.85 * greedy


@pytest.mark.parametrize("epsilon", [0.4, 0.1])
@pytest.mark.parametrize("top", [1, 6])
@pytest.mark.parametrize("seed", range(4))
def test_sieves_made_when_needed_do_what_all_sieves_from_the_start_would(seed: int, top: int, epsilon: float) -> None:
    infos = sorted(tosses(40, 5, 2, seed, spread=2.0), key=lambda info: info.trace)
    sieve = SieveStreaming(prior_of_matrix(np.eye(5), np.zeros(3)), top, epsilon)
    for info in infos:
        sieve.offer(info)
    assert sieve.value == pytest.approx(sieve_streaming(infos, np.eye(5), top, epsilon), rel=1e-8)


@pytest.mark.parametrize("kind", [SieveStreaming, SwapStreaming, GuardedSwap])
def test_the_value_is_that_of_the_selected_set_and_never_falls(
    kind: type[SieveStreaming] | type[SwapStreaming] | type[GuardedSwap],
) -> None:
    prior = 1e-3 * mean_toss(POOL)
    selector = kind(prior_of_matrix(prior, np.zeros(3)), 5)
    before = 0.0
    for info in POOL[:60]:
        selector.offer(info)
        assert selector.value >= before
        assert selector.value == pytest.approx(log_det_value(selector.selected, prior), rel=1e-8)
        before = selector.value


def test_the_best_set_outlives_its_sieve() -> None:
    """A toss that dwarfs all others ends every sieve so far; what they found is kept while it is still the best."""
    prior = prior_of_matrix(np.eye(6), np.zeros(3))
    sieve = SieveStreaming(prior, 6, 0.1)
    for k in range(6):
        sieve.offer(toss(f"small-{k}", np.eye(6)[k : k + 1]))
    value = sieve.value
    assert value == pytest.approx(6 * np.log(2.0))
    sieve.offer(toss("huge", 20.0 * np.eye(6)[:1]))
    assert sieve.value >= value


def test_memory_is_bounded_by_sieves_and_not_by_the_stream() -> None:
    sieve = SieveStreaming(prior_of(POOL), TOP, EPSILON)
    most = 0
    for info in POOL:
        sieve.offer(info)
        most = max(most, sieve.stored)
    sieves = np.log(2 * TOP) / np.log1p(EPSILON) + 1
    assert TOP <= most <= sieves * TOP


def test_a_finer_sieve_promises_more() -> None:
    coarse, fine = (SieveStreaming(prior_of(POOL), TOP, epsilon) for epsilon in (0.45, 0.02))
    for info in POOL:
        coarse.offer(info)
        fine.offer(info)
    assert fine.value >= 0.48 * greedy_value(POOL, TOP)
    assert fine.value > coarse.value


@pytest.mark.parametrize("epsilon", [0.0, 0.5, -0.1, np.nan])
def test_an_epsilon_without_a_guarantee_is_refused(epsilon: float) -> None:
    with pytest.raises(InvalidValueError, match="epsilon"):
        SieveStreaming(prior_of(POOL), TOP, epsilon)


def test_an_exchange_is_the_best_one_there_is() -> None:
    prior = 1e-2 * mean_toss(POOL)
    swap = SwapStreaming(prior_of_matrix(prior, np.zeros(3)), 4)
    exchanges = 0
    for info in POOL[:50]:
        before = list(swap.selected)
        swap.offer(info)
        if len(before) < 4:
            continue
        options = [[*before[:j], *before[j + 1 :], info] for j in range(4)]
        values = [log_det_value(option, prior) for option in options]
        stay = log_det_value(before, prior)
        if max(values) > stay + 1e-6:
            exchanges += 1
            assert list(swap.selected) == options[int(np.argmax(values))]
        elif max(values) < stay - 1e-6:
            assert list(swap.selected) == before
    assert exchanges > 3


def test_tosses_of_a_stream_are_taken_about_the_priors_pivot() -> None:
    infos = [scored(f"toss-{k:02d}", k) for k in range(30)]
    pivot = pool_of(infos).pivot
    about_it = [scored(f"toss-{k:02d}", k, pivot=pivot) for k in range(30)]
    prior = log_det_prior(pool_of(infos), 1e-3)
    one, other = SwapStreaming(prior, 5), SwapStreaming(prior, 5)
    for info, moved in zip(infos, about_it):
        one.offer(info)
        other.offer(moved)
    assert [info.toss_id for info in one.selected] == [info.toss_id for info in other.selected]
    assert one.value == pytest.approx(other.value, rel=1e-9)
