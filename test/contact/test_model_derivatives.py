"""method.md 6, checks 1 and 3, for every model: scores against the re-solved loss, Jacobians against automatic
differentiation.
"""

import copy
from collections.abc import Callable

import numpy as np
import pytest
import torch
from torch import Tensor

from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.contact.models.end_to_end import ImpulseLoss
from contact_curation.contact.models.model import ContactModel, Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.models.stream_network import StreamNetwork
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.torch_contacts import Frames
from contact_curation.contact.torch_loss import solve_contacts
from test.contact.cases import CUBE
from test.contact.model_cases import VARIANTS, WITH_CONTACTS, contact_model, model_of, rotation_of, rows_of, spun
from test.contact.torch_evaluation import loss_terms

EXACT = LossConfig(threads=1)
DIRECTIONS = 20
IMPACTS = 20
STEP = 1e-5


def profile_loss(model: Model, rows: Rows) -> Tensor:
    """(B,) what the inner problem minimises, at its minimum: the loss and eps |l|^2; of end to end just the loss."""
    if not isinstance(model, ContactModel):
        return model.batch_loss(rows, EXACT).losses
    frames, config = Frames.of(CUBE, *rows), EXACT.for_theta(CUBE, rigid=model.precesses)
    contacts = model.contacts(frames)
    found = solve_contacts(contacts, frames, config)
    assert not found.status.any()
    impulses = torch.as_tensor(found.impulses)
    size: Tensor = impulses.square().sum(dim=(1, 2))
    return loss_terms(contacts, frames, impulses, config.weights).sum(dim=-1) + config.regularization * size


def moved(model: Model, direction: list[Tensor], step: float) -> Model:
    other = copy.deepcopy(model)
    with torch.no_grad():
        for value, along in zip(other.parameters(), direction, strict=True):
            value.add_(step * along)
    return other


def random_direction(model: Model, rng: np.random.Generator) -> list[Tensor]:
    """Of unit length, each array of parameters with an equal share, so that the polytope's few count."""
    parts = [rng.standard_normal(tuple(value.shape)) for value in model.parameters()]
    return [torch.as_tensor(part / np.linalg.norm(part) / len(parts) ** 0.5) for part in parts]


def scores(model: Model, rows: Rows) -> list[tuple[Tensor, ...]]:
    """Slopes of each transition's loss by the parameters."""
    batch, parameters = model.batch_loss(rows, EXACT), list(model.parameters())
    assert batch.solved.all()
    return [torch.autograd.grad(loss, parameters, retain_graph=True) for loss in batch.losses]


def largest_error_of_scores(model: Model, rows: Rows) -> float:
    """Over transitions and random directions, relative."""
    rng, found, errors = np.random.default_rng(21), scores(model, rows), []
    for _ in range(DIRECTIONS):
        along = random_direction(model, rng)
        expected = np.array([sum(float((part * side).sum()) for part, side in zip(score, along)) for score in found])
        with torch.no_grad():
            ahead, behind = (profile_loss(moved(model, along, side * STEP), rows).numpy() for side in (1.0, -1.0))
        errors.append(np.abs((ahead - behind) / (2.0 * STEP) - expected) / np.abs(expected))
    return float(np.max(errors))


@pytest.mark.parametrize(("kind", "form"), VARIANTS)
def test_scores_at_fixed_impulses_are_slopes_of_the_re_solved_loss(kind: str, form: Form) -> None:
    """method.md 6.1: each of 20 impacts, along 20 random directions."""
    assert largest_error_of_scores(model_of(kind, form, seed=20), rows_of("impact", IMPACTS)) < 1e-5


def test_so_are_those_of_the_squared_end_to_end_loss() -> None:
    tensors = model_of("end_to_end", Form.PHYSICAL, seed=20).tensors()
    model = model_class("end_to_end").of_tensors({"loss": ImpulseLoss.SQUARED.value}, tensors, CUBE)
    assert largest_error_of_scores(model, rows_of("impact", IMPACTS)) < 1e-5


def plain(network: StreamNetwork, inputs: Tensor) -> Tensor:
    """As torch writes it."""
    for depth, layer in enumerate(network.linear):
        inputs = layer(torch.tanh(inputs) if depth else inputs)
    return inputs


