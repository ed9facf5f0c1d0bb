"""One door: the same tosses give the same ranking, in any order and, where promised, in any units (method.md check 17)."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, criterion_names, rank, rank_particles
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.information.subspace import identifiable_subspace
from test.information.pools import rescaled, toss, tosses
from test.simulated import RIG_NOISE, simulated_tosses

SCALE = 10.0 ** np.random.default_rng(0).uniform(-3.0, 3.0, 12)


@settings(deadline=None, max_examples=15)
@given(st.permutations(range(24)), st.sampled_from(criterion_names()))
def test_the_order_in_which_tosses_come_changes_no_digit(order: list[int], criterion: str) -> None:
    infos = tosses(20, 6, 4, seed=1)
    infos += [toss(f"copy-{k}", infos[3].factor, duration=infos[3].duration) for k in range(4)]
    config = RankingConfig(criterion, top=9)
    assert rank([infos[i] for i in order], config) == rank(infos, config)


@pytest.mark.parametrize("criterion", criterion_names())
def test_every_toss_is_ranked_once_and_the_first_are_kept(criterion: str) -> None:
    infos = tosses(70, 6, 4, seed=2)
    ranking = rank(infos, RankingConfig(criterion, top=11))
    assert sorted(ranking.ids) == [info.toss_id for info in infos]
    assert [entry.rank for entry in ranking.entries] == list(range(1, 71))
    assert [entry.selected for entry in ranking.entries] == [True] * 11 + [False] * 59
    assert ranking.selected_ids == ranking.ids[:11]
    assert ranking.criterion == criterion
    assert (ranking.certificate is not None) == (criterion == "log-det")


@pytest.mark.parametrize("criterion", criterion_names())
def test_a_short_pool_is_kept_whole(criterion: str) -> None:
    ranking = rank(tosses(3, 4, 4, seed=3), RankingConfig(criterion, top=10))
    assert len(ranking.selected_ids) == 3
    assert len(rank(tosses(1, 4, 4, seed=3), RankingConfig(criterion, top=10)).selected_ids) == 1


@pytest.mark.parametrize(
    "criterion", ["log-det", "representative", "herding", "facility-location", "v-optimal", "min-eig", "leverage"]
)
@pytest.mark.parametrize("seed", range(5))
def test_units_of_the_parameters_change_neither_order_nor_scores(criterion: str, seed: int) -> None:
    infos = tosses(60, 12, 5, seed)
    config = RankingConfig(criterion, top=20)
    here, there = rank(infos, config), rank([rescaled(info, SCALE) for info in infos], config)
    assert here.ids == there.ids
    np.testing.assert_allclose([e.score for e in here.entries], [e.score for e in there.entries], rtol=1e-6)


def test_units_of_the_parameters_do_change_the_trace_ranking() -> None:
    infos = tosses(60, 12, 5, seed=4)
    config = RankingConfig("trace", top=20)
    assert rank(infos, config).selected_ids != rank([rescaled(info, SCALE) for info in infos], config).selected_ids


def pool_in_57_parameters(theta: ContactGeometry, estimator: Estimator) -> Pool:
    scorer = Scorer(theta, CONTACTNETS_CUBE, ScoringConfig(estimator, form=Form.CONTACTNETS))
    scored = scorer.score(simulated_tosses(12, seed=8, noise=RIG_NOISE))
    return pool_of(info for info in scored if isinstance(info, TossInformation))


@pytest.mark.parametrize("estimator", list(Estimator))
def test_the_57_parameter_form_is_ranked_without_its_gauge(estimator: Estimator) -> None:
    """method.md check 5: a turn of the tangents, which changes nothing, takes no part and changes no ranking."""
    true = ContactGeometry.of_body(CONTACTNETS_CUBE)
    turned = replace(true, tangents=np.array([[0.8, -0.6], [0.6, 0.8]]) @ true.tangents)
    pools = [pool_in_57_parameters(theta, estimator) for theta in (true, turned)]
    gauge = parameter_form(true, Form.CONTACTNETS).gauge[0]
    assert gauge @ pools[0].fisher @ gauge < 1e-12 * np.trace(pools[0].fisher)
    assert identifiable_subspace(pools[0].fisher).dimension <= 56
    for criterion in ("log-det", "leverage", "min-eig"):
        here, there = (rank_particles([pool], RankingConfig(criterion, top=len(pool))) for pool in pools)
        assert here.selected_ids == there.selected_ids, criterion
        gains, turned_gains = ([entry.marginal_gain for entry in ranking.entries] for ranking in (here, there))
        np.testing.assert_allclose(gains, turned_gains, rtol=1e-4, atol=1e-6)
        assert sum(gains) > 0.0


@pytest.mark.parametrize("criterion", criterion_names())
def test_a_particle_many_times_is_that_particle(criterion: str) -> None:
    pool = pool_of(tosses(30, 5, 4, seed=6))
    config = RankingConfig(criterion, top=8)
    assert rank_particles([pool] * 3, config).ids == rank_particles([pool], config).ids


@pytest.mark.parametrize("criterion", ["trace", "orthogonal", "leverage"])
def test_no_particle_outweighs_another_by_its_units(criterion: str) -> None:
    one, other = tosses(30, 5, 4, seed=7), tosses(30, 5, 4, seed=8)
    loud = [rescaled(info, np.full(5, 1e4)) for info in one]
    config = RankingConfig(criterion, top=8)
    plain = rank_particles([pool_of(one), pool_of(other)], config)
    assert rank_particles([pool_of(loud), pool_of(other)], config).ids == plain.ids
    assert plain.selected_ids != rank(loud, config).selected_ids


def test_the_default_is_the_rule_that_training_sets_are_kept_by() -> None:
    infos = tosses(30, 5, 4, seed=9)
    assert rank(infos, RankingConfig(top=6)) == rank(infos, RankingConfig("representative", top=6))
    assert rank(infos, RankingConfig(top=6)).selected_ids != rank(infos, RankingConfig("log-det", top=6)).selected_ids


def test_particles_must_hold_the_same_tosses() -> None:
    with pytest.raises(
        InvalidValueError, match=r"^parameter particles: found different tosses, expected the same tosses under every particle$"
    ):
        rank_particles([pool_of(tosses(3, 2, 2, 0)), pool_of(tosses(4, 2, 2, 0))], RankingConfig())
    with pytest.raises(InvalidValueError, match=r"^parameter particles: found none, expected at least one$"):
        rank_particles([], RankingConfig())


@pytest.mark.parametrize(
    "criterion", ["log-det", "representative", "herding", "facility-location", "v-optimal", "min-eig", "leverage"]
)
def test_a_pool_that_tells_nothing_cannot_be_ranked_by_what_it_tells(criterion: str) -> None:
    with pytest.raises(InvalidValueError, match="pooled information: found zero"):
        rank([toss("a", np.zeros((2, 3)))], RankingConfig(criterion))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("criterion", "fisher"),
        ("normalisation", "max"),
        ("variant", "qr"),
        ("top", 0),
        ("seed", -1),
        ("certificate_steps", -1),
        ("prior", 0.0),
        ("prior", np.inf),
        ("prior", np.nan),
        ("cut", 0.0),
        ("cut", 1.0),
    ],
)
def test_configurations_out_of_range_are_refused(name: str, value: Any) -> None:
    with pytest.raises(InvalidValueError, match=rf"(ranking.{name}: found|unknown (ranking\.)?{name}) {value}"):
        RankingConfig(**{name: value})
