"""Sketched gradients: the same every time, with nearly the inner products of the gradients themselves."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
import torch
from scipy.stats import spearmanr

from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.network.config import NetworkConfig, SketchConfig, network_config_for
from contact_curation.information.network.forward_pass import forward_pass, frozen_copy
from contact_curation.information.network.sketch import network_sketch, reference_rows
from test.contact.cases import CUBE
from test.information.network_cases import network, rows_of, tosses

EVERY = 5
"""Of the transitions."""


class Scores(NamedTuple):
    """Scores of some transitions by the networks' weights (B, P) and in a sketch (B, C)."""

    exact: Array
    sketched: Array


@cache
def scores(kind: str, config: SketchConfig) -> Scores:
    model = frozen_copy(network(kind))
    found = forward_pass(model, rows_of(tosses()).take(slice(0, None, EVERY)), DEFAULT_LOSS)
    (slopes,) = zip(*found.score_slopes(found.solved.astype(float)), strict=True)
    deltas = found.deltas(slopes)
    exact = []
    for trace, by_outputs in zip(found.tape, deltas, strict=True):
        exact.append((by_outputs.mT @ trace.inputs.detach()).flatten(1))
        exact.append(by_outputs[:, : trace.primal].sum(dim=1))
    return Scores(torch.cat(exact, dim=1).numpy(), network_sketch(model, config).rows(found.tape, deltas).numpy())


def leverages(gram: Array) -> Array:
    """Of each transition in the pool's 16 leading directions; there are too few transitions for more."""
    _, vectors = np.linalg.eigh(gram)
    return np.asarray(np.square(vectors[:, -16:]).sum(axis=1))


@pytest.mark.parametrize("kind", ["deep", "deepvertex", "end_to_end"])
def test_inner_products_are_right_to_a_few_percent_and_leverages_keep_their_order(kind: str) -> None:
    """method.md 6, check 15, for single transitions, which is harder than for tosses."""
    found = scores(kind, network_config_for(kind).sketch)
    exact, sketched = found.exact @ found.exact.T, found.sketched @ found.sketched.T
    heard = np.flatnonzero(np.diag(exact) > 1e-9 * np.diag(exact).max())
    exact, sketched = exact[np.ix_(heard, heard)], sketched[np.ix_(heard, heard)]
    lengths = np.sqrt(np.diag(exact))
    errors = (sketched - exact) / np.outer(lengths, lengths)
    assert np.sqrt(np.square(errors[~np.eye(len(errors), dtype=bool)]).mean()) < 0.05
    assert spearmanr(leverages(exact), leverages(sketched)).statistic > 0.95


def test_leading_directions_are_worth_more_than_random_ones() -> None:
    """Of the same size, the purely random sketch of method.md 2.7 is many times as rough."""

    def roughness(config: SketchConfig) -> float:
        found = scores("deep", config)
        exact, sketched = np.square(found.exact).sum(axis=1), np.square(found.sketched).sum(axis=1)
        heard = exact > 1e-9 * exact.max()
        return float(np.abs(sketched[heard] / exact[heard] - 1.0).mean())

    plain = SketchConfig(leading=0, random=24)
    assert roughness(SketchConfig()) < 0.3 * roughness(plain)
    assert scores("deep", plain).sketched.shape == scores("deep", SketchConfig()).sketched.shape


@pytest.mark.slow
def test_random_rows_keep_lengths_right_on_average() -> None:
    lengths = [np.square(scores("deepvertex", SketchConfig(2, 4, seed)).sketched).sum() for seed in range(12)]
    error = float(np.std(lengths)) / np.sqrt(len(lengths))
    exact = np.square(scores("deepvertex", SketchConfig(2, 4, 0)).exact).sum()
    assert abs(np.mean(lengths) - exact) < 3.0 * error < 0.5 * exact


def test_a_sketch_wider_than_the_layers_loses_nothing() -> None:
    found = scores("deepvertex", SketchConfig(leading=300, random=0))
    np.testing.assert_allclose(np.square(found.sketched).sum(axis=1), np.square(found.exact).sum(axis=1), rtol=1e-9)


def test_the_same_theta_has_the_same_sketch_and_another_seed_another() -> None:
    model = frozen_copy(network("deep"))
    one, again, other = (network_sketch(model, SketchConfig(seed=seed)) for seed in (0, 0, 1))
    for first, second in zip(one.layers, again.layers, strict=True):
        assert torch.equal(first.inputs, second.inputs)
        assert torch.equal(first.outputs, second.outputs)
    assert not torch.equal(one.layers[1].outputs, other.layers[1].outputs)
    assert one.columns == 13 * 24 + 24 * 24 + 24 * 8 + 13 * 24 + 24 * 24 + 24 * 16


def test_the_reference_is_about_the_body_near_the_board() -> None:
    rows = reference_rows(CUBE, np.array([5.0, 1.0, 0.0]), np.random.default_rng(0))
    np.testing.assert_allclose(rows.before[:, :2].mean(axis=0), [5.0, 1.0], atol=1.0)
    np.testing.assert_allclose(np.linalg.norm(rows.after[:, 3:7], axis=1), 1.0, atol=1e-12)
    assert (rows.before[:, 2] > 0.0).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SketchConfig(leading=-1), "sketch.leading: found -1, expected a whole number of at least 0"),
        (lambda: SketchConfig(random=-1), "sketch.random: found -1, expected a whole number of at least 0"),
        (lambda: SketchConfig(seed=-1), "sketch.seed: found -1, expected a whole number of at least 0"),
        (lambda: SketchConfig(leading=0, random=0), "sketch: found no rows, expected at least 1 row, leading or random"),
        (lambda: NetworkConfig(draws=0), "network.draws: found 0, expected a whole number of at least 1"),
        (lambda: NetworkConfig(seed=-1), "network.seed: found -1, expected a whole number of at least 0"),
    ],
)
def test_sizes_that_make_no_sense_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InvalidValueError) as refused:
        make()
    assert str(refused.value) == message
    assert SketchConfig(leading=1, random=0, seed=0).size == 1
