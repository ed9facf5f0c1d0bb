"""The protocols are the published ones and ours, refuse what makes no sense, and survive JSON."""

import json
from dataclasses import replace

import pytest

from contact_curation.contact.models.registry import MODELS
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.checkpoints.checkpoint import config_of, document_of
from contact_curation.learning.training.objective import InfluenceBound
from contact_curation.learning.training.protocols import AdamWConfig, Patience, Schedule, budgeted, published


@pytest.mark.parametrize("kind", ["polytope", "deep", "deepvertex"])
def test_the_published_protocol_of_contact_models_has_the_published_numbers(kind: str) -> None:
    config = published(kind)
    assert (config.batch, config.polytope, config.network) == (1, AdamWConfig(1e-4, 1e-2), AdamWConfig(1e-4, 1e-2))
    assert (config.form, config.schedule, config.regularizer) == (Form.CONTACTNETS, Schedule.CONSTANT, 0.3)
    assert (config.steps, config.epochs, config.evaluation_steps) == (None, 500, None)
    assert not config.influence.bounds


def test_the_published_protocol_of_end_to_end_is_slower_and_decays_less() -> None:
    config = published("end_to_end")
    assert (config.polytope, config.network) == (AdamWConfig(3e-5, 1e-3), AdamWConfig(3e-5, 1e-3))


@pytest.mark.parametrize(("tosses", "epochs"), [(1, 262), (8, 43), (250, 13), (251, 12), (1000, 12)])
def test_published_patience_is_500_over_twice_the_tosses_and_12(tosses: int, epochs: int) -> None:
    patience = published("polytope").patience
    assert patience is not None
    assert patience.evaluations(tosses) == epochs


@pytest.mark.parametrize("kind", list(MODELS))
def test_our_protocol_has_a_budget_of_gradient_steps_and_bounds_influence(kind: str) -> None:
    config = budgeted(kind)
    assert config.steps is not None
    assert (config.epochs, config.patience, config.form) == (None, None, Form.PHYSICAL)
    assert config.influence.bounds == (kind != "end_to_end")  # whose loss is a norm


def test_the_cosine_falls_from_one_by_half_a_wave_to_zero() -> None:
    config = replace(budgeted("polytope"), steps=100)
    assert config.rate(0) == 1.0
    assert config.rate(50) == pytest.approx(0.5)
    assert config.rate(100) == pytest.approx(0.0)
    assert config.rate(25) == pytest.approx((1 + 2**-0.5) / 2)
    assert config.rate(130) == pytest.approx(0.0)


@pytest.mark.parametrize("config", [published("deep"), budgeted("end_to_end")])
def test_a_protocol_survives_json(config: object) -> None:
    assert config_of(json.loads(json.dumps(document_of(config)))) == config  # type: ignore[arg-type]


def test_a_protocol_from_json_is_checked() -> None:
    document = document_of(published("polytope"))
    with pytest.raises(InvalidValueError, match="learning_rate"):
        config_of({**document, "polytope": {"learning_rate": -1.0, "weight_decay": 0.0}})
    with pytest.raises(KeyError):
        config_of({key: value for key, value in document.items() if key != "loss"})


@pytest.mark.parametrize(
    "change",
    [
        {"batch": 0},
        {"steps": 0},
        {"steps": None, "epochs": None},
        {"steps": None, "epochs": 3},
        {"evaluation_steps": 0},
        {"regularizer": -0.1},
        {"ground": -1.0},
        {"regularizer": float("nan")},
    ],
)
def test_a_protocol_refuses_what_makes_no_sense(change: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError):
        replace(budgeted("polytope"), **change)  # type: ignore[arg-type]


def test_pace_patience_and_bound_refuse_what_makes_no_sense() -> None:
    for rate, decay in ((0.0, 0.0), (float("inf"), 0.0), (1.0, -1.0)):
        with pytest.raises(InvalidValueError):
            AdamWConfig(rate, decay)
    for least, tosses in ((0, 500), (12, -1)):
        with pytest.raises(InvalidValueError):
            Patience(least, tosses)
    for quantile in (0.0, 1.01, float("nan")):
        with pytest.raises(InvalidValueError):
            InfluenceBound(quantile)
    with pytest.raises(InvalidValueError, match="multiple"):
        InfluenceBound(multiple=0.0)
