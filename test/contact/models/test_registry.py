"""All four models: published sizes, seeds, tensors and back, what a bad transition does, and that they learn."""

import numpy as np
import pytest
import torch

from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.end_to_end import EndToEndModel, ImpulseLoss
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.torch_loss import scale_regularizer
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from test.contact.cases import CUBE
from test.contact.model_cases import VARIANTS, bytes_of, model_of, rows_of, tossed_rows

EVERY = pytest.mark.parametrize(("kind", "form"), VARIANTS)
CONFIG = LossConfig(threads=1)


@pytest.mark.parametrize(
    ("kind", "form", "count"),
    [
        ("polytope", Form.CONTACTNETS, 57),
        ("polytope", Form.PHYSICAL, 52),
        ("polytope", Form.RIGID, 28),
        ("deep", Form.CONTACTNETS, 144_465),
        ("deepvertex", Form.PHYSICAL, 74_520),
        ("end_to_end", Form.PHYSICAL, 205_318),
    ],
)
def test_sizes_are_the_published_ones(kind: str, form: Form, count: int) -> None:
    assert sum(value.numel() for value in model_of(kind, form).parameters()) == count


def test_a_body_with_fewer_vertices_has_fewer_contacts() -> None:
    corners = np.array([[1.0, 1, -1], [1, -1, 1], [-1, 1, 1], [-1, -1, -1]])
    body = Body("tetrahedron", 0.05 * corners, 0.3, np.full(3, 5e-4), 0.2, 0.05)
    rows = rows_of("impact", 3)
    for kind, form in VARIANTS:
        model = model_class(kind).initial(body, form, tossed_rows(), np.random.default_rng(0))
        assert model.batch_loss(rows, CONFIG).solved.all()
        if kind == "deepvertex":
            assert model.tensors()["vertices"].shape == (4, 3)


@EVERY
def test_a_seed_gives_the_same_bytes_and_another_others(kind: str, form: Form) -> None:
    torch.manual_seed(1)
    first = bytes_of(model_of(kind, form, seed=3))
    torch.manual_seed(2)
    assert bytes_of(model_of(kind, form, seed=3)) == first
    assert bytes_of(model_of(kind, form, seed=4)) != first


def test_a_polytope_begins_at_the_described_body_with_the_published_noise() -> None:
    for form in (Form.CONTACTNETS, Form.PHYSICAL, Form.RIGID):
        model, rng = model_of("polytope", form, seed=3), np.random.default_rng(3)
        assert isinstance(model, PolytopeModel)
        found = model.geometry()
        own, tangent = (CUBE.scaled_vertices + 0.4 * rng.standard_normal((8, 3)) for _ in range(2))
        np.testing.assert_allclose(found.vertices_normal, own, rtol=1e-12)
        np.testing.assert_allclose(found.vertices_tangent, own if form is Form.RIGID else tangent, rtol=1e-12)
        if form is Form.CONTACTNETS:
            np.testing.assert_allclose(found.normal, [0.0, 0.0, 1.0] + 0.4 * rng.standard_normal(3), rtol=1e-12)
            noisy = np.eye(2, 3) + 0.4 * rng.standard_normal((2, 3))
            np.testing.assert_allclose(found.tangents, CUBE.friction * noisy, rtol=1e-12)
            continue
        tilt, factor, height = 0.4 * rng.standard_normal(2), np.exp(0.4 * rng.standard_normal()), 0.4 * rng.standard_normal()
        np.testing.assert_allclose(found.normal[:2] / found.normal[2], tilt, rtol=1e-12)
        assert np.linalg.norm(found.tangents, axis=1) == pytest.approx(CUBE.friction * factor, rel=1e-12)
        assert found.height == pytest.approx(height, rel=1e-12)


def test_a_new_model_leaves_torchs_own_generator_alone() -> None:
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    for kind, form in VARIANTS:
        model_of(kind, form)
    assert torch.equal(torch.rand(3), expected)


@EVERY
def test_tensors_and_settings_give_the_model_back(kind: str, form: Form) -> None:
    model, rows = model_of(kind, form, seed=6), rows_of("impact", 4)
    again = model_class(kind).of_tensors(model.settings(), model.tensors(), CUBE)
    assert bytes_of(again) == bytes_of(model)
    assert torch.equal(again.batch_loss(rows, CONFIG).losses, model.batch_loss(rows, CONFIG).losses)
    assert again.settings() == model.settings()


@EVERY
def test_only_a_polytope_that_is_not_in_the_published_form_has_an_exact_fit(kind: str, form: Form) -> None:
    assert model_class(kind).has_exact_fit(form) == (kind == "polytope" and form is not Form.CONTACTNETS)


