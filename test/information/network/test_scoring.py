"""Tosses scored for networks: exact traces, exact blocks, factors from rows, the same digits in any company."""

import copy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.information.curation import curate_particles
from contact_curation.information.factors import Compression, factor_of_fisher
from contact_curation.information.model_version import model_version
from contact_curation.information.network.config import NetworkConfig
from contact_curation.information.network.forward_pass import forward_pass, frozen_copy
from contact_curation.information.network.scoring import NetworkScorer, factor_of_rows
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, criterion_names
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.information.subspace import LEADING_DIRECTIONS
from contact_curation.motion.toss import Toss
from test.contact.cases import CUBE
from test.information.network_cases import NETWORKS, long_scores, network, rows_of, some_not_solved, tosses

EMPIRICAL = ScoringConfig(estimator=Estimator.EMPIRICAL)
SHORT = tuple(sorted(tosses(), key=lambda toss: toss.frames))[:2]


def scored(
    model: Model,
    config: ScoringConfig,
    given: tuple[Toss, ...] = SHORT,
    network_config: NetworkConfig | None = None,
) -> list[TossInformation]:
    found = NetworkScorer(model, config, network_config).score(given)
    assert all(isinstance(info, TossInformation) for info in found)
    return [info for info in found if isinstance(info, TossInformation)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", NETWORKS)
def test_each_networks_trace_is_that_of_all_its_weights(kind: str) -> None:
    info = scored(network(kind), EMPIRICAL, SHORT[:1])[0]
    traces = dict(zip((block.name for block in info.blocks), info.block_traces, strict=True))
    for name, scores in long_scores(network(kind), rows_of(SHORT[:1])).items():
        assert traces[name] == pytest.approx(np.square(scores).sum(), rel=1e-9)


@pytest.mark.parametrize("estimator", list(Estimator))
@pytest.mark.parametrize("form", [Form.PHYSICAL, Form.CONTACTNETS])
def test_with_silent_networks_the_physical_block_is_the_polytopes_information(form: Form, estimator: Estimator) -> None:
    geometry = initial_geometry(CUBE, form, np.array([0.5, -0.3, 0.0]), np.random.default_rng(3))
    config = ScoringConfig(estimator=estimator, form=form, influence_bound=0.3)
    silent = DeepModel(geometry, CUBE, form)
    expected = Scorer(geometry, CUBE, config).score(SHORT)
    for one, other in zip(scored(silent, config, network_config=NetworkConfig(physical_only=True)), expected, strict=True):
        assert isinstance(other, TossInformation)
        assert one.blocks == other.blocks
        np.testing.assert_allclose(one.block_traces, other.block_traces, rtol=1e-4)
        np.testing.assert_allclose(one.score_sum, other.score_sum, atol=1e-6 * np.abs(other.score_sum).max())
        np.testing.assert_allclose(one.fisher(), other.fisher(), atol=1e-5 * other.trace)
        np.testing.assert_array_equal(one.tilt_axes, other.tilt_axes)


def test_a_deep_model_has_no_rigid_form() -> None:
    geometry = initial_geometry(CUBE, Form.RIGID, np.zeros(3), np.random.default_rng(3))
    with pytest.raises(
        InvalidValueError, match=r"^form of the polytope in a deep model: found rigid, expected physical or contactnets$"
    ):
        DeepModel(geometry, CUBE, Form.RIGID)


@pytest.mark.parametrize("kind", ["deepvertex", "end_to_end"])
def test_a_model_without_a_polytope_to_learn_has_no_physical_block(kind: str) -> None:
    with pytest.raises(
        InvalidValueError,
        match=rf"^physical block of model: found {kind}, expected deep, or another model with parameters outside its networks$",
    ):
        NetworkScorer(network(kind), EMPIRICAL, NetworkConfig(physical_only=True))


@pytest.mark.parametrize("kind", NETWORKS)
@pytest.mark.parametrize("estimator", list(Estimator))
@pytest.mark.slow
def test_a_toss_is_scored_alike_alone_and_among_others(kind: str, estimator: Estimator) -> None:
    config = ScoringConfig(estimator=estimator)
    together, alone = scored(network(kind), config), [scored(network(kind), config, (toss,))[0] for toss in reversed(SHORT)]
    for one, other in zip(together, reversed(alone), strict=True):
        np.testing.assert_array_equal(one.factor, other.factor)
        np.testing.assert_array_equal(one.score_sum, other.score_sum)
        np.testing.assert_array_equal(one.block_traces, other.block_traces)


def test_a_record_says_what_it_was_made_with() -> None:
    model = network("deep")
    info = scored(model, replace(EMPIRICAL, influence_bound=0.3))[0]
    assert (info.model, info.estimator, info.influence_bound, info.body) == ("deep", "empirical", 0.3, "cube")
    assert info.parameters_version == model_version(model)
    assert [block.name for block in info.blocks if block.sketched] == ["normal_network", "tangent_network"]
    assert next(block.name for block in info.blocks if not block.sketched) == "vertices_normal"
    assert info.transitions == SHORT[0].frames - 1
    assert info.factor.dtype == np.float32
    assert len(info.factor) <= Compression().max_rows


def test_a_bound_on_influence_scales_scores_of_larger_losses() -> None:
    model, rows = network("deepvertex"), rows_of(SHORT[:1])
    (losses,) = NetworkScorer(model, EMPIRICAL).losses(SHORT[:1])
    assert losses.shape == (SHORT[0].frames - 1,)
    bound = float(np.quantile(losses, 0.9))
    scores = long_scores(model, rows)["network"] * np.minimum(1.0, bound / losses)[:, None]
    info = scored(model, replace(EMPIRICAL, influence_bound=bound), SHORT[:1])[0]
    assert info.trace == pytest.approx(np.square(scores).sum(), rel=1e-9)
    assert info.trace < 0.9 * scored(model, EMPIRICAL, SHORT[:1])[0].trace


def test_a_toss_without_a_solved_transition_is_not_scored_and_says_why() -> None:
    found = NetworkScorer(network("deep"), ScoringConfig(loss=LossConfig(max_iterations=1))).score(SHORT[:1])[0]
    assert isinstance(found, NotScored)
    assert found.reason.startswith(f"0 of {SHORT[0].frames - 1} transitions solved")


def test_transitions_that_are_not_solved_are_counted_and_left_out() -> None:
    model, rows = network("deepvertex"), rows_of(SHORT[:1])
    strict = some_not_solved(model, rows)
    info = scored(model, replace(EMPIRICAL, loss=strict), SHORT[:1])[0]
    assert info.not_scored == np.count_nonzero(~forward_pass(frozen_copy(model), rows, strict).solved)
    assert info.trace == pytest.approx(np.square(long_scores(model, rows, strict)["network"]).sum(), rel=1e-9)


def test_a_toss_of_another_body_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"^body of toss \S+: found brick, expected cube$"):
        NetworkScorer(network("deep"), EMPIRICAL).score([replace(SHORT[0], body="brick")])


