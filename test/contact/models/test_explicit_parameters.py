"""Scores by named parameters are slopes by the outputs times the outputs' derivatives."""

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.models.explicit_parameters import ModuleParameters
from contact_curation.contact.models.rows import Rows
from contact_curation.contact.parameter_form import Block
from contact_curation.contact.torch_contacts import Frames
from test.contact.cases import CUBE, DT, rows_of_kind


class Scaled(torch.nn.Module):
    """Outputs that are products of two parameters with the heights of the states, and one that depends on none."""

    def __init__(self) -> None:
        super().__init__()
        self.gain = torch.nn.Parameter(torch.tensor([2.0, 3.0], dtype=torch.float64))
        self.offset = torch.nn.Parameter(torch.tensor(5.0, dtype=torch.float64))
        self.unused = torch.nn.Parameter(torch.ones(3, dtype=torch.float64))

    def forward(self, rows: Rows) -> tuple[Tensor, ...]:
        heights = torch.as_tensor(rows.before[:, 2])
        pair = heights[:, None] * self.gain * self.offset
        return pair, heights[:, None], (heights * self.offset**2)[:, None, None]


def test_scores_are_slopes_times_derivatives_for_each_transition_by_itself() -> None:
    found = rows_of_kind("impact")
    rows = Rows(found.before, found.after, np.full(len(found), DT))
    frames = Frames.of(CUBE, rows.before, rows.after, rows.dt)
    parameters = ModuleParameters(Scaled(), ("gain", "offset", "unused"))
    assert parameters.blocks == (Block("gain", 2), Block("offset", 1), Block("unused", 3))
    assert parameters.size == 6
    rng = np.random.default_rng(0)
    slopes = [rng.standard_normal((2, len(found), *shape)) for shape in ((2,), (1,), (1, 1))]
    scores = parameters.scores(rows, frames, tuple(torch.as_tensor(slope) for slope in slopes))
    height = rows.before[:, 2]
    expected = np.zeros((2, len(found), 6))
    expected[..., :2] = slopes[0] * height[:, None] * 5.0
    expected[..., 2] = height * (slopes[0] @ [2.0, 3.0] + slopes[2][..., 0, 0] * 10.0)
    np.testing.assert_allclose(scores, expected, rtol=1e-12)
