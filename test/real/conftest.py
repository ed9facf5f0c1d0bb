"""ContactNets' tosses as the tests of method.md 6 take them, read once."""

from pathlib import Path

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.torch_contacts import Theta
from contact_curation.contact.torch_loss import polytope_losses
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of
from test.contact.cases import noisy_geometry
from test.simulated import FRAME_PERIOD, PAUSE_NS, length_scales, stamps_ns


@pytest.fixture(scope="package")
def real_tosses(contactnets_folder: Path) -> tuple[Toss, ...]:
    """All 570, in SI units, in the order of their numbers, which are their ids."""
    scales = length_scales(CONTACTNETS_CUBE)
    numbers = sorted(int(path.stem) for path in contactnets_folder.glob("*.pt"))
    assert numbers == list(range(570))
    return tuple(real_toss(contactnets_folder / f"{n}.pt", n, scales) for n in numbers)


def real_toss(path: Path, number: int, scales: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Toss:
    states = torch.load(path, weights_only=True)[0, :, :13].numpy() * scales
    return Toss(
        toss_id=f"{number:03d}", body="cube", source="contactnets", frame_period=FRAME_PERIOD,
        stamps_ns=stamps_ns(len(states), number * PAUSE_NS), positions=states[:, :3], orientations_wxyz=states[:, 3:7],
        linear_velocities=states[:, 7:10], angular_velocities=states[:, 10:],
    )  # fmt: skip


@pytest.fixture(scope="package")
def real_transitions(real_tosses: tuple[Toss, ...]) -> Transitions:
    """All 59,383."""
    rows = transitions_of(real_tosses, CONTACTNETS_CUBE.length_scale)
    assert len(rows.before) == 59_383
    return rows


@pytest.fixture(scope="package")
def fitted(real_transitions: Transitions) -> ContactGeometry:
    """A trained theta: 400 steps of Adam on tosses 0 to 399, regularised as ContactNets' code does.

    See method.md 1.2, appendix A.
    """
    rows, steps, batch = real_transitions, 400, 128
    theta, rng = Theta.of(noisy_geometry(0)), np.random.default_rng(100)
    vector = theta.vector().requires_grad_()
    optimiser = torch.optim.Adam([vector], lr=3e-2)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    for _ in range(steps):
        chosen = rng.choice(rows.starts[400], batch, replace=False)
        now = theta.with_vector(vector)
        losses, solved = polytope_losses(now, CONTACTNETS_CUBE, rows.before[chosen], rows.after[chosen], rows.dt[chosen])
        slopes = 8.0 * (now.normal.norm() - 1.0).square() + (now.tangents @ now.normal).square().sum()
        optimiser.zero_grad()
        (losses[solved].mean() + 0.3 * slopes).backward()
        optimiser.step()
        schedule.step()
    return theta.with_vector(vector.detach()).geometry()
