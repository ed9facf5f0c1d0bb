"""Every criterion keeps to what it says of itself, and one's own is known as soon as it is registered."""

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.information.criteria import TRACE, criterion
from contact_curation.information.criteria.criterion import Criterion, Need, moved_by_theta, register
from contact_curation.information.criteria.explanation import explanation
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, criterion_named, criterion_names, rank, rank_particles
from contact_curation.information.ranking import Ranking, Selection, greedy_selection, modular_selection
from test.information.pools import toss, tosses

POOL = tosses(40, 6, 4, seed=0)
EVERY = pytest.mark.parametrize("one", [criterion_named(name) for name in criterion_names()], ids=lambda one: one.name)


@EVERY
def test_only_a_criterion_that_needs_a_subspace_refuses_a_pool_without_information(one: Criterion) -> None:
    silent = [toss(f"toss-{k}", np.zeros((2, 3))) for k in range(4)]
    if Need.SUBSPACE not in one.needs:
        assert len(rank(silent, RankingConfig(one.name, top=2)).selected_ids) == 2
        return
    with pytest.raises(InvalidValueError, match="pooled information"):
        rank(silent, RankingConfig(one.name, top=2))


@EVERY
def test_only_a_criterion_that_needs_a_prior_asks_for_it(one: Criterion) -> None:
    weak, strong = (rank(POOL, RankingConfig(one.name, top=8, prior=prior)) for prior in (1e-3, 10.0))
    assert (weak.entries != strong.entries) == (Need.PRIOR in one.needs)


@EVERY
def test_only_a_criterion_that_needs_theta_ranks_otherwise_at_another_one(one: Criterion) -> None:
    losses = np.random.default_rng(0).uniform(0.1, 0.2, 40).tolist()
    others = zip(tosses(40, 6, 4, seed=1), POOL, losses, strict=True)
    elsewhere = [replace(new, duration=old.duration, mean_loss=loss) for new, old, loss in others]
    config = RankingConfig(one.name, top=8)
    assert (rank(POOL, config).ids != rank(elsewhere, config).ids) == (Need.THETA in one.needs) == moved_by_theta(one.name)


@EVERY
def test_only_a_criterion_that_needs_exact_scores_reads_them(one: Criterion) -> None:
    exact = np.random.default_rng(0).standard_normal((40, 9))
    config = RankingConfig(one.name, top=8)
    with_them = rank_particles([replace(pool_of(POOL), network_scores=exact)], config)
    assert (with_them.ids != rank(POOL, config).ids) == (Need.EXACT_SCORES in one.needs) == one.reads_exact_scores(config)
    assert not one.reads_exact_scores(replace(config, whiten=True))


@EVERY
def test_a_certificate_comes_with_those_that_promise_one(one: Criterion) -> None:
    assert (rank(POOL, RankingConfig(one.name, top=8)).certificate is not None) == one.certified


@EVERY
def test_a_stream_is_selected_from_by_the_criterion(one: Criterion) -> None:
    if one.stream is None:
        return
    config = RankingConfig(one.name, top=8)
    selector = one.stream(POOL[:20] if Need.PRIOR in one.needs else (), config)
    for info in POOL:
        selector.offer(info)
    assert (selector.seen, len(selector.selected)) == (40, 8)
    assert len({info.toss_id for info in selector.selected} & set(rank(POOL, config).selected_ids)) >= 6


@EVERY
def test_every_toss_has_a_gain_and_a_reason(one: Criterion) -> None:
    ranking = rank(POOL, RankingConfig(one.name, top=8))
    selected = {entry.toss_id: entry.marginal_gain for entry in ranking.entries if entry.selected}
    found = explanation(one.name, pool_of(POOL), selected, RankingConfig(one.name, top=8))
    assert set(found.gains) == set(found.reasons) == set(ranking.ids)
    assert {toss_id for toss_id, reason in found.reasons.items() if reason.startswith("selected")} == set(selected)


def test_by_a_criterion_that_nobody_registered_here_tosses_have_plain_reasons() -> None:
    found = explanation("elsewhere", pool_of(POOL), {"toss-0000": 1.0}, RankingConfig(top=1))
    assert found.reasons["toss-0000"] == "selected: place 1 by elsewhere"
    assert found.reasons["toss-0001"] == "not selected: elsewhere has 1 better"


@pytest.fixture
def shortest(monkeypatch: pytest.MonkeyPatch) -> Criterion:
    """A criterion of one's own, registered while a test runs."""
    monkeypatch.setattr(criterion, "_REGISTERED", dict(criterion._REGISTERED))

    def select(pools: Sequence[Pool], config: RankingConfig) -> Selection:
        return modular_selection(np.array([-info.duration for info in pools[0].infos]), config.top, exact=True)

    return register(Criterion("shortest", "minus the duration of the toss", "s", select, needs=frozenset()))


def test_ones_own_criterion_is_known_by_its_name(shortest: Criterion) -> None:
    assert criterion_names()[-1] == "shortest"
    ranking = rank(POOL, RankingConfig("shortest", top=3))
    assert ranking.criterion == "shortest"
    assert ranking.ids == tuple(info.toss_id for info in sorted(POOL, key=lambda info: info.duration))


DURATIONS = np.array([info.duration for info in POOL])
ORDER = np.arange(40)


