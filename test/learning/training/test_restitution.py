"""A training that learns a restitution, too."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import INITIAL_RESTITUTION, ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import rollout
from contact_curation.errors import InvalidValueError
from contact_curation.learning.checkpoints.checkpoint import checkpoint_bytes, training_of_bytes
from contact_curation.learning.evaluation.rebounds import rebound_of
from contact_curation.learning.fits.refits import subset
from contact_curation.learning.training.protocols import budgeted, exact
from contact_curation.learning.training.training import Training
from contact_curation.motion.transitions import Transitions

E, FRAMES, DT = 0.3, 60, 1.0 / 148.0


@pytest.fixture(scope="module")
def bounced() -> Transitions:
    """Eight motions of the cube as described, which bounces."""
    rng = np.random.default_rng(2)
    release = np.zeros((8, 13))
    release[:, 2] = 3.0
    turns = rng.standard_normal((8, 4))
    release[:, 3:7] = turns / np.linalg.norm(turns, axis=1)[:, None]
    release[:, 7:] = rng.normal(0.0, 4.0, (8, 6))
    geometry = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=E)
    states = rollout(geometry, CONTACTNETS_CUBE, release, FRAMES, DT).states.reshape(8, FRAMES, 13)
    before, after = (states[:, part].reshape(-1, 13) for part in (slice(-1), slice(1, None)))
    return Transitions(tuple("abcdefgh"), before, after, np.full(len(before), DT), (FRAMES - 1) * np.arange(9))


def test_the_restitution_that_made_the_motions_is_learned_and_survives_a_checkpoint(bounced: Transitions) -> None:
    config = replace(exact(), restitution=True, loss=LossConfig(threads=1))
    start = initial_geometry(CONTACTNETS_CUBE, Form.RIGID, np.zeros(3), np.random.default_rng(4), noise=0.02)
    training = Training(PolytopeModel(start, CONTACTNETS_CUBE, Form.RIGID), bounced, None, config, 0)
    training.advance(1)
    learned = training.trained().geometry()
    assert learned is not None
    assert learned.restitution == pytest.approx(E, abs=0.05)
    resumed = training_of_bytes(checkpoint_bytes(training, {}), "here", bounced, None, CONTACTNETS_CUBE)
    assert resumed.config == config
    again = resumed.trained().geometry()
    assert again is not None
    assert again.restitution == learned.restitution


def test_of_few_motions_it_is_learned_with_everything_else(bounced: Transitions) -> None:
    few, _ = subset(bounced, np.arange(3))
    assert rebound_of(few, CONTACTNETS_CUBE) is None
    config = replace(exact(), restitution=True, loss=LossConfig(threads=1))
    start = initial_geometry(CONTACTNETS_CUBE, Form.RIGID, np.zeros(3), np.random.default_rng(4), noise=0.02)
    training = Training(PolytopeModel(start, CONTACTNETS_CUBE, Form.RIGID), few, None, config, 0)
    training.advance(1)
    learned = training.trained().geometry()
    assert learned is not None
    assert learned.restitution not in (None, INITIAL_RESTITUTION)
    assert learned.restitution == pytest.approx(E, abs=0.1)


def test_frames_too_far_apart_to_see_a_rebound_give_none(bounced: Transitions) -> None:
    for every, seen in ((1, True), (4, False)):
        thinned = replace(
            bounced,
            before=bounced.before[::every],
            after=bounced.after[::every],
            dt=every * bounced.dt[::every],
            starts=np.searchsorted(np.arange(len(bounced.dt))[::every], bounced.starts),
        )
        assert (rebound_of(thinned, CONTACTNETS_CUBE) is not None) == seen


def test_only_an_exact_training_in_the_rigid_form_learns_one() -> None:
    with pytest.raises(InvalidValueError, match="restitution: found true, expected false, or the exact protocol"):
        replace(budgeted("polytope"), restitution=True)
    with pytest.raises(InvalidValueError, match="restitution"):
        replace(exact(), form=Form.PHYSICAL, restitution=True)
