"""What is shown of a toss obeys mechanics."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE as BODY
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.model import Rows
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.dashboard import toss_motion
from contact_curation.dashboard.toss_motion import ShownTheta, TossMotion, motion_of
from contact_curation.information.impacts import merged_impacts
from contact_curation.motion.transitions import transitions_of
from test.simulated import simulated_tosses

TRUE = ContactGeometry.of_body(BODY)
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def motion() -> TossMotion:
    (toss,) = simulated_tosses(1, seed=4)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toss_motion, "SMALLEST_SHARE", 0.0)
        return motion_of(toss, BODY, ShownTheta("true", TRUE), DEFAULT_LOSS)


def test_at_the_true_theta_a_toss_without_noise_is_predicted(motion: TossMotion) -> None:
    assert motion.position_error < 1e-6
    assert motion.predicted[:, 3:7] == pytest.approx(motion.toss.orientations_wxyz, abs=1e-4)


def test_the_impulses_are_what_changes_the_momentum_beside_gravity(motion: TossMotion) -> None:
    toss = motion.toss
    fall = BODY.gravity * toss.frame_period * (toss.frames - 1) * UP
    expected = BODY.mass * (toss.linear_velocities[-1] - toss.linear_velocities[0] + fall)
    assert motion.impulses.vectors.sum(axis=0) == pytest.approx(expected, abs=0.02 * float(np.linalg.norm(expected)))


def test_every_impulse_pushes_within_the_friction_cone_and_belongs_to_a_frame(motion: TossMotion) -> None:
    across = np.linalg.norm(motion.impulses.vectors[:, :2], axis=1)
    assert (across <= BODY.friction * motion.impulses.vectors[:, 2] + 1e-6).all()
    assert motion.impulses.frames.min() >= 1
    assert motion.impulses.frames.max() <= motion.toss.frames - 1


def test_impulses_too_small_to_see_are_left_out() -> None:
    (toss,) = simulated_tosses(1, seed=4)
    shown = motion_of(toss, BODY, ShownTheta("true", TRUE), DEFAULT_LOSS).impulses
    sizes = np.linalg.norm(shown.vectors, axis=1)
    assert 0.02 * sizes.max() < sizes.min()


def test_a_toss_that_lacks_frames_is_predicted_at_those_that_it_has() -> None:
    (whole,) = simulated_tosses(1, seed=4)
    seen = np.delete(np.arange(whole.frames), [7, 20, 21])
    arrays = ("stamps_ns", "positions", "orientations_wxyz", "linear_velocities", "angular_velocities")
    toss = replace(whole, **{name: getattr(whole, name)[seen] for name in arrays})
    motion = motion_of(toss, BODY, ShownTheta("true", TRUE), DEFAULT_LOSS)
    assert motion.predicted.shape == (toss.frames, 13)
    assert motion.position_error < 1e-6


def test_with_a_restitution_impulses_are_those_of_the_transitions_that_are_scored(motion: TossMotion) -> None:
    bouncing = replace(TRUE.rigid(), restitution=0.0)
    shown = motion_of(motion.toss, BODY, ShownTheta("bouncing", bouncing), DEFAULT_LOSS).impulses
    merged = merged_impacts(transitions_of([motion.toss], BODY.length_scale), BODY)
    assert len(merged.dt) < motion.toss.frames - 1
    assert shown.frames.max() <= len(merged.dt)


def test_the_vertices_are_those_of_theta() -> None:
    (toss,) = simulated_tosses(1, seed=4)
    larger = replace(TRUE, vertices_normal=1.1 * TRUE.vertices_normal)
    motion = motion_of(toss, BODY, ShownTheta("larger", larger), DEFAULT_LOSS)
    assert motion.vertices == pytest.approx(1.1 * BODY.vertices)
    assert motion.position_error > 1e-3


def test_a_network_is_rolled_out_and_has_no_impulses() -> None:
    (toss,) = simulated_tosses(1, seed=4)
    rows = transitions_of([toss], BODY.length_scale)
    data = Rows(rows.before, rows.after, rows.dt)
    model = model_class("end_to_end").initial(BODY, Form.PHYSICAL, data, np.random.default_rng(0))
    motion = motion_of(toss, BODY, ShownTheta("network", model=model), DEFAULT_LOSS)
    assert motion.predicted.shape == (toss.frames, 13)
    assert motion.impulses.vectors.shape == (0, 3)
    assert motion.vertices == pytest.approx(BODY.vertices)
