"""The kernel's gradient steps of a model with networks, a transition each."""

from collections.abc import Mapping

import numpy as np

from contact_curation.contact.compiled.descent import (
    MAX_LAYERS,
    MAX_WIDTH,
    PIECES,
    CompiledDescent,
    CompiledLayer,
    CompiledMoments,
    CompiledNetwork,
    DescentRows,
    DescentRules,
    KernelDescent,
    Moments,
    StepPace,
)
from contact_curation.contact.compiled.evaluation import CompiledModel
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.models.deep import NETWORK_SHARE as DEEP_SHARE
from contact_curation.contact.models.deep import DeepModel
from contact_curation.contact.models.deepvertex import NETWORK_SHARE as DEEPVERTEX_SHARE
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.contact.models.end_to_end import EndToEndModel, ImpulseLoss
from contact_curation.contact.models.stream_network import Activation, StreamNetwork
from contact_curation.contact.parameter_form import Form
from contact_curation.solver.cone_problem import MAX_CONTACTS

type NetworkModel = DeepModel | DeepvertexModel | EndToEndModel


def fits_kernel(model: NetworkModel) -> bool:
    """Whether the kernel knows its polytope's form, where there is one, and has room for its contacts and networks."""
    if isinstance(model, DeepModel) and model.polytope.form is not Form.CONTACTNETS:
        return False
    layers = [network.linear for network in _networks(model).values()]
    width = max(max(layer.in_features, layer.out_features) for each in layers for layer in each)
    contacts = fixed_geometry(model).vertex_count
    return contacts <= MAX_CONTACTS and width <= MAX_WIDTH and max(map(len, layers)) <= MAX_LAYERS


def fixed_geometry(model: NetworkModel) -> ContactGeometry:
    """What the kernel is told of a model's contacts: those of `DeepModel` change in place; `EndToEndModel` has none."""
    match model:
        case DeepModel():
            return model.polytope.geometry()
        case DeepvertexModel():
            vertices, normal, tangents = (model.get_buffer(name).numpy() for name in ("vertices", "normal", "tangents"))
            return ContactGeometry(vertices, normal, vertices, tangents)
        case EndToEndModel():
            nowhere = np.zeros((1, 3))
            return ContactGeometry(nowhere, UPWARD, nowhere, model.body.friction * np.eye(2, 3))


def network_descent(
    model: NetworkModel,
    moments: Mapping[str, Moments],
    rows: DescentRows,
    rules: DescentRules,
    polytope: StepPace,
    network: StepPace,
) -> KernelDescent:
    """Of a model with networks.

    Args:
        model: one that `fits_kernel`; body, pivot, height and scaling stay as they are now.
        moments: of all its parameters, by name.
        rows, rules: as in `KernelDescent`.
        polytope, network: paces of the two kinds of parameters.
    """
    compiled = CompiledModel(fixed_geometry(model), model.body, rules.loss)
    job = CompiledDescent(polytope=polytope, network=network)
    for place, (name, one) in enumerate(_networks(model).items()):
        job.networks[place] = _network(name, one, moments)
    constants: object = None
    match model:
        case DeepModel():
            job.take_polytope(compiled, {piece: moments[f"polytope.{piece}"] for piece in PIECES})
            job.share = DEEP_SHARE
        case DeepvertexModel() | EndToEndModel():
            constants = mean, scale = model.scaling.mean, model.scaling.scale
            job.mean, job.scale = mean.data_ptr(), scale.data_ptr()
            job.share = DEEPVERTEX_SHARE if isinstance(model, DeepvertexModel) else 1.0
    job.squared = int(isinstance(model, EndToEndModel) and model.loss is ImpulseLoss.SQUARED)
    function = f"contact_curation_descend_{model.kind.value}"
    return KernelDescent(function, compiled, rows, rules, job, (moments, constants))


def _networks(model: NetworkModel) -> dict[str, StreamNetwork]:
    """In the kernel's order."""
    return {name: module for name, module in model.named_children() if isinstance(module, StreamNetwork)}


def _network(name: str, network: StreamNetwork, moments: Mapping[str, Moments]) -> CompiledNetwork:
    layers = CompiledNetwork(len(network.linear), int(network.activation is Activation.RELU))
    for depth, layer in enumerate(network.linear):
        weight, bias = (CompiledMoments.of(moments[f"{name}.layers.{depth}.{part}"]) for part in ("weight", "bias"))
        layers.layer[depth] = CompiledLayer(layer.in_features, layer.out_features, weight, bias)
    return layers
