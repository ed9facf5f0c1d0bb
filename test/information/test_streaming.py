"""The heap over a stream keeps exactly what ranking the whole pool keeps (method.md check 6)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contact_curation.errors import InvalidValueError
from contact_curation.information.criteria.exchanges import SwapStreaming
from contact_curation.information.criteria.representative_streaming import RepresentativeStreaming
from contact_curation.information.criteria.trace import TraceHeap
from contact_curation.information.prior import prior_of_matrix
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.streaming import Selector
from test.information.pools import toss, tosses

SIZE = 4
PRIOR = prior_of_matrix(0.01 * np.eye(SIZE), np.zeros(3))
SELECTORS: list[Callable[[int], Selector]] = [
    TraceHeap,
    lambda top: SwapStreaming(PRIOR, top),
    lambda top: RepresentativeStreaming(np.zeros(3), top, 1e-3, most_held=24),
]


@given(st.permutations(range(30)), st.integers(1, 12), st.sampled_from(["sum", "mean", "coherent"]))
def test_a_stream_gives_what_the_whole_pool_gives(order: list[int], top: int, normalisation: str) -> None:
    infos = tosses(22, SIZE, 3, seed=0)
    infos += [toss(f"copy-{k}", infos[k % 3].factor) for k in range(8)]
    heap = TraceHeap(top, normalisation)
    for index in order:
        heap.offer(infos[index])
    batch = rank(infos, RankingConfig("trace", top=top, normalisation=normalisation))
    assert tuple(info.toss_id for info in heap.selected) == batch.selected_ids


@pytest.mark.parametrize("make", SELECTORS)
def test_tosses_are_selected_while_there_is_room_and_no_more_later(make: Callable[[int], Selector]) -> None:
    selector = make(6)
    for count, info in enumerate(tosses(80, SIZE, 3, seed=1), start=1):
        selector.offer(info)
        assert len({info.toss_id for info in selector.selected}) == min(count, 6)
    assert selector.seen == 80


@pytest.mark.parametrize("make", SELECTORS)
def test_a_toss_that_comes_again_changes_nothing(make: Callable[[int], Selector]) -> None:
    selector, infos = make(5), tosses(40, SIZE, 3, seed=2)
    for info in infos:
        selector.offer(info)
    before = selector.selected
    for info in infos:
        selector.offer(replace(info, score_sum=2.0 * info.score_sum))
    assert selector.selected == before
    assert selector.seen == 40


@pytest.mark.parametrize("make", SELECTORS)
def test_tosses_scored_at_another_theta_are_refused(make: Callable[[int], Selector]) -> None:
    selector = make(5)
    selector.offer(toss("a", np.ones((1, SIZE))))
    with pytest.raises(InvalidValueError, match="parameters_version"):
        selector.offer(toss("b", np.ones((1, SIZE)), parameters_version="another"))
    assert selector.seen == 1


@pytest.mark.parametrize("make", SELECTORS[1:2])
def test_tosses_of_other_parameters_than_the_priors_are_refused(make: Callable[[int], Selector]) -> None:
    with pytest.raises(InvalidValueError, match="as in the prior"):
        make(5).offer(toss("a", np.ones((1, SIZE + 1))))


@pytest.mark.parametrize("make", SELECTORS)
def test_at_least_one_toss_must_be_kept(make: Callable[[int], Selector]) -> None:
    with pytest.raises(InvalidValueError, match=r"^top: found 0, expected at least 1 toss to keep$"):
        make(0)


def test_an_unknown_normalisation_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"^unknown normalisation median: did you mean mean\?$"):
        TraceHeap(3, "median")


def test_an_error_leaves_the_heap_as_it_was() -> None:
    heap = TraceHeap(2, "mean")
    heap.offer(toss("a", np.ones((1, SIZE))))
    with pytest.raises(InvalidValueError):
        heap.offer(toss("b", np.ones((1, SIZE)), body="mug"))
    assert [info.toss_id for info in heap.selected] == ["a"]
    assert heap.seen == 1
