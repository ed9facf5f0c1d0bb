"""Spins of rigid bodies precess in the air, in time steps as in the loss; in ContactNets' models, or of a cube, they do not."""

from dataclasses import replace

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.evaluation import evaluate
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.rollout import rollout
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import box
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.world import free_motion
from test.contact.torch_evaluation import evaluate_in_torch

SLAB = Body("slab", box([0.06, 0.04, 0.025]).vertices, 0.37, np.diag([2.7e-4, 5.2e-4, 6.4e-4]), 0.2, 0.04)
TURNED = replace(SLAB, inertia=np.array([[3.0e-4, 5e-5, 0.0], [5e-5, 5.0e-4, -4e-5], [0.0, -4e-5, 6.0e-4]]))
PERIOD, FRAMES = 1.0 / 148.0, 30
UNITS = np.array([SLAB.length_scale] * 3 + [1.0] * 4 + [SLAB.length_scale] * 3 + [1.0] * 3)


def releases(count: int) -> Array:
    """(K, 13) high over the board, with spins of 8 rad/s [SI]."""
    rng = np.random.default_rng(0)
    states = np.zeros((count, 13))
    states[:, 2] = 3.0
    states[:, 3:7] = quaternions.normalized(rng.standard_normal((count, 4)))
    spins = rng.standard_normal((count, 3))
    states[:, 10:] = 8.0 * spins / np.linalg.norm(spins, axis=1, keepdims=True)
    return states


@pytest.mark.parametrize("body", [SLAB, TURNED], ids=["principal axes", "turned"])
def test_bodies_fly_as_mujoco_s_do(body: Body) -> None:
    rigid = ContactGeometry.of_body(body).rigid()
    off = {True: [], False: []}  # type: dict[bool, list[float]]
    for state in releases(8):
        theirs = free_motion(body, state, FRAMES, PERIOD)
        for precesses, geometry in ((True, rigid), (False, ContactGeometry.of_body(body))):
            ours = rollout(geometry, body, state[None] / UNITS, FRAMES, PERIOD).states
            off[precesses].append(float(np.degrees(quaternions.angle_between(ours[-1, 3:7], theirs[-1, 3:7]))))
    assert max(off[True]) < 2.0
    assert np.mean(off[False]) > 5.0


def test_in_the_air_nothing_of_the_loss_is_left_but_without_the_term() -> None:
    rigid = ContactGeometry.of_body(TURNED).rigid()
    states = rollout(rigid, TURNED, releases(1) / UNITS, FRAMES, PERIOD).states
    rows = states[:-1], states[1:], np.full(FRAMES - 1, PERIOD)
    assert evaluate(rigid, TURNED, *rows).losses.max() < 1e-12
    assert evaluate(replace(rigid, noise=None), TURNED, *rows).losses.max() > 1e-6


def test_kernel_and_torch_agree_on_it() -> None:
    rigid = ContactGeometry.of_body(TURNED).rigid()
    landing = releases(3)
    landing[:, 2] = 0.12
    rolled = rollout(rigid, TURNED, landing / UNITS, 60, PERIOD)
    states = rolled.states.reshape(3, 60, 13)
    rows = states[:, :-1].reshape(-1, 13), states[:, 1:].reshape(-1, 13), np.full(3 * 59, PERIOD)
    compiled, in_torch = evaluate(rigid, TURNED, *rows), evaluate_in_torch(rigid, TURNED, *rows)
    np.testing.assert_allclose(compiled.losses, in_torch.losses, rtol=1e-6, atol=1e-9)


def test_a_cube_s_spin_stays_as_it_is_bit_for_bit() -> None:
    cube = ContactGeometry.of_body(CONTACTNETS_CUBE)
    state = releases(1) / np.array([0.0524] * 3 + [1.0] * 4 + [0.0524] * 3 + [1.0] * 3)
    ours, theirs = (rollout(one, CONTACTNETS_CUBE, state, FRAMES, PERIOD).states for one in (cube.rigid(), cube))
    assert ours.tobytes() == theirs.tobytes()
    np.testing.assert_array_equal(ours[:, 10:], np.tile(state[:, 10:], (FRAMES, 1)))
