"""A toss becomes information: what is summed, about which point, at which theta, and what if nothing can be scored."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator, evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, parameter_form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.factors import Compression
from contact_curation.information.network.model_scorer import scorer_of_model
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig, parameters_version
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.storage.stores.information import packed_information
from test.simulated import RIG_NOISE, simulated_tosses

CUBE = CONTACTNETS_CUBE
TRUE = ContactGeometry.of_body(CUBE)
TOSSES = simulated_tosses(3, seed=21, noise=RIG_NOISE)
SINGLE = 2.0 * float(np.finfo(np.float32).eps)
"""What rounding a factor's rows to single precision may do to its Fisher matrix, as a share of the trace."""
EMPIRICAL = ScoringConfig(estimator=Estimator.EMPIRICAL, compression=Compression(max_rows=60))


@pytest.mark.parametrize("form", list(Form))
def test_the_scorer_of_a_polytope_has_the_models_theta_and_form(form: Form) -> None:
    scorer = scorer_of_model(PolytopeModel(TRUE, CUBE, form), EMPIRICAL)
    assert isinstance(scorer, Scorer)
    assert scorer.config == replace(EMPIRICAL, form=form)
    assert scorer.body is CUBE
    np.testing.assert_allclose(scorer.geometry.vertices_normal, TRUE.vertices_normal)


def scored(geometry: ContactGeometry, config: ScoringConfig, tosses: tuple[Toss, ...] = TOSSES) -> list[TossInformation]:
    found = Scorer(geometry, CUBE, config).score(tosses)
    assert all(isinstance(info, TossInformation) for info in found)
    return [info for info in found if isinstance(info, TossInformation)]


def scores_about_the_centroid(toss: Toss) -> Array:
    """(T, 52) scores in the physical form, the tilt about the toss's mean position."""
    rows = transitions_of([toss], CUBE.length_scale)
    centroid = toss.positions.mean(axis=0) / CUBE.length_scale
    centred = replace(TRUE, pivot=centroid, height=float(TRUE.normal @ -centroid))  # the same plane
    return evaluate(centred, CUBE, rows.before, rows.after, rows.dt).scores @ parameter_form(centred, Form.PHYSICAL).chart


def test_information_is_summed_from_scores_about_the_tosss_own_centroid() -> None:
    for toss, info in zip(TOSSES, scored(TRUE, EMPIRICAL), strict=True):
        scores = scores_about_the_centroid(toss)
        fisher = scores.T @ scores
        np.testing.assert_allclose(info.fisher(), fisher, atol=SINGLE * np.trace(fisher))
        np.testing.assert_allclose(info.score_sum, scores.sum(axis=0), atol=1e-8)
        assert info.trace == pytest.approx(np.trace(fisher), rel=1e-9)
        assert [block.name for block in info.blocks] == ["vertices_normal", "vertices_tangent", "friction", "tilt", "height"]


@pytest.mark.parametrize("estimator", list(Estimator))
def test_it_does_not_matter_about_which_point_the_plane_is_written(estimator: Estimator) -> None:
    pivot = np.array([3.0, -2.0, 0.4])
    elsewhere = replace(TRUE, pivot=pivot, height=float(TRUE.normal @ -pivot))
    config = replace(EMPIRICAL, estimator=estimator)
    for one, other in zip(scored(TRUE, config), scored(elsewhere, config), strict=True):
        np.testing.assert_allclose(one.fisher(), other.fisher(), atol=SINGLE * one.trace)


