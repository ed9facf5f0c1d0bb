"""The optimizer is torch's AdamW with a pace for each kind of parameter, and goes on from its moments."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.training.optimizer import Optimizer
from contact_curation.learning.training.protocols import AdamWConfig, Schedule
from test.contact.model_cases import model_of
from test.learning.toy import Toy, toy_config


def descend(optimizer: Optimizer, toy: Toy, steps: int, first: int = 0) -> None:
    for step in range(first, first + steps):
        assert optimizer.minimize((toy.theta - 3.0).square(), step)


def test_its_steps_are_adamws_at_the_rate_of_the_schedule() -> None:
    config = replace(toy_config(steps=6), schedule=Schedule.COSINE, polytope=AdamWConfig(0.1, 0.5))
    toy, duplicate = Toy(1.0), Toy(1.0)
    descend(Optimizer(toy, config), toy, 6)
    adam = torch.optim.AdamW(duplicate.parameters(), lr=0.1, weight_decay=0.5)
    cosine = torch.optim.lr_scheduler.CosineAnnealingLR(adam, 6)
    for _ in range(6):
        adam.zero_grad()
        (duplicate.theta - 3.0).square().backward()  # type: ignore[no-untyped-call]
        adam.step()
        cosine.step()
    assert float(toy.theta.detach()) == pytest.approx(float(duplicate.theta.detach()), rel=1e-12)


def test_networks_have_a_pace_of_their_own() -> None:
    model = model_of("deep", Form.PHYSICAL)
    assert isinstance(model, DeepModel)
    before = {name: value.detach().clone() for name, value in model.named_parameters()}
    optimizer = Optimizer(model, replace(toy_config(), polytope=AdamWConfig(1e-2), network=AdamWConfig(1e-4)))
    total = torch.stack([value.sum() for value in model.parameters()]).sum()
    assert optimizer.minimize(total, 0)
    for name, value in model.named_parameters():  # the first step of Adam is the rate, whatever the gradient's size
        moved = float((before[name] - value.detach()).abs().max())
        assert moved == pytest.approx(1e-2 if name.startswith("polytope.") else 1e-4, rel=1e-4), name


def test_it_goes_on_from_its_moments() -> None:
    one, other = Toy(), Toy()
    first, second = Optimizer(one, toy_config()), Optimizer(other, toy_config())
    descend(first, one, 3)
    with torch.no_grad():
        other.theta.copy_(one.theta)
    second.restore(first.moments())
    descend(first, one, 3, first=3)
    descend(second, other, 3, first=3)
    assert torch.equal(one.theta, other.theta)


def test_its_moments_are_copies() -> None:
    toy = Toy()
    optimizer = Optimizer(toy, toy_config())
    descend(optimizer, toy, 1)
    kept = optimizer.moments()
    was = {name: value.clone() for name, value in kept.items()}
    descend(optimizer, toy, 1, first=1)
    assert kept == was


def test_a_gradient_that_is_not_finite_changes_nothing() -> None:
    toy = Toy(2.0)
    assert not Optimizer(toy, toy_config()).minimize(toy.theta * np.inf, 0)
    assert float(toy.theta.detach()) == 2.0


@pytest.mark.parametrize(
    "moments",
    [
        {"theta/step": torch.tensor(1.0)},
        {"eta/step": torch.tensor(1.0)},
        {"theta/step": torch.tensor(1.0), "theta/exp_avg": torch.zeros(2), "theta/exp_avg_sq": torch.zeros(2)},
        {name: torch.tensor(torch.nan) for name in ("theta/step", "theta/exp_avg", "theta/exp_avg_sq")},
    ],
)
def test_moments_that_do_not_fit_are_refused(moments: dict[str, torch.Tensor]) -> None:
    with pytest.raises(InvalidValueError, match="optimizer"):
        Optimizer(Toy(), toy_config()).restore(moments)


def test_moments_after_different_numbers_of_steps_are_refused() -> None:
    model = model_of("deep", Form.PHYSICAL)
    optimizer = Optimizer(model, toy_config())
    assert optimizer.minimize(torch.stack([value.sum() for value in model.parameters()]).sum(), 0)
    moments = optimizer.moments()
    moments["polytope.tilt/step"] = torch.tensor(5.0)
    with pytest.raises(InvalidValueError, match="after as many steps"):
        optimizer.restore(moments)
