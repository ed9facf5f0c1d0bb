"""A friction that tosses hardly use up, or not alike: said wherever a model is learned from them, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

import contact_curation as cc
from contact_curation.cli.train.report import TrainReport
from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.learning.uncertainty.bounce import Bounce
from contact_curation.learning.uncertainty.parameters import Known, KnownParameter
from test.simulated import RIG_NOISE, simulated_tosses

SAID = "friction hardly used up"


def thrown(friction: float) -> cc.Tosses:
    geometry = replace(ContactGeometry.of_body(CUBE).rigid(), tangents=friction * np.eye(2, 3))
    return cc.Tosses.of(simulated_tosses(8, 5, geometry=geometry), CUBE)


@pytest.mark.parametrize(("friction", "said"), [(1.2, True), (0.18, False)])
@pytest.mark.slow
def test_train_and_evaluate_say_it(friction: float, said: bool) -> None:
    tosses = thrown(friction)
    model = cc.train(tosses)
    assert any(line.startswith(SAID) for line in model.warnings) is said
    report = cc.evaluate(model, tosses)
    assert report.document()["friction_hardly_used_up"].startswith(SAID) is said
    for share, heard in ((0.9, said), (1.1, False)):
        found = KnownParameter("friction", "", 0.5, 0.0, 0.0, 0.0, 0.0, interval=0.5 * share)
        known = Known((found,), (), 1.0, 28, 0.0, len(tosses), 0)
        assert replace(report, known=known).sticking_misfit.startswith(SAID) is heard


def test_train_and_evaluate_name_tosses_that_slide_otherwise() -> None:
    rough = replace(ContactGeometry.of_body(CUBE).rigid(), tangents=2.0 * CUBE.friction * np.eye(2, 3))
    held = tuple(replace(simulated_tosses(1, seed, geometry=rough)[0], toss_id=f"held-{seed}") for seed in range(3))
    for more, said in ((held, True), ((), False)):
        tosses = cc.Tosses.of((*simulated_tosses(16, 1, RIG_NOISE), *more), CUBE)
        model = cc.train(tosses, steps=1)
        assert any(line.startswith("some tosses slide otherwise") for line in model.warnings) is said
        evaluated = cc.evaluate(model, tosses)
        assert ("careful: some tosses slide otherwise" in str(evaluated)) is said
        assert any(line.startswith("some tosses slide otherwise") for line in evaluated.document()["warnings"]) is said


def test_a_model_that_is_no_optimum_is_not_blamed_for_its_friction() -> None:
    tosses = thrown(1.2)
    model = cc.train(tosses, steps=1)
    assert not any(line.startswith(SAID) for line in model.warnings)
    assert cc.evaluate(model, tosses).document()["friction_hardly_used_up"] == ""


def test_where_a_bounce_is_missing_it_is_that_which_is_said() -> None:
    report = TrainReport.__new__(TrainReport)
    for bounce, begins in ((Bounce(0.3, 0.1, 8), "the tosses bounce"), (Bounce(0.0, 0.1, 8), SAID), (None, SAID)):
        report.__dict__.update(bounce=bounce, sticking=SAID)
        assert report.misfit.startswith(begins)
