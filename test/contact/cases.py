"""Transitions and geometries that the tests of the loss share; lengths in half widths."""

import functools
from dataclasses import dataclass

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.transitions import Transitions, transitions_of
from test.simulated import RIG_NOISE, simulated_tosses

CUBE = CONTACTNETS_CUBE
TRUE = ContactGeometry.of_body(CUBE)
DT = 1.0 / 148.0
KINDS = ("airborne", "impact", "sliding", "sticking", "resting")


@dataclass(frozen=True, eq=False)
class Rows:
    """Some transitions: states (N, 13) before and after."""

    before: Array
    after: Array

    def __len__(self) -> int:
        return len(self.before)


def noisy_geometry(seed: int, share: float = 0.4, pivot: bool = False) -> ContactGeometry:
    """ContactNets' random initialisation: everything off by `share` (method.md 1.1)."""
    rng = np.random.default_rng(seed)
    corners = CUBE.scaled_vertices
    return ContactGeometry(
        vertices_normal=corners + share * rng.standard_normal(corners.shape),
        normal=np.array([0.0, 0.0, 1.0]) + share * rng.standard_normal(3),
        vertices_tangent=corners + share * rng.standard_normal(corners.shape),
        tangents=CUBE.friction * (np.eye(2, 3) + share * rng.standard_normal((2, 3))),
        pivot=rng.standard_normal(3) if pivot else np.zeros(3),
        height=0.1 * float(rng.standard_normal()) if pivot else 0.0,
    )


@functools.cache
def tracked_transitions() -> Transitions:
    """Of 12 simulated tosses as a tracker sees them."""
    return transitions_of(simulated_tosses(12, seed=11, noise=RIG_NOISE), CUBE.length_scale)


@functools.cache
def rows_of_kind(kind: str, count: int = 8) -> Rows:
    """Transitions of one kind, spread over the tosses."""
    rows = tracked_transitions()
    gaps = TRUE.gaps(rows.before).min(axis=1)
    speed = np.linalg.norm(rows.after[:, 7:], axis=1)
    slip = np.linalg.norm(rows.after[:, 7:9], axis=1)
    kick = rows.after[:, 9] - rows.before[:, 9] + CUBE.scaled_gravity * DT
    touching = gaps < 0.02
    chosen = {
        "airborne": gaps > 0.3,
        "impact": touching & (kick > 6.0),
        "sliding": touching & (kick < 3.0) & (slip > 3.0),
        "sticking": touching & (speed > 0.3) & (slip < 1.5) & (kick < 3.0),
        "resting": touching & (speed < 0.3),
    }[kind]
    found = np.flatnonzero(chosen)
    assert len(found) >= count, f"{len(found)} transitions are {kind}"
    picked = found[np.linspace(0, len(found) - 1, count).astype(int)]
    return Rows(rows.before[picked], rows.after[picked])


def profile_losses(geometry: ContactGeometry, rows: Rows, config: LossConfig = DEFAULT_LOSS) -> Array:
    """(N,) what the inner problem minimises, at its minimum: the loss and eps |l|^2."""
    found = evaluate(geometry, CUBE, rows.before, rows.after, DT, config)
    assert found.solved.all()
    return np.asarray(found.losses + config.regularization * np.square(found.impulses).sum(axis=(1, 2)))


def full_vector(geometry: ContactGeometry) -> Array:
    """(6V + 10,) theta in the order of the kernel's scores."""
    parts = (geometry.vertices_normal, geometry.normal, geometry.vertices_tangent, geometry.tangents)
    return np.concatenate([*(part.ravel() for part in parts), [geometry.height]])


def geometry_of(vector: Array, pivot: Array) -> ContactGeometry:
    """The inverse of `full_vector`."""
    own = (vector.size - 10) // 2
    pieces = np.split(vector, np.cumsum([own, 3, own, 6]))
    return ContactGeometry(
        pieces[0].reshape(-1, 3), pieces[1], pieces[2].reshape(-1, 3), pieces[3].reshape(2, 3), pivot, float(pieces[4][0])
    )
