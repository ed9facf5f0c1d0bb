"""Models, data and reference derivatives that the tests of the models share."""

import functools

import numpy as np
import torch
from torch import Tensor

from contact_curation.contact.models.model import ContactModel, Model, Rows
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from test.contact.cases import CUBE, DT, rows_of_kind, tracked_transitions

VARIANTS = [
    ("polytope", Form.CONTACTNETS),
    ("polytope", Form.PHYSICAL),
    ("polytope", Form.RIGID),
    ("deep", Form.CONTACTNETS),
    ("deep", Form.PHYSICAL),
    ("deepvertex", Form.PHYSICAL),
    ("end_to_end", Form.PHYSICAL),
]
"""Each model, in each form that makes a difference to it."""

WITH_CONTACTS = VARIANTS[:-1]


@functools.cache
def tossed_rows() -> Rows:
    """All transitions of simulated tosses."""
    given = tracked_transitions()
    return Rows(given.before, given.after, given.dt)


def rows_of(kind: str, count: int) -> Rows:
    """Some transitions of one kind."""
    chosen = rows_of_kind(kind, count)
    return Rows(chosen.before, chosen.after, np.full(count, DT))


def model_of(kind: str, form: Form, seed: int = 0) -> Model:
    return model_class(kind).initial(CUBE, form, tossed_rows(), np.random.default_rng(seed))


def contact_model(kind: str, form: Form, seed: int = 0) -> ContactModel:
    model = model_of(kind, form, seed)
    assert isinstance(model, ContactModel)
    return model


def bytes_of(model: Model) -> bytes:
    return b"".join(value.numpy().tobytes() for value in model.state_dict().values())


def rotation_of(wxyz: Tensor) -> Tensor:
    """R(q) (3, 3) as a differentiable function of q (4,)."""
    w, x, y, z = wxyz
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return torch.stack([torch.stack(row) for row in rows])


def spun(rotation: Tensor, spin: Tensor) -> Tensor:
    """R exp(hat spin) (3, 3)."""
    zero = torch.zeros((), dtype=spin.dtype)
    x, y, z = spin
    hat = torch.stack([torch.stack([zero, -z, y]), torch.stack([z, zero, -x]), torch.stack([-y, x, zero])])
    turned: Tensor = rotation @ torch.linalg.matrix_exp(hat)
    return turned
