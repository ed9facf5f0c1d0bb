"""Exchanges come out near greedy selection in every order that was tried (method.md check 10)."""

import numpy as np
import pytest

from contact_curation.information.criteria.exchanges import SwapStreaming
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import LogDetPrior, log_det_prior, prior_of_matrix
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.record import TossInformation
from test.information.oracles import log_det_value, mean_toss
from test.information.pools import toss, tosses
from test.information.test_recentring import scored

TOP = 12
POOL = tosses(150, 8, 4, seed=0, spread=2.0)


def prior_of(infos: list[TossInformation]) -> LogDetPrior:
    return log_det_prior(pool_of(infos), 1e-3)


def greedy_value(infos: list[TossInformation], top: int) -> float:
    return sum(entry.marginal_gain for entry in rank(infos, RankingConfig("log-det", top=top)).entries if entry.selected)


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
def test_the_value_is_near_greedys_in_every_order(name: str) -> None:
    swap = SwapStreaming(prior_of(POOL), TOP)
    for info in orders(POOL)[name]:
        swap.offer(info)
    assert swap.value >= 0.97 * greedy_value(POOL, TOP)
    assert len(swap.selected) == TOP


def test_the_value_is_that_of_the_selected_set_and_never_falls() -> None:
    prior = 1e-3 * mean_toss(POOL)
    selector = SwapStreaming(prior_of_matrix(prior, np.zeros(3)), 5)
    before = 0.0
    for info in POOL[:60]:
        selector.offer(info)
        assert selector.value >= before
        assert selector.value == pytest.approx(log_det_value(selector.selected, prior), rel=1e-8)
        before = selector.value


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
