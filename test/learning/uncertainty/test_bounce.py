"""A word where tosses bounce and the model does not, and none where they do not."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.fits.exact_fit import optimum, theta_0
from contact_curation.learning.uncertainty.bounce import Bounce, bounce_of
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.storage.datasets.contactnets import read_contactnets_toss
from test.simulated import RIG_NOISE, TrackerNoise, simulated_tosses

LOSS = LossConfig(threads=1)
DESCRIBED = ContactGeometry.of_body(CUBE).rigid()


def found(tosses: tuple[Toss, ...], restitution: bool = False) -> Bounce | None:
    """Of an exact fit, from a shape near the described one."""
    data = transitions_of(tosses, CUBE.length_scale)
    pivot = np.array([*data.before[:, :2].mean(axis=0), 0.0])
    start = PolytopeModel(initial_geometry(CUBE, Form.RIGID, pivot, np.random.default_rng(5), noise=0.02), CUBE, Form.RIGID)
    start = theta_0(start.bouncing() if restitution else start)
    return bounce_of(optimum(start, data, LOSS, 0.0).model, data, LOSS)


@cache
def thrown(restitution: float, count: int, seed: int, noise: TrackerNoise | None = None) -> tuple[Toss, ...]:
    return simulated_tosses(count, seed, noise, geometry=replace(DESCRIBED, restitution=restitution))


@pytest.mark.slow
def test_tosses_that_bounce_give_the_word_and_what_to_do() -> None:
    bounce = found(thrown(0.3, 16, 1))
    assert bounce is not None
    assert bounce.restitution == pytest.approx(0.3, abs=0.1)
    assert bounce.shown
    assert bounce.missing
    assert bounce.in_words().endswith("from 16 of them); learn it, too: train --set training.restitution=true")


@pytest.mark.slow
def test_tosses_that_do_not_bounce_give_none() -> None:
    bounce = found(thrown(0.0, 4, 1))
    assert bounce is not None
    assert bounce.restitution < bounce.interval
    assert not bounce.shown
    assert not bounce.missing
    assert not bounce.in_words()


def test_a_word_needs_a_restitution_above_its_interval_that_matters() -> None:
    assert Bounce(0.06, 0.05, 8).missing
    assert not Bounce(0.06, 0.07, 8).missing
    assert not Bounce(0.04, 0.01, 8).missing
    assert not Bounce(0.06, 0.05, 8, shown=False).missing


def test_it_is_not_asked_of_few_tosses_of_another_form_or_of_a_model_that_bounces() -> None:
    tosses = thrown(0.3, 4, 1)
    data = transitions_of(tosses, CUBE.length_scale)
    assert bounce_of(PolytopeModel(DESCRIBED, CUBE, Form.RIGID), transitions_of(tosses[:3], CUBE.length_scale), LOSS) is None
    assert bounce_of(PolytopeModel(ContactGeometry.of_body(CUBE), CUBE, Form.PHYSICAL), data, LOSS) is None
    assert bounce_of(PolytopeModel(replace(DESCRIBED, restitution=0.2), CUBE, Form.RIGID), data, LOSS) is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_a_tracker_sees_no_bounce_where_there_is_none_and_a_bounce_where_there_is_one(seed: int) -> None:
    still, bouncing = (found(thrown(restitution, 12, seed, RIG_NOISE)) for restitution in (0.0, 0.3))
    assert still is not None
    assert bouncing is not None
    assert not still.missing
    assert bouncing.missing
    assert bouncing.restitution == pytest.approx(0.3, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_the_real_cube_bounces(contactnets_folder: Path, seed: int) -> None:
    numbers = sorted(np.random.default_rng(seed).choice(400, 32, replace=False).tolist())
    tosses = tuple(read_contactnets_toss(contactnets_folder / f"{number}.pt", CUBE) for number in numbers)
    bounce = found(tosses)
    assert bounce is not None
    assert bounce.missing
    assert 0.08 < bounce.restitution < 0.4


@pytest.mark.slow
def test_nothing_is_said_of_the_golden_bag_which_does_not_bounce(golden_bag: Path) -> None:
    """By the fit alone its restitution is 0.06 +- 0.04."""
    tosses = tuple(cc.read(golden_bag, body=CUBE))
    bounce = found(tosses)
    assert bounce is not None
    assert bounce.restitution > bounce.interval
    assert not bounce.missing
