"""Models judged by tosses: perfect on its own simulation, the same as the parts it is made of, and honest about what fails."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import rollout
from contact_curation.contact.time_step import SweepLimits
from contact_curation.errors import InvalidValueError
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from contact_curation.learning.evaluation.evaluation import (
    EvaluationConfig,
    comparison,
    evaluate_model,
    predicted_motions,
    shape_errors,
    summary,
    transition_losses,
)
from contact_curation.learning.evaluation.motion_errors import motion_errors
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from test.simulated import simulated_tosses

CUBE = ContactGeometry.of_body(CONTACTNETS_CUBE)
CONFIG = EvaluationConfig(loss=LossConfig(threads=1), bootstrap=BootstrapConfig(resamples=200))


@pytest.fixture(scope="module")
def tosses() -> tuple[Toss, ...]:
    return simulated_tosses(5, seed=1)


def cube(friction: float = 0.18, form: Form = Form.PHYSICAL) -> PolytopeModel:
    return PolytopeModel(ContactGeometry.of_body(replace(CONTACTNETS_CUBE, friction=friction)), CONTACTNETS_CUBE, form)


def test_the_model_that_made_the_tosses_predicts_them(tosses: tuple[Toss, ...]) -> None:
    found = evaluate_model(cube(), tosses, CONFIG)
    assert found.toss_ids == tuple(toss.toss_id for toss in tosses)
    assert found.errors.position.max() < 0.01
    assert found.errors.rotation.max() < 0.05
    assert found.mean_loss < 1e-4
    assert found.losses.shape == (5,)
    assert (found.not_solved, found.sweeps_exhausted, found.not_finite) == (0, 0, ())


def test_friction_at_the_vertices_of_the_gaps_predicts_a_rigid_body_whatever_its_own_vertices_are(
    tosses: tuple[Toss, ...],
) -> None:
    apart = CUBE.vertices_tangent + 0.3 * np.random.default_rng(2).standard_normal(CUBE.vertices_tangent.shape)
    model = PolytopeModel(replace(CUBE, vertices_tangent=apart), CONTACTNETS_CUBE, Form.PHYSICAL)
    rigid = model.with_shared_vertices()
    own, gaps = (predicted_motions(each, tosses, CONFIG).errors for each in (model, rigid))
    assert own.rotation.mean() > 5.0
    assert gaps.rotation.max() < 0.05
    assert gaps.position.max() < 0.01
    np.testing.assert_array_equal(model.geometry().vertices_tangent, apart)  # the model itself is not changed


def test_an_evaluation_is_what_its_parts_give(tosses: tuple[Toss, ...]) -> None:
    model = cube(friction=0.3)
    found = evaluate_model(model, tosses, CONFIG)
    rows = transitions_of(tosses, CONTACTNETS_CUBE.length_scale)
    with torch.no_grad():
        losses = model.batch_loss(Rows(rows.before, rows.after, rows.dt), CONFIG.loss).losses.numpy()
    assert found.transitions == found.steps == len(losses)
    assert found.mean_loss == pytest.approx(losses.mean())
    np.testing.assert_allclose(found.losses, [losses[rows.starts[k] : rows.starts[k + 1]].mean() for k in range(5)])
    for k, toss in enumerate(tosses):
        measured, predicted = found.frames(k)
        alone = rollout(model.geometry(), CONTACTNETS_CUBE, measured[:1], toss.frames, toss.frame_period)
        np.testing.assert_array_equal(predicted, alone.states)
        np.testing.assert_allclose(measured[:, :3] * CONTACTNETS_CUBE.length_scale, toss.positions)
        assert found.errors.position[k] == motion_errors(predicted, measured, [0, len(measured)], CONTACTNETS_CUBE).position[0]
    assert found.errors.position.min() > 1.0  # a friction that is far off


@pytest.mark.parametrize("kind", ["deep", "deepvertex", "end_to_end"])
def test_networks_are_judged_likewise_and_have_no_shape_of_their_own(kind: str, tosses: tuple[Toss, ...]) -> None:
    rows = transitions_of(tosses, CONTACTNETS_CUBE.length_scale)
    data = Rows(rows.before, rows.after, rows.dt)
    model = model_class(kind).initial(CONTACTNETS_CUBE, Form.PHYSICAL, data, np.random.default_rng(1))
    found = evaluate_model(model, [replace(toss, toss_id=f"{toss.toss_id}-b") for toss in tosses[:1]], CONFIG)
    assert found.shape is None
    assert found.errors.position.shape == (1,)
    assert found.mean_loss > 0.0


def test_a_motion_that_is_not_finite_is_named_and_left_out_of_the_summary_only(tosses: tuple[Toss, ...]) -> None:
    wild = replace(tosses[2], linear_velocities=np.full_like(tosses[2].linear_velocities, 1e300))
    mixed = (*tosses[:2], wild, *tosses[3:])
    found = evaluate_model(cube(0.3), mixed, CONFIG)
    clean = evaluate_model(cube(0.3), tosses, CONFIG)
    assert found.not_finite == (wild.toss_id,)
    assert np.isnan(found.errors.position).tolist() == [False, False, True, False, False]
    position = summary(found, CONFIG.bootstrap).position
    assert position is not None
    assert position.mean.value == pytest.approx(np.delete(clean.errors.position, 2).mean())
    paired = comparison(found, clean, CONFIG.bootstrap).position
    assert paired is not None
    assert paired.mean.value == 0.0


def test_two_frames_near_one_of_the_model_are_both_compared_with_it(tosses: tuple[Toss, ...]) -> None:
    seen = np.array([0, 1, 1, *range(3, tosses[0].frames)])
    arrays = ("positions", "orientations_wxyz", "linear_velocities", "angular_velocities")
    stamps = tosses[0].stamps_ns[seen] + 400_000 * (np.arange(len(seen)) == 2)
    toss = replace(tosses[0], stamps_ns=stamps, **{name: getattr(tosses[0], name)[seen] for name in arrays})
    assert predicted_motions(cube(), [toss], CONFIG).errors.position == pytest.approx(0.0, abs=1e-6)


def test_nothing_finite_has_no_summary(tosses: tuple[Toss, ...]) -> None:
    wild = replace(tosses[0], linear_velocities=np.full_like(tosses[0].linear_velocities, 1e300))
    found = evaluate_model(cube(), [wild], CONFIG)
    assert summary(found, CONFIG.bootstrap) == (None, None, None)
    assert comparison(found, found, CONFIG.bootstrap) == (None, None, None)


def test_what_the_solvers_could_not_do_is_counted(tosses: tuple[Toss, ...]) -> None:
    config = replace(CONFIG, loss=LossConfig(max_iterations=14), sweeps=SweepLimits(tolerance=1e-12, max_sweeps=1))
    found = evaluate_model(cube(), tosses, config)
    assert 0 < found.not_solved < found.transitions
    rows = transitions_of(tosses, CONTACTNETS_CUBE.length_scale)
    losses, solved = transition_losses(cube(), Rows(rows.before, rows.after, rows.dt), config.loss)
    own = slice(int(rows.starts[1]), int(rows.starts[2]))
    assert not solved[own].all()
    assert found.losses[1] == pytest.approx(losses[own][solved[own]].mean())
    assert found.mean_loss == pytest.approx(losses[solved].mean())
    assert 0 < found.sweeps_exhausted <= found.steps


def test_differences_are_paired_by_toss(tosses: tuple[Toss, ...]) -> None:
    ours, theirs = evaluate_model(cube(0.3), tosses, CONFIG), evaluate_model(cube(0.25), tosses, CONFIG)
    paired = comparison(ours, theirs, CONFIG.bootstrap).position
    assert paired is not None
    assert paired.mean.value == pytest.approx((ours.errors.position - theirs.errors.position).mean())
    with pytest.raises(InvalidValueError, match="same tosses"):
        comparison(ours, evaluate_model(cube(), tosses[:4], CONFIG), CONFIG.bootstrap)


def test_tosses_of_another_body_are_refused(tosses: tuple[Toss, ...]) -> None:
    with pytest.raises(InvalidValueError, match="body of toss"):
        evaluate_model(cube(), [replace(tosses[0], body="brick")], CONFIG)


def test_shape_errors_are_in_half_widths_and_millimetres() -> None:
    moved = CUBE.vertices_normal.copy()
    moved[3] += [0.3, 0.0, 0.4]
    found = shape_errors(PolytopeModel(replace(CUBE, vertices_normal=moved), CONTACTNETS_CUBE, Form.PHYSICAL))
    assert found is not None
    assert found.vertex_rms == pytest.approx(0.5 / np.sqrt(8.0))
    assert found.vertex_rms_mm == pytest.approx(52.4 * 0.5 / np.sqrt(8.0))
    assert found.friction_error == pytest.approx(0.0)


def test_friction_does_not_depend_on_the_normals_scale_or_the_tangents_turn() -> None:
    turned = 0.7 * np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]]) @ np.diag([0.2, 0.2, 0.0])
    geometry = replace(CUBE, normal=0.7 * CUBE.normal, tangents=turned)
    found = shape_errors(PolytopeModel(geometry, CONTACTNETS_CUBE, Form.CONTACTNETS))
    assert found is not None
    assert found.friction == pytest.approx(0.2)