def damaged(name: str, value: Array | None) -> dict[str, Array]:
    tensors = model_of("deep", Form.CONTACTNETS).tensors()
    if value is None:
        del tensors[name]
    else:
        tensors[name] = value
    return tensors


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("polytope.normal", None, r"deep parameters: found no array 'polytope.normal', expected \d+ known ones$"),
        ("more", np.zeros(3), r"deep parameters: found an unknown array 'more', expected \d+ known ones$"),
        ("polytope.normal", np.zeros(4), r"shape \(4,\), expected float64 of shape \(3,\)"),
        ("polytope.normal", np.zeros(3, np.float32), "found float32"),
        ("polytope.normal", np.array([0.0, np.nan, 1.0]), "not finite"),
    ],
)
def test_tensors_that_are_not_a_models_are_refused(name: str, value: Array | None, says: str) -> None:
    with pytest.raises(InvalidValueError, match=says):
        model_class("deep").of_tensors({"form": "contactnets"}, damaged(name, value), CUBE)


@pytest.mark.parametrize(
    ("kind", "settings", "says"),
    [
        ("polytope", {}, "setting form: found None, expected one of contactnets, physical, rigid"),
        ("deep", {"form": "round"}, "setting form: found round"),
        ("end_to_end", {"loss": "cubed"}, "setting loss: found cubed, expected one of norm, squared$"),
    ],
)
def test_settings_that_are_missing_or_unknown_are_refused(kind: str, settings: dict[str, str], says: str) -> None:
    with pytest.raises(InvalidValueError, match=says):
        model_class(kind).of_tensors(settings, {}, CUBE)


@pytest.mark.parametrize("kind", ["deepvertex", "end_to_end"])
def test_one_transition_is_too_few_to_normalise_by(kind: str) -> None:
    with pytest.raises(
        InvalidValueError, match=r"^data: found 1 transitions, expected at least 2 to normalise a network's inputs by$"
    ):
        model_class(kind).initial(CUBE, Form.PHYSICAL, rows_of("impact", 2).take([0]), np.random.default_rng(0))


def slopes_of(model: Model, losses: torch.Tensor) -> torch.Tensor:
    found = torch.autograd.grad(losses.sum(), list(model.parameters()), allow_unused=True, materialize_grads=True)
    return torch.cat([slope.flatten() for slope in found])


@EVERY
@pytest.mark.parametrize("where", ["before", "after"])
def test_a_bad_transition_is_not_solved_and_leaves_its_neighbours_alone(kind: str, form: Form, where: str) -> None:
    model, rows = model_of(kind, form, seed=7), rows_of("impact", 5)
    broken = Rows(rows.before.copy(), rows.after.copy(), rows.dt)
    getattr(broken, where)[2, 0] = np.nan
    batch, kept = model.batch_loss(broken, CONFIG), [0, 1, 3, 4]
    assert batch.solved.tolist() == [n != 2 for n in range(5)]
    assert torch.isnan(batch.losses).tolist() == [n == 2 for n in range(5)]
    assert torch.isfinite(batch.regularizer)
    alone = model.batch_loss(rows.take(kept), CONFIG).losses
    torch.testing.assert_close(batch.losses[kept], alone, rtol=1e-9, atol=0.0)
    torch.testing.assert_close(slopes_of(model, batch.losses[batch.solved]), slopes_of(model, alone), rtol=1e-7, atol=1e-9)


def test_deep_with_silent_networks_is_its_polytope_exactly() -> None:
    for form in (Form.PHYSICAL, Form.CONTACTNETS):
        plain, rows = model_of("polytope", form, seed=8), rows_of("impact", 6)
        assert isinstance(plain, PolytopeModel)
        deep = DeepModel(plain.geometry(), CUBE, form)
        ours, theirs = deep.batch_loss(rows, CONFIG), plain.batch_loss(rows, CONFIG)
        torch.testing.assert_close(ours.losses, theirs.losses, rtol=1e-7, atol=1e-9)
        torch.testing.assert_close(ours.regularizer, theirs.regularizer, rtol=1e-12, atol=1e-12)
        block = [name for name, _ in plain.named_parameters()]
        found = torch.autograd.grad(ours.losses.sum(), [deep.get_parameter(f"polytope.{name}") for name in block])
        expected = torch.autograd.grad(theirs.losses.sum(), [plain.get_parameter(name) for name in block])
        for one, other in zip(found, expected, strict=True):
            torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-6)


