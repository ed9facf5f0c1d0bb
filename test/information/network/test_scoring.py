"""Tosses scored for networks: exact traces, the polytope's own block, the same digits in any company."""

import copy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch

from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.models.polytope import initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.information.curation import curate_particles
from contact_curation.information.factors import Compression
from contact_curation.information.model_version import model_version
from contact_curation.information.network.config import NetworkConfig
from contact_curation.information.network.forward_pass import NetworkModel, forward_pass, frozen_copy
from contact_curation.information.network.scoring import NetworkScorer
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, criterion_names
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.information.subspace import LEADING_DIRECTIONS
from contact_curation.motion.toss import Toss
from test.contact.cases import CUBE
from test.information.network_cases import NETWORKS, long_scores, network, rows_of, tosses

EMPIRICAL = ScoringConfig(estimator=Estimator.EMPIRICAL)
SHORT = tuple(sorted(tosses(), key=lambda toss: toss.frames))[:2]


def scored(
    model: NetworkModel,
    config: ScoringConfig,
    given: tuple[Toss, ...] = SHORT,
    network_config: NetworkConfig | None = None,
) -> list[TossInformation]:
    found = NetworkScorer(model, config, network_config).score(given)
    assert all(isinstance(info, TossInformation) for info in found)
    return [info for info in found if isinstance(info, TossInformation)]


@pytest.mark.parametrize("kind", NETWORKS)
def test_each_networks_trace_is_that_of_all_its_weights(kind: ModelKind) -> None:
    info = scored(network(kind), EMPIRICAL, SHORT[:1])[0]
    traces = dict(zip((block.name for block in info.blocks), info.block_traces, strict=True))
    for name, scores in long_scores(network(kind), rows_of(SHORT[:1])).items():
        assert traces[name] == pytest.approx(np.square(scores).sum(), rel=1e-9)


@pytest.mark.parametrize("estimator", list(Estimator))
@pytest.mark.parametrize("form", list(Form))
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


@pytest.mark.parametrize("kind", [ModelKind.DEEPVERTEX, ModelKind.END_TO_END])
def test_a_model_without_a_polytope_to_learn_has_no_physical_block(kind: ModelKind) -> None:
    with pytest.raises(InvalidValueError, match=f"physical block of model: found {kind.value}"):
        NetworkScorer(network(kind), EMPIRICAL, NetworkConfig(physical_only=True))


@pytest.mark.parametrize("kind", NETWORKS)
@pytest.mark.parametrize("estimator", list(Estimator))
def test_a_toss_is_scored_alike_alone_and_among_others(kind: ModelKind, estimator: Estimator) -> None:
    config = ScoringConfig(estimator=estimator)
    together, alone = scored(network(kind), config), [scored(network(kind), config, (toss,))[0] for toss in reversed(SHORT)]
    for one, other in zip(together, reversed(alone), strict=True):
        np.testing.assert_array_equal(one.factor, other.factor)
        np.testing.assert_array_equal(one.score_sum, other.score_sum)
        np.testing.assert_array_equal(one.block_traces, other.block_traces)


def test_a_record_says_what_it_was_made_with() -> None:
    model = network(ModelKind.DEEP)
    info = scored(model, replace(EMPIRICAL, influence_bound=0.3))[0]
    assert (info.model, info.estimator, info.influence_bound, info.body) == ("deep", "empirical", 0.3, "cube")
    assert info.parameters_version == model_version(model)
    assert [block.name for block in info.blocks if block.sketched] == ["normal_network", "tangent_network"]
    assert next(block.name for block in info.blocks if not block.sketched) == "vertices_normal"
    assert info.transitions == SHORT[0].frames - 1
    assert info.factor.dtype == np.float32
    assert len(info.factor) <= Compression().max_rows


def test_a_bound_on_influence_scales_scores_of_larger_losses() -> None:
    model, rows = network(ModelKind.DEEPVERTEX), rows_of(SHORT[:1])
    (losses,) = NetworkScorer(model, EMPIRICAL).losses(SHORT[:1])
    assert losses.shape == (SHORT[0].frames - 1,)
    bound = float(np.quantile(losses, 0.9))
    scores = long_scores(model, rows)["network"] * np.minimum(1.0, bound / losses)[:, None]
    info = scored(model, replace(EMPIRICAL, influence_bound=bound), SHORT[:1])[0]
    assert info.trace == pytest.approx(np.square(scores).sum(), rel=1e-9)
    assert info.trace < 0.9 * scored(model, EMPIRICAL, SHORT[:1])[0].trace


def test_a_toss_without_a_solved_transition_is_not_scored_and_says_why() -> None:
    found = NetworkScorer(network(ModelKind.DEEP), ScoringConfig(loss=LossConfig(max_iterations=1))).score(SHORT[:1])[0]
    assert isinstance(found, NotScored)
    assert found.reason.startswith(f"0 of {SHORT[0].frames - 1} transitions solved")


def test_transitions_that_are_not_solved_are_counted_and_left_out() -> None:
    model, rows = network(ModelKind.DEEPVERTEX), rows_of(SHORT[:1])
    misfits = forward_pass(frozen_copy(model), rows, LossConfig()).misfits
    strict = LossConfig(tolerance=float(np.sort(misfits)[-2:].mean()))
    info = scored(model, replace(EMPIRICAL, loss=strict), SHORT[:1])[0]
    assert info.not_scored == 1
    assert info.trace == pytest.approx(np.square(long_scores(model, rows, strict)["network"]).sum(), rel=1e-9)


def test_a_toss_of_another_body_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="expected cube"):
        NetworkScorer(network(ModelKind.DEEP), EMPIRICAL).score([replace(SHORT[0], body="brick")])


@cache
def pool_of_network(kind: ModelKind) -> Pool:
    return pool_of(scored(network(kind), EMPIRICAL, tosses()))


@pytest.mark.parametrize("criterion", criterion_names())
@pytest.mark.parametrize(
    "kind", [one if one is ModelKind.DEEPVERTEX else pytest.param(one, marks=pytest.mark.slow) for one in NETWORKS]
)
def test_every_criterion_ranks_tosses_scored_for_a_network(kind: ModelKind, criterion: str) -> None:
    curation = curate_particles([pool_of_network(kind)], RankingConfig(criterion, top=3))
    assert sorted(curation.ranking.ids) == sorted(toss.toss_id for toss in tosses())
    assert 16 < curation.dimension <= LEADING_DIRECTIONS
    assert np.isfinite(curation.epsilon)


def test_weights_that_are_not_finite_are_refused() -> None:
    model = copy.deepcopy(network(ModelKind.DEEP))
    with torch.no_grad():
        next(model.parameters()).view(-1)[0] = np.nan
    with pytest.raises(InvalidValueError, match="not finite"):
        NetworkScorer(model, EMPIRICAL)
