"""A training that learns a restitution, too."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import INITIAL_RESTITUTION, ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.rollout import rollout
from contact_curation.errors import InvalidValueError
from contact_curation.learning.checkpoints.checkpoint import checkpoint_bytes, training_of_bytes
from contact_curation.learning.checkpoints.safetensors_bytes import pack, unpack
from contact_curation.learning.evaluation.rebounds import Rebound, rebound_of
from contact_curation.learning.fits import exact_fit
from contact_curation.learning.fits.refits import subset
from contact_curation.learning.fits.restitution_by_motions import FEWEST, STEP, restitution_by_motions
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


def training_of(data: Transitions) -> Training:
    """An exact training, at its optimum."""
    config = replace(exact(), restitution=True, loss=LossConfig(threads=1))
    start = initial_geometry(CONTACTNETS_CUBE, Form.RIGID, np.zeros(3), np.random.default_rng(4), noise=0.02)
    training = Training(PolytopeModel(start, CONTACTNETS_CUBE, Form.RIGID), data, None, config, 0)
    training.advance(1)
    return training


def restitution(model: Model) -> float | None:
    geometry = model.geometry()
    assert geometry is not None
    return geometry.restitution


def test_the_restitution_that_made_the_motions_is_learned_and_survives_a_checkpoint(bounced: Transitions) -> None:
    training = training_of(bounced)
    assert restitution(training.trained()) == pytest.approx(E, abs=0.05)
    resumed = training_of_bytes(checkpoint_bytes(training, {}), "here", bounced, None, CONTACTNETS_CUBE)
    assert resumed.config == training.config
    assert restitution(resumed.trained()) == restitution(training.trained())


def test_of_few_motions_it_is_learned_with_everything_else(bounced: Transitions) -> None:
    few, _ = subset(bounced, np.arange(3))
    assert rebound_of(few, CONTACTNETS_CUBE) is None
    learned = restitution(training_of(few).trained())
    assert learned not in (None, INITIAL_RESTITUTION)
    assert learned == pytest.approx(E, abs=0.1)


@pytest.mark.slow
def test_what_first_impacts_show_is_its_prior(bounced: Transitions, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exact_fit, "restitution_by_motions", lambda model, *_: restitution(model))
    monkeypatch.setattr(exact_fit, "rebound_of", lambda *_: Rebound(0.6, 1e-4))
    assert restitution(training_of(bounced).trained()) == pytest.approx(0.6, abs=0.01)
    monkeypatch.setattr(exact_fit, "rebound_of", lambda *_: Rebound(0.6, 10.0))
    assert restitution(training_of(bounced).trained()) == pytest.approx(E, abs=0.05)


def test_motions_choose_it_where_transitions_mislead(bounced: Transitions, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exact_fit, "rebound_of", lambda *_: Rebound(0.6, 1e-4))
    assert restitution(training_of(bounced).trained()) == pytest.approx(E, abs=STEP)


def test_motions_that_do_not_tell_leave_it(bounced: Transitions) -> None:
    geometry = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=0.62)
    model, loss = PolytopeModel(geometry, CONTACTNETS_CUBE, Form.RIGID), LossConfig(threads=1)
    in_the_air = np.concatenate([start + np.arange(3) for start in bounced.starts[:-1]])
    before, after, dt = (values[in_the_air] for values in (bounced.before, bounced.after, bounced.dt))
    falls = Transitions(bounced.toss_ids, before, after, dt, 3 * np.arange(9))
    few, _ = subset(bounced, np.arange(FEWEST - 1))
    assert restitution_by_motions(model, falls, loss) == restitution_by_motions(model, few, loss) == 0.62
    assert restitution_by_motions(model, bounced, loss) == pytest.approx(E, abs=STEP)


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


def test_gradient_steps_from_a_model_that_bounces_take_impacts_as_one(bounced: Transitions) -> None:
    geometry = replace(ContactGeometry.of_body(CONTACTNETS_CUBE).rigid(), restitution=E)
    model = PolytopeModel(geometry, CONTACTNETS_CUBE, Form.RIGID)
    training = Training(model, bounced, None, replace(budgeted("polytope"), steps=40), 0)
    assert len(training.data.dt) < len(bounced.dt)
    assert training.advance(40).epochs > 0


@pytest.mark.slow
def test_a_checkpoint_of_an_earlier_version_with_an_order_of_single_impacts_is_resumed(bounced: Transitions) -> None:
    training = training_of(bounced)
    packed = unpack(checkpoint_bytes(training), "here")
    earlier = pack({**packed.arrays, "order": np.arange(len(bounced.dt))}, packed.documents)
    resumed = training_of_bytes(earlier, "here", bounced, None, CONTACTNETS_CUBE)
    assert resumed.progress.reason == training.progress.reason
    assert restitution(resumed.trained()) == restitution(training.trained())
