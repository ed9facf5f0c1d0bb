"""Any of the four models, made anew, or from its tensors and back."""

import numpy as np
import torch

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.model import Model, Rows
from contact_curation.contact.model_kind import ModelKind
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.polytope_model import PolytopeModel, initial_geometry
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array


def initial_model(kind: ModelKind, body: Body, form: Form, data: Rows, rng: np.random.Generator) -> Model:
    """A model at its published random initialisation.

    Args:
        kind: which.
        body: what is known of the object.
        form: of the polytope in it, where there is one that is trained.
        data: what it will be trained on, for the point about which the ground tilts and the networks' normalisation.
        rng: where the noise comes from.
    """
    if kind is ModelKind.POLYTOPE:
        return PolytopeModel(initial_geometry(body, form, _amid(data), rng), body, form)
    raise InvalidValueError("model", kind.value, ModelKind.POLYTOPE.value)


def model_of_tensors(kind: ModelKind, settings: dict[str, str], tensors: dict[str, Array], body: Body) -> Model:
    """The model that `Model.settings` and its state's tensors came from.

    Raises:
        InvalidValueError: tensors that are missing, too many, of another shape, or not finite.
    """
    if kind is not ModelKind.POLYTOPE:
        raise InvalidValueError("model", kind.value, ModelKind.POLYTOPE.value)
    model = PolytopeModel(ContactGeometry.of_body(body), body, Form(settings["form"]))
    expected = {name: tuple(value.shape) for name, value in model.state_dict().items()}
    found = {name: value.shape for name, value in tensors.items()}
    if found != expected:
        raise InvalidValueError("parameters", f"arrays {found}", f"{expected}")
    if not all(np.isfinite(value).all() for value in tensors.values()):
        raise InvalidValueError("parameters", "a value that is not finite", "finite numbers")
    model.load_state_dict({name: torch.as_tensor(value) for name, value in tensors.items()})
    return model


def tensors_of(model: Model) -> dict[str, Array]:
    """A model's tensors by name, parameters and constants."""
    return {name: value.detach().cpu().numpy().copy() for name, value in model.state_dict().items()}


def _amid(data: Rows) -> Array:
    """The point (3,) of the plane z = 0 under the data's centroid."""
    return np.array([*data.before[:, :2].mean(axis=0), 0.0])