@pytest.mark.parametrize("form", [Form.RIGID, Form.PHYSICAL])
def test_a_board_far_from_the_origin_changes_no_information(form: Form) -> None:
    config = ScoringConfig(form=form)
    far = tuple(replace(toss, positions=toss.positions + np.array([9e5, -7e5, 0.0])) for toss in TOSSES)
    for one, other in zip(scored(TRUE, config), scored(TRUE, config, far), strict=True):
        np.testing.assert_allclose(one.fisher(), other.fisher(), atol=1e-4 * one.trace)
        np.testing.assert_allclose(one.score_sum, other.score_sum, atol=1e-4 * np.abs(one.score_sum).max())
    scorer = Scorer(TRUE, CUBE, config)
    begun = scorer.begin(unfinished(far[0]))
    assert begun is not None
    assert_same_bits(begun.score(far[0]), scorer.score(far[:1])[0])


def test_a_toss_is_scored_alike_alone_and_among_others() -> None:
    together, alone = scored(TRUE, ScoringConfig()), [scored(TRUE, ScoringConfig(), (toss,))[0] for toss in TOSSES]
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_array_equal(one.factor, other.factor)
        np.testing.assert_array_equal(one.score_sum, other.score_sum)
        assert one.mean_loss == other.mean_loss


def test_a_factor_is_kept_in_single_precision_and_everything_else_in_double() -> None:
    info = scored(TRUE, ScoringConfig())[0]
    assert info.factor.dtype == np.float32
    assert {value.dtype for value in (info.block_traces, info.score_sum, info.centroid)} == {np.dtype(float)}
    assert info.fisher().dtype == np.dtype(float)


def test_a_record_says_what_it_was_made_with() -> None:
    info = scored(TRUE, replace(EMPIRICAL, influence_bound=0.3, form=Form.CONTACTNETS))[0]
    assert (info.estimator, info.influence_bound, info.model, info.body) == ("empirical", 0.3, "polytope", "cube")
    assert info.parameters_version == parameters_version(TRUE, CUBE)
    assert info.parameters == 57
    assert info.tilt_axes.shape == (0, 3)
    assert info.transitions == TOSSES[0].frames - 1
    assert info.not_scored == 0
    assert info.duration == TOSSES[0].duration


def test_every_number_of_theta_and_body_is_in_the_version() -> None:
    versions = {parameters_version(TRUE, CUBE)}
    for name in ("vertices_normal", "normal", "vertices_tangent", "tangents", "pivot"):
        versions.add(parameters_version(replace(TRUE, **{name: getattr(TRUE, name) + 1e-12}), CUBE))
    versions.add(parameters_version(replace(TRUE, height=1e-12), CUBE))
    for name in ("mass", "gravity", "length_scale"):
        versions.add(parameters_version(TRUE, replace(CUBE, **{name: getattr(CUBE, name) * 1.001})))
    assert len(versions) == 10
    assert parameters_version(TRUE, CUBE) in versions
    rigid = [parameters_version(TRUE.rigid(), replace(CUBE, friction=friction)) for friction in (0.2, 0.3, 0.31, 0.6)]
    assert rigid[0] == rigid[1]  # a described friction up to 0.3 changes no loss
    assert len(set(rigid)) == 3


def test_a_toss_without_a_solved_transition_is_not_scored_and_says_why() -> None:
    hurried = ScoringConfig(loss=LossConfig(max_iterations=1))
    found = Scorer(TRUE, CUBE, hurried).score(TOSSES[:1])[0]
    assert isinstance(found, NotScored)
    assert found.toss_id == TOSSES[0].toss_id
    assert found.reason.startswith(f"0 of {TOSSES[0].frames - 1} transitions solved")


def test_a_toss_of_another_body_is_refused() -> None:
    with pytest.raises(InvalidValueError, match=r"^body of toss \S+: found brick, expected cube$"):
        Scorer(TRUE, CUBE, ScoringConfig()).score([replace(TOSSES[0], body="brick")])


def test_losses_are_those_that_a_bound_is_chosen_from() -> None:
    losses = Scorer(TRUE, CUBE, EMPIRICAL).losses(TOSSES)
    assert [len(one) for one in losses] == [toss.frames - 1 for toss in TOSSES]
    bound = float(np.quantile(np.concatenate(losses), 0.985))
    free, held = (sum(info.trace for info in scored(TRUE, replace(EMPIRICAL, influence_bound=b))) for b in (np.inf, bound))
    assert held < 0.9 * free