def test_the_regularizer_is_contactnets_one() -> None:
    """By hand: eight contacts, a normal of length 2 and one tangent that leans towards it by 60 degrees."""
    model = PolytopeModel(some_polytope().geometry(), CUBE, Form.CONTACTNETS)
    with torch.no_grad():
        model.normal.copy_(torch.tensor([0.0, 0.0, 2.0]))
        model.tangents.copy_(0.3 * torch.tensor([[3**0.5 / 2.0, 0.0, 0.5], [0.0, 1.0, 0.0]]))
    value = model.batch_loss(rows_of("impact", 3), CONFIG).regularizer
    assert float(value.detach()) == pytest.approx(8.0 * (2.0 - 1.0) ** 2 + 8.0 * 0.5**2)


def test_the_regularizers_slopes_are_those_of_its_equation() -> None:
    rng = np.random.default_rng(11)
    jacobians = torch.as_tensor(rng.standard_normal((3, 4, 3, 6))).requires_grad_()
    with torch.no_grad():
        jacobians[1, 2, 1] = 0.0  # a tangent without a direction
    slopes = jacobians[..., :3]
    sizes = torch.linalg.vector_norm(slopes, dim=-1)
    units = slopes / sizes.clamp(min=1e-9)[..., None]
    overlaps = torch.einsum("bki,bkai->bka", units[..., 0, :], units[..., 1:, :])
    expected = ((sizes[..., 0] - 1.0).square().sum() + overlaps.square().sum()) / 3.0
    found = scale_regularizer(jacobians)
    torch.testing.assert_close(found, expected, rtol=1e-12, atol=0.0)
    for one, other in zip(torch.autograd.grad(found, jacobians), torch.autograd.grad(expected, jacobians)):
        torch.testing.assert_close(one[0], other[0], rtol=1e-10, atol=1e-12)
        torch.testing.assert_close(one[2], other[2], rtol=1e-10, atol=1e-12)
        assert torch.isfinite(one).all()


def some_polytope() -> PolytopeModel:
    model = model_of("polytope", Form.CONTACTNETS)
    assert isinstance(model, PolytopeModel)
    return model


def test_the_physical_form_and_deepvertex_need_no_regularizer() -> None:
    for kind in ("polytope", "deepvertex"):
        assert float(model_of(kind, Form.PHYSICAL).batch_loss(rows_of("impact", 2), CONFIG).regularizer) == 0.0


def test_end_to_end_measures_the_missed_velocity_as_it_is_told() -> None:
    norm, rows = model_of("end_to_end", Form.PHYSICAL, seed=9), rows_of("impact", 4)
    assert norm.settings() == {"loss": "norm"}
    squared = model_class("end_to_end").of_tensors({"loss": ImpulseLoss.SQUARED.value}, norm.tensors(), CUBE)
    first, second = (model.batch_loss(rows, CONFIG).losses for model in (norm, squared))
    torch.testing.assert_close(first.square(), second)
    assert isinstance(squared, EndToEndModel)
    impulses = squared.impulses(rows).detach().numpy()
    free = rows.before[:, 7:] - np.outer(rows.dt, [0.0, 0.0, CUBE.scaled_gravity, 0.0, 0.0, 0.0])
    mass = np.repeat([CUBE.mass, CUBE.scaled_inertia[0, 0]], 3)
    missed = free + impulses / mass - rows.after[:, 7:]
    np.testing.assert_allclose(np.square(missed).sum(axis=1), second.detach().numpy(), rtol=1e-12)


def test_impulses_that_diverged_are_not_solved() -> None:
    model = model_of("end_to_end", Form.PHYSICAL)
    with torch.no_grad():
        next(model.parameters()).fill_(torch.inf)
    batch = model.batch_loss(rows_of("impact", 3), CONFIG)
    assert not batch.solved.any()
    assert torch.isnan(batch.losses).all()


def test_deepvertex_starts_from_noisy_corners_and_its_constants_are_not_trained() -> None:
    model = model_of("deepvertex", Form.PHYSICAL, seed=12)
    noise = model.tensors()["vertices"] - CUBE.scaled_vertices
    assert 0.25 < noise.std() < 0.55
    assert {name.split(".")[0] for name, _ in model.named_parameters()} == {"network"}


@EVERY
def test_a_model_learns(kind: str, form: Form) -> None:
    model, rows = model_of(kind, form, seed=10), rows_of("impact", 8)
    adam = torch.optim.Adam(model.parameters(), lr=2e-3 if kind == "end_to_end" else 1e-2)
    losses = []
    for _ in range(15):
        loss = model.batch_loss(rows, CONFIG).losses.mean()
        adam.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        adam.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.7 * losses[0]
