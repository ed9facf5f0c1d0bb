"""Any of the four models, made anew, or from its tensors and back."""

from collections.abc import Mapping
from enum import StrEnum

import numpy as np
import torch

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.contact.models.end_to_end import EndToEndModel, ImpulseLoss
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.polytope import INITIAL_NOISE, PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


def initial_model(kind: ModelKind, body: Body, form: Form, data: Rows, rng: np.random.Generator) -> Model:
    """A model at its published random initialisation (METHOD 1.1).

    Args:
        kind: which.
        body: what is known of the object.
        form: of the polytope in it, where there is one that is trained.
        data: what it will be trained on, for the point about which the ground tilts and the networks' normalisation.
        rng: where the noise comes from; the same seed gives the same bytes.

    Raises:
        InvalidValueError: fewer than two transitions to normalise a network's inputs by.
    """
    match kind:
        case ModelKind.POLYTOPE:
            return PolytopeModel(initial_geometry(body, form, _amid(data), rng), body, form)
        case ModelKind.DEEP:
            return DeepModel(initial_geometry(body, form, _amid(data), rng), body, form).initialise(rng)
        case ModelKind.DEEPVERTEX:
            corners = body.scaled_vertices
            noisy = corners + INITIAL_NOISE * rng.standard_normal(corners.shape)
            return DeepvertexModel(noisy, body).initialise(data, rng)
        case ModelKind.END_TO_END:
            return EndToEndModel(body).initialise(data, rng)


def model_of_tensors(kind: ModelKind, settings: Mapping[str, str], tensors: Mapping[str, Array], body: Body) -> Model:
    """The model that `Model.settings` and `tensors_of` came from.

    Raises:
        InvalidValueError: settings that are missing or unknown; tensors that are missing, too many, of another shape or type,
            or not finite.
    """
    model = _blank(kind, settings, body)
    expected = model.state_dict()
    differing = sorted(set(expected) ^ set(tensors))
    if differing:
        there = "no" if differing[0] in expected else "an unknown"
        raise InvalidValueError(f"{kind.value} parameters", f"{there} array {differing[0]!r}", f"{len(expected)} known ones")
    for name, value in expected.items():
        found = np.asarray(tensors[name])
        if found.shape != tuple(value.shape) or found.dtype != np.float64:
            shape = f"float64 of shape {tuple(value.shape)} for a body with {len(body.vertices)} vertices"
            raise InvalidValueError(f"{kind.value} parameter {name}", f"{found.dtype} of shape {found.shape}", shape)
        if not np.isfinite(found).all():
            raise InvalidValueError(f"{kind.value} parameter {name}", "a value that is not finite", "finite numbers")
    model.load_state_dict({name: torch.as_tensor(np.array(value)) for name, value in tensors.items()})
    return model


def tensors_of(model: Model) -> dict[str, Array]:
    """A model's tensors by name, parameters and constants."""
    return {name: value.detach().cpu().numpy().copy() for name, value in model.state_dict().items()}


def _blank(kind: ModelKind, settings: Mapping[str, str], body: Body) -> Model:
    """A model of this kind whose numbers are still to be loaded."""
    geometry = ContactGeometry.of_body(body)
    match kind:
        case ModelKind.POLYTOPE:
            return PolytopeModel(geometry, body, _setting(settings, "form", Form))
        case ModelKind.DEEP:
            return DeepModel(geometry, body, _setting(settings, "form", Form))
        case ModelKind.DEEPVERTEX:
            return DeepvertexModel(body.scaled_vertices, body)
        case ModelKind.END_TO_END:
            return EndToEndModel(body, _setting(settings, "loss", ImpulseLoss))


def _setting[Choice: StrEnum](settings: Mapping[str, str], name: str, choices: type[Choice]) -> Choice:
    found = settings.get(name)
    if found not in [choice.value for choice in choices]:
        raise InvalidValueError(f"setting {name}", found, f"one of {', '.join(choices)}")
    return choices(found)


def _amid(data: Rows) -> Array:
    """The point (3,) of the plane z = 0 under the data's centroid."""
    return np.array([*data.before[:, :2].mean(axis=0), 0.0])
