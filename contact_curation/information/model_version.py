"""The version of theta: a digest in 16 letters, equal for equal numbers."""

import hashlib

import numpy as np

from contact_curation.contact.models.model import Model
from contact_curation.information.scoring import parameters_version


def model_version(model: Model) -> str:
    """A digest of a model's numbers and of its body's constants; a polytope's is that of its geometry, in either form."""
    geometry = model.geometry()
    if geometry is not None:
        return parameters_version(geometry, model.body)
    state, body = hashlib.sha256(model.kind.encode()), model.body
    for name, value in sorted(model.tensors().items()):
        state.update(name.encode())
        state.update(np.ascontiguousarray(value).tobytes())
    for constant in (body.inertia, np.array([body.mass, body.gravity, body.length_scale])):
        state.update(np.ascontiguousarray(constant).tobytes())
    return state.hexdigest()[:16]
