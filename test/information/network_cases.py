"""Networks and their scores the long way, one transition after the other by automatic differentiation."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import torch

from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.models.end_to_end import EndToEndModel, ImpulseLoss
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.models.stream_network import StreamNetwork
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.forward_pass import forward_pass, frozen_copy
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from test.contact.cases import CUBE
from test.simulated import RIG_NOISE, simulated_tosses

NETWORKS = ("deep", "deepvertex", "end_to_end")


@cache
def tosses(count: int = 6) -> tuple[Toss, ...]:
    return simulated_tosses(count, seed=31, noise=RIG_NOISE)


def rows_of(given: Sequence[Toss]) -> Rows:
    found = transitions_of(given, CUBE.length_scale)
    return Rows(found.before, found.after, found.dt)


@cache
def network(kind: str, form: Form = Form.PHYSICAL) -> Model:
    """A model at random; end to end it has the loss whose information is taken."""
    model = model_class(kind).initial(CUBE, form, rows_of(tosses()), np.random.default_rng(7))
    if isinstance(model, EndToEndModel):
        model.loss = ImpulseLoss.SQUARED
    return model


def weights_of(model: Model) -> dict[str, list[torch.Tensor]]:
    """The parameters of each network, layer by layer."""
    children = {name: child for name, child in model.named_children() if isinstance(child, StreamNetwork)}
    return {name: [value for layer in child.linear for value in (layer.weight, layer.bias)] for name, child in children.items()}


def long_scores(model: Model, rows: Rows, config: LossConfig = DEFAULT_LOSS) -> dict[str, Array]:
    """Scores (B, P) by each network's weights; zero where nothing is solved."""
    weights = weights_of(model)
    found: dict[str, list[Array]] = {name: [] for name in weights}
    for t in range(len(rows.dt)):
        batch = model.batch_loss(rows.take([t]), config)
        model.zero_grad()
        torch.where(batch.solved, batch.losses, 0.0).sum().backward()  # type: ignore[no-untyped-call]
        for name, values in weights.items():
            slopes = [torch.zeros_like(value) if value.grad is None else value.grad for value in values]
            found[name].append(-0.5 * torch.cat([slope.flatten() for slope in slopes]).numpy())
    return {name: np.stack(scores) for name, scores in found.items()}


def some_not_solved(model: Model, rows: Rows) -> LossConfig:
    """As many iterations as just leave transitions unsolved, but not all."""
    for iterations in range(DEFAULT_LOSS.max_iterations, 0, -1):
        config = replace(DEFAULT_LOSS, max_iterations=iterations)
        solved = forward_pass(frozen_copy(model), rows, config).solved
        if not solved.all():
            assert solved.any()
            return config
    raise AssertionError("all are solved at once")