def places(model: ContactModel, rotation: Tensor, position: Tensor) -> Tensor:
    """(V, 3) gap and tangential places at a pose (3, 3) and (3,), by the equations of method.md 1.1, written again."""
    if isinstance(model, DeepvertexModel):
        scaling, known = model.scaling, model.get_buffer("vertices")
        shift = plain(model.network, (rotation.flatten() - scaling.mean) * scaling.scale).reshape(-1, 3)
        reach = (known + shift / 3.0) @ rotation.T + position
        return torch.stack([reach[:, 2], CUBE.friction * reach[:, 0], CUBE.friction * reach[:, 1]], dim=1)
    polytope = model.polytope if isinstance(model, DeepModel) else model
    assert isinstance(polytope, PolytopeModel)
    theta = polytope.theta()
    gap = (theta.vertices_normal @ rotation.T + position - theta.pivot) @ theta.normal - theta.height
    side = (theta.vertices_tangent @ rotation.T + position) @ theta.tangents.T
    found = torch.cat([gap[:, None], side], dim=1)
    if isinstance(model, DeepModel):
        inputs = torch.cat([position, rotation.flatten()])
        bends = [plain(network, inputs).reshape(len(gap), -1) for network in (model.normal_network, model.tangent_network)]
        found = found + 0.05 * torch.cat(bends, dim=1)
    return found


def jacobian(function: Callable[[Tensor], Tensor], at: Tensor) -> Tensor:
    found = torch.autograd.functional.jacobian(function, at)  # type: ignore[no-untyped-call]
    assert isinstance(found, Tensor)
    return found


def along_twists(model: ContactModel, rotation: Tensor, position: Tensor) -> Tensor:
    """(V, 3, 6) derivatives of places."""
    still = torch.zeros(6, dtype=torch.float64)
    return jacobian(lambda twist: places(model, spun(rotation, twist[3:]), position + twist[:3]), still)


def by_pose(model: ContactModel, pose: Tensor) -> Tensor:
    """(V, 3, 7) derivatives of places by x and q."""
    return jacobian(lambda moved: places(model, rotation_of(moved[3:]), moved[:3]), pose)


@pytest.mark.parametrize(("kind", "form"), WITH_CONTACTS)
def test_gaps_and_jacobians_are_those_of_the_equations(kind: str, form: Form) -> None:
    """method.md 6.3: along x + v, R exp(hat omega), and as the derivative by the quaternion times Gamma."""
    model, rows = contact_model(kind, form, seed=22), rows_of("sliding", 4)
    frames = Frames.of(CUBE, *rows)
    with torch.no_grad():
        contacts = model.contacts(frames)
        gaps, jacobians = model.contacts_at(frames.rotations, frames.positions)
    torch.testing.assert_close(gaps, contacts.gaps, rtol=0.0, atol=1e-12)
    torch.testing.assert_close(jacobians, contacts.jacobians, rtol=0.0, atol=1e-12)
    for n in range(len(gaps)):
        turn, place = frames.rotations[n], frames.positions[n]
        with torch.no_grad():
            following = places(model, frames.rotations_next[n], frames.positions_next[n])[:, 0]
            assert (places(model, turn, place)[:, 0] - contacts.gaps[n]).abs().max() < 1e-12
            assert (following - contacts.gaps_next[n]).abs().max() < 1e-12
        pose = torch.as_tensor(rows.before[n, :7])
        for derivative in (along_twists(model, turn, place), by_pose(model, pose) @ gamma(pose[3:])):
            assert (derivative - contacts.jacobians[n]).abs().max() < 1e-10


def gamma(wxyz: Tensor) -> Tensor:
    """(7, 6) from a twist to the rates of x and q: q_dot = q (0, omega) / 2."""
    w, x, y, z = (float(value) for value in wxyz)
    found = torch.zeros(7, 6, dtype=torch.float64)
    found[:3, :3] = torch.eye(3)
    found[3:, 3:] = 0.5 * torch.tensor([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]], dtype=torch.float64)
    return found


def test_deep_knows_where_the_body_is_and_deepvertex_does_not() -> None:
    """A shift of the board's origin changes the answers of the former only."""
    frames = Frames.of(CUBE, *rows_of("sliding", 4))
    moved_away = frames.positions + torch.tensor([3.0, -2.0, 0.0])
    with torch.no_grad():
        for kind, same in (("deep", False), ("deepvertex", True)):
            model = contact_model(kind, Form.PHYSICAL, seed=23)
            here, there = (model.contacts_at(frames.rotations, at)[1] for at in (frames.positions, moved_away))
            assert torch.equal(here, there) is same
