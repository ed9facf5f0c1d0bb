"""ContactNets' own code and ours give the same losses and gradients on five of its tosses (method.md 1.2)."""

from pathlib import Path

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import LOSS_TERMS, Cone, evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig

THEIR_TERMS = ("match", "comp_n", "comp_t", "cone", "pen_slack")
THEIR_PARAMETERS = ("vertices_normal", "zvec", "vertices_tangent", "xyvecs")
ALMOST_NONE = 1e-10
"""They have no regularisation of impulses."""


@pytest.mark.parametrize("toss", [0, 17, 101, 250, 400])
def test_losses_terms_and_gradients_are_those_of_contactnets(contactnets_folder: Path, toss: int) -> None:
    path = contactnets_folder.parent / "reference_seed0.npz"
    if not path.exists():
        pytest.skip(f"{path.name} is not beside the tosses")
    theirs = np.load(path)
    own, normal, tangent, axes = (theirs[f"param/{name}"] for name in THEIR_PARAMETERS)
    rows = torch.load(contactnets_folder / f"{toss}.pt", weights_only=True)[0].numpy()
    config = LossConfig(cone=Cone.POLYHEDRAL, regularization=ALMOST_NONE)
    geometry = ContactGeometry(own, normal[0], tangent, axes)
    found = evaluate(geometry, CONTACTNETS_CUBE, rows[:-1, :13], rows[1:, :13], 1.0 / 148.0, config)
    assert found.solved.all()

    def their(what: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        return np.concatenate([theirs[f"toss{toss}/{what}/{name}"].reshape(len(rows) - 1, -1) for name in THEIR_PARAMETERS], 1)

    gradients = their("gold/grad") - their("reg/grad")  # of the loss without the regulariser of training
    losses = theirs[f"toss{toss}/gold/loss/surr_qp"]
    assert np.abs(found.losses / losses - 1.0).max() < 1e-8
    for k, name in enumerate(THEIR_TERMS):
        difference = np.abs(found.terms[:, k] - theirs[f"toss{toss}/gold/loss/surr_qp_{name}"])
        assert difference.max() < 1e-8, LOSS_TERMS[k]
    assert np.abs(-2.0 * found.scores[:, :-1] - gradients).max() < 1e-8 * np.abs(gradients).max()
