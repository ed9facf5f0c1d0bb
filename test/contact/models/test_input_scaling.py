"""Inputs of networks are normalised by their data; what never varies is fed as zero."""

import numpy as np
import pytest
import torch

from contact_curation.contact.models.stream_network import InputScaling
from contact_curation.errors import InvalidValueError


def test_inputs_come_out_with_mean_zero_and_unbiased_deviation_one() -> None:
    data = np.random.default_rng(0).normal([1.0, -2.0], [3.0, 0.01], size=(5, 2))
    scaled = InputScaling(2).fit(data)(torch.as_tensor(data)).numpy()
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(scaled.std(axis=0, ddof=1), 1.0, rtol=1e-12)


def test_an_input_that_never_varied_is_zero_whatever_it_becomes() -> None:
    scaling = InputScaling(2).fit(np.array([[0.1, 1.0], [0.1, 2.0], [0.1, 4.0]]))
    assert scaling(torch.tensor([[7.0, 1.0]], dtype=torch.float64))[0, 0] == 0.0


def test_it_passes_inputs_as_they_are_until_it_is_fitted() -> None:
    values = torch.tensor([[1.5, -2.0]], dtype=torch.float64)
    assert torch.equal(InputScaling(2)(values), values)


def test_one_row_has_no_deviation() -> None:
    with pytest.raises(InvalidValueError, match="1 transitions, expected at least 2"):
        InputScaling(2).fit(np.ones((1, 2)))