@cache
def pool_of_network(kind: str) -> Pool:
    return pool_of(scored(network(kind), EMPIRICAL, tosses()))


@pytest.mark.parametrize("criterion", criterion_names())
@pytest.mark.parametrize(
    "kind", [one if one == "deepvertex" else pytest.param(one, marks=pytest.mark.slow) for one in NETWORKS]
)
def test_every_criterion_ranks_tosses_scored_for_a_network(kind: str, criterion: str) -> None:
    curation = curate_particles([pool_of_network(kind)], RankingConfig(criterion, top=3))
    assert sorted(curation.ranking.ids) == sorted(toss.toss_id for toss in tosses())
    assert 16 < curation.dimension <= LEADING_DIRECTIONS
    assert np.isfinite(curation.epsilon)


def test_weights_that_are_not_finite_are_refused() -> None:
    model = copy.deepcopy(network("deep"))
    with torch.no_grad():
        next(model.parameters()).view(-1)[0] = np.nan
    with pytest.raises(
        InvalidValueError, match=r"^parameters of \w+: found a value that is not finite, expected finite numbers$"
    ):
        NetworkScorer(model, EMPIRICAL)


@pytest.mark.parametrize("shape", [(5, 40), (40, 12), (30, 30), (1, 6)])
@pytest.mark.parametrize("rows", [3, 24])
def test_the_factor_is_that_of_the_fisher_matrix(shape: tuple[int, int], rows: int) -> None:
    scores = np.random.default_rng(0).standard_normal(shape) * np.exp(np.linspace(0.0, 3.0, shape[1]))
    one, other = factor_of_rows(scores, Compression(rows)), factor_of_fisher(scores.T @ scores, Compression(rows))
    np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())


def test_rows_that_repeat_each_other_count_once() -> None:
    scores = np.tile(np.random.default_rng(1).standard_normal((2, 30)), (4, 1))
    factor = factor_of_rows(scores, Compression())
    assert len(factor) == 2
    np.testing.assert_allclose(factor.T @ factor, scores.T @ scores, atol=1e-12)


@pytest.mark.parametrize("count", [0, 3])
def test_silence_has_an_empty_factor(count: int) -> None:
    factor = factor_of_rows(np.zeros((count, 8)), Compression())
    assert factor.shape == (0, 8)