def unfinished(toss: Toss) -> Toss:
    """A toss as it is known before its last velocities."""
    linear, angular = toss.linear_velocities.copy(), toss.angular_velocities.copy()
    linear[-1] += 0.01
    angular[-1] -= 0.1
    return replace(toss, linear_velocities=linear, angular_velocities=angular)


@pytest.mark.parametrize("estimator", list(Estimator))
@pytest.mark.parametrize("form", list(Form))
def test_a_toss_that_was_begun_is_scored_to_the_same_bits(form: Form, estimator: Estimator) -> None:
    scorer = Scorer(TRUE, CUBE, ScoringConfig(estimator=estimator, form=form, influence_bound=0.5))
    for toss in TOSSES:
        begun = scorer.begin(unfinished(toss))
        assert begun is not None
        assert_same_bits(begun.score(toss), scorer.score([toss])[0])
        begun = scorer.begin(unfinished(toss), scorer.begin(unfinished(first_frames(toss, toss.frames - 5))))
        assert begun is not None
        assert len(begun.sums.parts) == 2
        assert_same_bits(begun.score(toss), scorer.score([toss])[0])


def first_frames(toss: Toss, count: int) -> Toss:
    names = ("stamps_ns", "positions", "orientations_wxyz", "linear_velocities", "angular_velocities")
    return replace(toss, **{name: getattr(toss, name)[:count] for name in names})


def assert_same_bits(one: TossInformation | NotScored, other: TossInformation | NotScored) -> None:
    assert isinstance(one, TossInformation)
    assert isinstance(other, TossInformation)
    assert (one.toss_id, one.parameters_version) == (other.toss_id, other.parameters_version)
    assert packed_information(one) == packed_information(other)


def test_a_toss_that_was_begun_is_not_scored_again_but_for_its_last_transition(monkeypatch: pytest.MonkeyPatch) -> None:
    scorer = Scorer(TRUE, CUBE, ScoringConfig(form=Form.RIGID))
    begun = scorer.begin(unfinished(TOSSES[0]))
    assert begun is not None
    assert begun.fits(TOSSES[0])
    monkeypatch.setattr(Scorer, "_sums", None)
    assert isinstance(begun.score(TOSSES[0]), TossInformation)


@pytest.mark.parametrize("changed", ["positions", "linear_velocities", "stamps_ns"])
def test_a_toss_that_is_not_the_one_that_was_begun_is_scored_from_the_beginning(changed: str) -> None:
    scorer = Scorer(TRUE, CUBE, ScoringConfig(form=Form.RIGID))
    begun = scorer.begin(unfinished(TOSSES[0]))
    values = getattr(TOSSES[0], changed).copy()
    if changed == "stamps_ns":
        values[5:] += 20_000_000
    else:
        values[5] += 1e-6
    other = replace(TOSSES[0], **{changed: values})
    assert begun is not None
    assert not begun.fits(other)
    assert_same_bits(begun.score(other), scorer.score([other])[0])


def test_a_toss_of_one_transition_is_not_begun() -> None:
    assert Scorer(TRUE, CUBE, ScoringConfig()).begin(first_frames(TOSSES[0], 2)) is None


def test_a_longer_toss_that_begins_otherwise_is_begun_again() -> None:
    scorer = Scorer(TRUE, CUBE, ScoringConfig(form=Form.RIGID))
    for earlier in (first_frames(TOSSES[1], 20), TOSSES[0]):
        begun = scorer.begin(unfinished(TOSSES[0]), scorer.begin(earlier))
        assert begun is not None
        assert len(begun.sums.parts) == 1
        assert_same_bits(begun.score(TOSSES[0]), scorer.score([TOSSES[0]])[0])
