"""The selection is made again when epochs have passed or monitored tosses have changed places, and otherwise stays."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.information.curation import curate
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.learning.training.curated import toss_scorer
from contact_curation.learning.training.data import rows_of
from contact_curation.learning.training.reranking import (
    Reranking,
    RerankingConfig,
    Selected,
    StalenessConfig,
    Trigger,
)
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from test.information import pools
from test.simulated import simulated_tosses

COUNT = 40
TRACE = RankingConfig("trace", top=10)
STALENESS = StalenessConfig(tosses=16, steps=5)


@pytest.fixture(scope="module")
def model() -> Model:
    return PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.PHYSICAL)


@pytest.fixture(scope="module")
def tosses() -> tuple[Toss, ...]:
    one = simulated_tosses(1, seed=1)[0]
    return tuple(replace(one, toss_id=f"toss-{k:02d}") for k in range(COUNT))


class MadeUpScorer:
    """Says of toss k that its trace is `traces[k]`, and remembers how many tosses it was asked about."""

    def __init__(self) -> None:
        self.traces = np.arange(1.0, COUNT + 1.0)
        self.asked: list[int] = []
        self.hopeless: set[str] = set()

    def __call__(self, model: Model, tosses: Sequence[Toss]) -> list[TossInformation | NotScored]:
        self.asked.append(len(tosses))
        return [self._one(toss.toss_id) for toss in tosses]

    def _one(self, toss_id: str) -> TossInformation | NotScored:
        if toss_id in self.hopeless:
            return NotScored(toss_id, "no transition was solved")
        return pools.toss(toss_id, np.full((1, 1), np.sqrt(self.traces[int(toss_id[-2:])])))


def ids(*numbers: int) -> tuple[str, ...]:
    return tuple(f"toss-{number:02d}" for number in numbers)


def test_the_first_selection_is_the_best_of_the_pool(model: Model, tosses: tuple[Toss, ...]) -> None:
    scorer = MadeUpScorer()
    first = Reranking(tosses, scorer, RerankingConfig(TRACE)).select(model)
    assert (first.trigger, first.toss_ids) == (Trigger.FIRST, ids(*range(39, 29, -1)))
    assert sum(scorer.asked) == COUNT
    assert np.isnan([first.spearman, first.overlap, first.retained]).all()


def test_without_an_occasion_the_selection_stays_and_nothing_is_scored(model: Model, tosses: tuple[Toss, ...]) -> None:
    scorer = MadeUpScorer()
    reranking = Reranking(tosses, scorer, RerankingConfig(TRACE))
    first = reranking.select(model)
    scorer.traces = scorer.traces[::-1]
    assert all(reranking.consider(model, step, step) is None for step in range(1, 100))
    assert (reranking.selected, sum(scorer.asked)) == (first, COUNT)


def test_after_n_epochs_the_whole_pool_is_ranked_anew(model: Model, tosses: tuple[Toss, ...]) -> None:
    scorer = MadeUpScorer()
    reranking = Reranking(tosses, scorer, RerankingConfig(TRACE, epochs=3))
    reranking.select(model)
    scorer.traces = scorer.traces[::-1]
    assert reranking.consider(model, 20, 2) is None
    again = reranking.consider(model, 30, 3)
    assert again is not None
    assert (again.trigger, again.gradient_steps, again.epochs) == (Trigger.EPOCHS, 30, 3)
    assert again.toss_ids == ids(*range(10))
    assert again.spearman == pytest.approx(-1.0)
    assert again.retained == 0.0
    assert reranking.consider(model, 40, 5) is None
    scorer.traces = np.roll(scorer.traces, 4)
    later = reranking.consider(model, 50, 6)
    assert later is not None
    assert (later.toss_ids, later.retained) == (ids(*range(4, 14)), 0.6)


def test_monitored_tosses_that_keep_their_places_leave_the_selection(model: Model, tosses: tuple[Toss, ...]) -> None:
    scorer = MadeUpScorer()
    reranking = Reranking(tosses, scorer, RerankingConfig(TRACE, staleness=STALENESS))
    reranking.select(model)
    scorer.traces = scorer.traces**2
    scorer.asked.clear()
    assert all(reranking.consider(model, step, 0) is None for step in range(1, 11))
    assert scorer.asked == [16, 16]  # they are looked at every five steps, and nothing else is


def test_monitored_tosses_that_change_places_have_the_pool_ranked_again(model: Model, tosses: tuple[Toss, ...]) -> None:
    scorer = MadeUpScorer()
    reranking = Reranking(tosses, scorer, RerankingConfig(TRACE, staleness=STALENESS))
    reranking.select(model)
    scorer.traces = np.random.default_rng(0).permutation(scorer.traces)
    scorer.asked.clear()
    assert reranking.consider(model, 4, 0) is None
    again = reranking.consider(model, 5, 0)
    assert again is not None
    assert (again.trigger, scorer.asked) == (Trigger.STALE, [16, COUNT])
    assert again.spearman < 0.9
    assert [scorer.traces[int(toss_id[-2:])] for toss_id in again.toss_ids] == list(range(40, 30, -1))
    assert reranking.consider(model, 10, 0) is None


def moved_monitored(swaps: Sequence[tuple[int, int]], spearman: float, overlap: float) -> Trigger | None:
    """What follows when pairs of monitored change places in their ranking."""
    model = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.PHYSICAL)
    one, scorer = simulated_tosses(1, seed=1)[0], MadeUpScorer()
    pool = [replace(one, toss_id=f"toss-{k:02d}") for k in range(COUNT)]
    config = StalenessConfig(tosses=20, steps=1, spearman=spearman, overlap=overlap)
    reranking = Reranking(pool, scorer, RerankingConfig(TRACE, staleness=config))
    places = [int(toss_id[-2:]) for toss_id in reranking.select(model).monitored]
    for a, b in swaps:
        scorer.traces[[places[a], places[b]]] = scorer.traces[[places[b], places[a]]]
    again = reranking.consider(model, 1, 0)
    return again.trigger if again else None


def test_the_limit_of_the_overlap_is_met_from_both_sides() -> None:
    # 10 of 40 are kept, so 5 of the 20 monitored are; a staleness that leaves them makes the overlap 0.8.
    assert moved_monitored([(4, 5)], spearman=-1.0, overlap=0.8) is None
    assert moved_monitored([(4, 5)], spearman=-1.0, overlap=0.81) is Trigger.STALE
    assert moved_monitored([(0, 4)], spearman=-1.0, overlap=1.0) is None


def test_the_limit_of_the_correlation_is_met_from_both_sides() -> None:
    correlation = 1.0 - 6.0 * 2.0 * 9.0**2 / (20.0 * (20.0**2 - 1.0))  # places 10 and 19 swapped
    assert moved_monitored([(10, 19)], spearman=correlation - 1e-6, overlap=0.0) is None
    assert moved_monitored([(10, 19)], spearman=correlation + 1e-6, overlap=0.0) is Trigger.STALE


@pytest.mark.parametrize("criterion", ["longest", "random"])
def test_what_no_theta_moves_is_selected_once(model: Model, tosses: tuple[Toss, ...], criterion: str) -> None:
    scorer = MadeUpScorer()
    config = RerankingConfig(RankingConfig(criterion, top=4), epochs=1, staleness=StalenessConfig(steps=1))
    reranking = Reranking(tosses, scorer, config)
    reranking.select(model)
    assert all(reranking.consider(model, step, step) is None for step in range(1, 5))
    assert sum(scorer.asked) == COUNT


def test_one_that_goes_on_from_the_last_selection_does_what_the_first_one_does(model: Model, tosses: tuple[Toss, ...]) -> None:
    config = RerankingConfig(TRACE, epochs=4, staleness=STALENESS)
    scorer = MadeUpScorer()
    undisturbed = Reranking(tosses, scorer, config)
    selected = undisturbed.select(model)
    scorer.traces = np.random.default_rng(3).permutation(scorer.traces)
    restored = Reranking(tuple(reversed(tosses)), scorer, config, selected)
    for step, epoch, trigger in ((5, 0, Trigger.STALE), (10, 4, Trigger.EPOCHS)):
        again = undisturbed.consider(model, step, epoch)
        assert again is not None
        assert (again.trigger, restored.consider(model, step, epoch)) == (trigger, again)


def test_tosses_that_cannot_be_scored_are_named_and_not_kept(model: Model, tosses: tuple[Toss, ...]) -> None:
    scorer = MadeUpScorer()
    scorer.hopeless = set(ids(39, 38))
    first = Reranking(tosses, scorer, RerankingConfig(TRACE)).select(model)
    assert set(first.not_scored) == scorer.hopeless
    assert first.toss_ids == ids(*range(37, 27, -1))
    scorer.hopeless = {toss.toss_id for toss in tosses}
    with pytest.raises(InvalidValueError, match="tosses to rank: found none"):
        Reranking(tosses, scorer, RerankingConfig(TRACE)).select(model)


@pytest.mark.parametrize(
    ("staleness", "taken", "left", "quiet"), [(None, 7, 12, 12), (STALENESS, 7, 12, 3), (STALENESS, 5, 2, 2)]
)
def test_no_occasion_comes_before_the_end_of_the_epoch_and_the_next_look_at_monitored_tosses(
    tosses: tuple[Toss, ...], staleness: StalenessConfig | None, taken: int, left: int, quiet: int
) -> None:
    reranking = Reranking(tosses, MadeUpScorer(), RerankingConfig(TRACE, staleness=staleness))
    assert reranking.quiet_steps(taken, left) == quiet


def test_nothing_is_considered_before_a_first_selection(model: Model, tosses: tuple[Toss, ...]) -> None:
    with pytest.raises(InvalidValueError, match="expected a first one"):
        Reranking(tosses, MadeUpScorer(), RerankingConfig(TRACE)).consider(model, 1, 1)


@pytest.mark.parametrize(
    ("field", "value"), [("tosses", 1), ("steps", 0), ("spearman", 1.1), ("spearman", np.nan), ("overlap", -0.1)]
)
def test_a_staleness_check_without_sense_is_refused(field: str, value: float) -> None:
    with pytest.raises(InvalidValueError, match=f"staleness.{field}: found {value}"):
        StalenessConfig(**{field: value})  # type: ignore[arg-type]


def test_no_epochs_between_selections_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="epochs between selections: found 0"):
        RerankingConfig(epochs=0)


def test_a_polytope_is_ranked_as_the_library_ranks_its_geometry_in_its_own_form() -> None:
    pool = simulated_tosses(6, seed=5)
    for form in Form:
        model = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, form)
        config = ScoringConfig(form=form)
        infos = Scorer(model.geometry(), CONTACTNETS_CUBE, config).score(pool)
        expected = curate([one for one in infos if isinstance(one, TossInformation)], RankingConfig(top=3))
        scorer = toss_scorer(ScoringConfig(), "log-det")
        first = Reranking(pool, scorer, RerankingConfig(RankingConfig(top=3))).select(model)
        assert first.toss_ids == expected.ranking.selected_ids


def test_theta_that_moves_far_changes_the_ranks_of_monitored_tosses_by_real_scores() -> None:
    pool = simulated_tosses(12, seed=5)
    scorer = toss_scorer(ScoringConfig(), "trace")
    config = RerankingConfig(RankingConfig("trace", top=4), staleness=StalenessConfig(tosses=8, steps=1))
    true = ContactGeometry.of_body(CONTACTNETS_CUBE)
    reranking = Reranking(pool, scorer, config)
    reranking.select(PolytopeModel(true, CONTACTNETS_CUBE, Form.PHYSICAL))
    assert reranking.consider(PolytopeModel(true, CONTACTNETS_CUBE, Form.PHYSICAL), 1, 0) is None
    noise = 0.4 * np.random.default_rng(2).standard_normal(true.vertices_normal.shape)
    far = replace(true, vertices_normal=true.vertices_normal + noise)
    again = reranking.consider(PolytopeModel(far, CONTACTNETS_CUBE, Form.PHYSICAL), 2, 0)
    assert isinstance(again, Selected)
    assert again.spearman < 0.9 or again.overlap < 0.8


@pytest.mark.parametrize("criterion", ["longest", "random"])
def test_what_needs_no_scores_ranks_as_the_library_does(model: Model, criterion: str) -> None:
    pool = simulated_tosses(6, seed=5)
    infos = Scorer(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, ScoringConfig()).score(pool)
    ranking = RankingConfig(criterion, top=3, seed=4)
    expected = curate([one for one in infos if isinstance(one, TossInformation)], ranking)
    scorer = toss_scorer(ScoringConfig(), criterion)
    assert Reranking(pool, scorer, RerankingConfig(ranking)).select(model).toss_ids == expected.ranking.selected_ids


@pytest.mark.parametrize("kind", ["deep", "deepvertex", "end_to_end"])
def test_networks_are_ranked_by_what_they_learn(kind: str) -> None:
    pool = simulated_tosses(2, seed=5)
    rows = rows_of(transitions_of(pool, CONTACTNETS_CUBE.length_scale))
    network = model_class(kind).initial(CONTACTNETS_CUBE, Form.PHYSICAL, rows, np.random.default_rng(1))
    config = ScoringConfig(estimator=Estimator.EMPIRICAL)
    scorer = toss_scorer(config, "trace")
    traces = {one.toss_id: one.trace for one in scorer(network, pool) if isinstance(one, TossInformation)}
    kept = Reranking(pool, scorer, RerankingConfig(RankingConfig("trace", top=1))).select(network).toss_ids
    assert kept == tuple(sorted(traces, key=traces.__getitem__, reverse=True)[:1])