def ranked_by(selection: Selection, monkeypatch: pytest.MonkeyPatch) -> Ranking:
    """The ranking by a criterion of one's own that gives back this."""
    monkeypatch.setitem(criterion._REGISTERED, "own", Criterion("own", "", "", lambda pools, config: selection))
    return rank(POOL, RankingConfig("own", top=3))


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        (modular_selection(DURATIONS[:5], 3), "scores by criterion own: found shape (5,), expected (40,), one for each toss"),
        (Selection(ORDER, DURATIONS, DURATIONS[:7], 3), "gains by criterion own: found shape (7,), expected (40,)"),
        (
            modular_selection(np.where(ORDER == 4, np.nan, 1.0), 3),
            "scores by criterion own of toss toss-0004: found nan, expected",
        ),
        (
            modular_selection(np.where(ORDER == 4, np.inf, 1.0), 3),
            "scores by criterion own of toss toss-0004: found inf, expected",
        ),
        (Selection(ORDER, np.array(["best"] * 40), DURATIONS, 3), "scores by criterion own: found "),
        (Selection(ORDER[:3], DURATIONS, DURATIONS, 3), "order by criterion own: found 3 places, 3 different, expected each"),
        (Selection(ORDER - 1, DURATIONS, DURATIONS, 3), "order by criterion own: found 40 places, 40 different, expected each"),
        (
            Selection(ORDER // 2, DURATIONS, DURATIONS, 3),
            "order by criterion own: found 40 places, 20 different, expected each",
        ),
        (Selection(ORDER, DURATIONS, DURATIONS, 4), "count by criterion own: found 4, expected a whole number from 1 to 3"),
        (Selection(ORDER, DURATIONS, DURATIONS, 0), "count by criterion own: found 0, expected a whole number from 1 to 3"),
    ],
)
def test_what_is_no_ranking_of_the_tosses_is_refused(
    selection: Selection, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InvalidValueError) as refused:
        ranked_by(selection, monkeypatch)
    assert str(refused.value).startswith(message)


@pytest.mark.parametrize(
    "scores", [ORDER.astype(np.uint8), ORDER.astype(np.float32), ORDER.tolist()], ids=["uint8", "float32", "list"]
)
def test_scores_of_any_type_of_number_rank_alike(scores: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    assert ranked_by(modular_selection(scores, 3), monkeypatch).ids == tuple(reversed(pool_of(POOL).ids))


def test_a_count_that_numpy_gives_selects_by_truth_values_that_json_has(monkeypatch: pytest.MonkeyPatch) -> None:
    ranking = ranked_by(Selection(ORDER, DURATIONS, DURATIONS, np.minimum(3, 40)), monkeypatch)
    assert json.dumps([entry.selected for entry in ranking.entries[:4]]) == "[true, true, true, false]"


def test_what_picks_added_is_not_rounded_where_all_others_add_whole_numbers() -> None:
    assert greedy_selection(np.array([1]), np.array([0.5]), np.zeros(3), np.array([2, 0, 1])).gains.tolist() == [2.0, 0.5, 1.0]


def test_a_criterion_cannot_change_what_diagnostics_are_computed_from() -> None:
    pool = pool_of(POOL)
    for shared in (pool.toss_scores, pool.fisher):
        with pytest.raises(ValueError, match="read-only"):
            shared -= 1.0


def test_a_name_is_taken_once_or_replaced_on_purpose(shortest: Criterion) -> None:
    with pytest.raises(
        InvalidValueError, match=r"^name of a new criterion: found trace, expected none of [a-z, -]*trace[a-z, -]*$"
    ):
        register(TRACE)
    assert register(replace(shortest, unit="ms"), replace=True) is criterion_named("shortest")
    assert criterion_named("shortest").axis_label() == "minus the duration of the toss [ms]"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"criterion": "fishr"}, "unknown criterion fishr: expected one of "),
        ({"normalisation": "median"}, "unknown ranking.normalisation median: did you mean mean?"),
        ({"variant": "pivot"}, "unknown ranking.variant pivot: did you mean pivoted?"),
        ({"top": 0}, "ranking.top: found 0, expected a whole number from 1 to 1000000"),
        ({"top": 1_000_001}, "ranking.top: found 1000001, expected a whole number from 1 to 1000000"),
        ({"seed": -1}, "ranking.seed: found -1, expected a whole number of at least 0"),
        ({"certificate_steps": -1}, "ranking.certificate_steps: found -1, expected a whole number of at least 0"),
        ({"prior": 0.0}, "ranking.prior: found 0.0, expected a positive number"),
        ({"prior": np.inf}, "ranking.prior: found inf, expected a positive number"),
        ({"cut": 0.0}, "ranking.cut: found 0.0, expected a number between 0 and 1"),
        ({"cut": 1.0}, "ranking.cut: found 1.0, expected a number between 0 and 1"),
    ],
)
def test_a_ranking_that_makes_no_sense_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        RankingConfig(**changes)
    assert str(refused.value).startswith(message)
    assert message.endswith("one of ") or str(refused.value) == message


def test_the_smallest_and_largest_rankings_are_accepted() -> None:
    assert RankingConfig(top=1, seed=0, certificate_steps=0).top == 1
    assert RankingConfig(top=1_000_000).top == 1_000_000


def test_axes_are_labelled_with_the_unit_if_there_is_one() -> None:
    unit, none = criterion_named("log-det"), replace(criterion_named("log-det"), unit="")
    assert unit.axis_label() == "log-det gain of the toss alone [nats]"
    assert unit.axis_label("gain") == "gain [nats]"
    assert (none.axis_label(), none.axis_label("gain")) == ("log-det gain of the toss alone", "gain")


def test_an_unknown_name_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(
        InvalidValueError,
        match="expected one of facility-location, herding, leverage, log-det, longest, min-eig",
    ):
        criterion_named("fisher")
