"""What is said of a toss that was selected, or was not, holds for it."""

from collections.abc import Mapping

import pytest

from contact_curation.information.criteria.criterion import Explanation
from contact_curation.information.criteria.explanation import explanation
from contact_curation.information.pool import pool_of
from contact_curation.information.ranker import RankingConfig, rank, rank_particles
from test.information.pools import tosses

POOL = pool_of(tosses(9, 4, 3, seed=5))


def explained(criterion: str, top: int, normalisation: str = "sum") -> tuple[Explanation, Mapping[str, float]]:
    config = RankingConfig(criterion, top=top, normalisation=normalisation)
    entries = rank(POOL.infos, config).entries
    selected = {entry.toss_id: entry.marginal_gain for entry in entries if entry.selected}
    return explanation(criterion, POOL, selected, config), selected


def test_log_det_says_beside_how_many_a_toss_is_new() -> None:
    found, selected = explained("log-det", 3)
    assert [found.reasons[one] for one in selected] == [
        "selected: most new by itself",
        "selected: most new beside the 1 above",
        "selected: most new beside the 2 above",
    ]


def test_log_det_says_whether_a_toss_was_less_new_than_the_last_or_came_after() -> None:
    found, selected = explained("log-det", 3)
    last = list(selected.values())[-1]
    for one in set(POOL.ids) - set(selected):
        less = found.gains[one] < last
        assert found.reasons[one] == (
            f"not selected: less new than the last, {last:.3g}" if less else "not selected: came after"
        )
    chosen = {POOL.ids[0]: 0.0}  # of a stream, in which others were as new when they came
    later = explanation("log-det", POOL, chosen, RankingConfig("log-det", top=1))
    assert {later.reasons[one] for one in POOL.ids[1:]} == {"not selected: came after"}


@pytest.mark.parametrize("criterion", ["longest", "random"])
def test_a_criterion_without_reasons_of_its_own_names_the_place(criterion: str) -> None:
    found, selected = explained(criterion, 2)
    assert [found.reasons[one] for one in selected] == [f"selected: place {place} by {criterion}" for place in (1, 2)]
    assert {found.reasons[one] for one in set(POOL.ids) - set(selected)} == {f"not selected: {criterion} has 2 better"}


@pytest.mark.parametrize("normalisation", ["sum", "mean", "coherent"])
def test_trace_says_below_which_of_its_traces_a_toss_is(normalisation: str) -> None:
    found, selected = explained("trace", 3, normalisation)
    name = "trace" if normalisation == "sum" else f"{normalisation} trace"
    (said,) = {found.reasons[one] for one in set(POOL.ids) - set(selected)}
    assert said == f"not selected: {name} below {min(selected.values()):.3g}"


def test_of_several_thetas_the_smallest_selected_trace_is_the_mean_that_ranks() -> None:
    other = pool_of(tosses(9, 4, 3, seed=6))
    config = RankingConfig("trace", top=3)
    selected = {one.toss_id: one.marginal_gain for one in rank_particles([POOL, other], config).entries if one.selected}
    found = explanation("trace", POOL, selected, config)
    (said,) = {found.reasons[one] for one in set(POOL.ids) - set(selected)}
    assert said == f"not selected: trace below {min(selected.values()):.3g}"


def test_what_one_toss_alone_determines_is_told_without_a_number_of_twenty_digits() -> None:
    alone = pool_of(tosses(1, 4, 3, seed=5))
    config = RankingConfig("representative", top=1)
    found = explanation("representative", alone, dict.fromkeys(alone.ids, 1.0), config)
    assert list(found.reasons.values()) == ["selected: expected error × more than 100000 without it"]
