"""The kernel's gradient steps of a model with networks, a transition each: its structures field by field."""

import ctypes
from collections.abc import Mapping

import numpy as np

from contact_curation.contact.compiled_descent import (
    PIECES,
    DescentRows,
    DescentRules,
    KernelDescent,
    Moments,
    StepPace,
    point_to_pieces,
)
from contact_curation.contact.compiled_evaluation import CompiledModel
from contact_curation.contact.deep_model import NETWORK_SHARE as DEEP_SHARE
from contact_curation.contact.deep_model import DeepModel
from contact_curation.contact.deepvertex_model import NETWORK_SHARE as DEEPVERTEX_SHARE
from contact_curation.contact.deepvertex_model import DeepvertexModel
from contact_curation.contact.end_to_end_model import EndToEndModel, ImpulseLoss
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.stream_network import Activation, StreamNetwork
from contact_curation.solver.cone_problem import MAX_CONTACTS

type NetworkModel = DeepModel | DeepvertexModel | EndToEndModel

MAX_LAYERS, MAX_WIDTH = 8, 256
"""The kernel's."""


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
    job = _Descent(
        polytope_rate=polytope.rate, polytope_decay=polytope.decay, network_rate=network.rate, network_decay=network.decay
    )
    for place, (name, one) in enumerate(_networks(model).items()):
        job.networks[place] = _network(name, one, moments)
    constants: object = None
    match model:
        case DeepModel():
            own = {piece: moments[f"polytope.{piece}"] for piece in PIECES}
            point_to_pieces(compiled, own)
            for place, piece in enumerate(own.values()):
                job.theta[place] = _Moments.of(piece)
            job.share = DEEP_SHARE
        case DeepvertexModel() | EndToEndModel():
            constants = mean, scale = model.scaling.mean, model.scaling.scale
            job.mean, job.scale, job.share = mean.data_ptr(), scale.data_ptr(), DEEPVERTEX_SHARE
    job.squared = int(isinstance(model, EndToEndModel) and model.loss is ImpulseLoss.SQUARED)
    function = f"contact_curation_descend_{model.kind.value}"
    return KernelDescent(function, compiled, rows, rules, job, (moments, constants))


def _networks(model: NetworkModel) -> dict[str, StreamNetwork]:
    """In the kernel's order."""
    return {name: module for name, module in model.named_children() if isinstance(module, StreamNetwork)}


def _network(name: str, network: StreamNetwork, moments: Mapping[str, Moments]) -> "_Network":
    layers = _Network(len(network.linear), int(network.activation is Activation.RELU))
    for depth, layer in enumerate(network.linear):
        weight, bias = (_Moments.of(moments[f"{name}.layers.{depth}.{part}"]) for part in ("weight", "bias"))
        layers.layer[depth] = _Layer(layer.in_features, layer.out_features, weight, bias)
    return layers


class _Moments(ctypes.Structure):
    """The kernel's `Moments` (contact/kernel/stream_pass.hpp)."""

    _fields_ = (("theta", ctypes.c_void_p), ("first", ctypes.c_void_p), ("second", ctypes.c_void_p))

    @staticmethod
    def of(moments: Moments) -> "_Moments":
        return _Moments(*(array.ctypes.data for array in (moments.theta, moments.first, moments.second)))


class _Layer(ctypes.Structure):
    _fields_ = (("inputs", ctypes.c_int64), ("outputs", ctypes.c_int64), ("weight", _Moments), ("bias", _Moments))


class _Network(ctypes.Structure):
    _fields_ = (("layers", ctypes.c_int64), ("rectified", ctypes.c_int64), ("layer", _Layer * MAX_LAYERS))


class _Descent(ctypes.Structure):
    """The kernel's `NetworkDescent`, field by field (contact/kernel/network_descent.cpp)."""

    _fields_ = (
        ("rows", ctypes.c_void_p),
        ("shares", ctypes.c_void_p),
        ("steps", ctypes.c_int64),
        ("regularizer", ctypes.c_double),
        ("polytope_rate", ctypes.c_double),
        ("polytope_decay", ctypes.c_double),
        ("network_rate", ctypes.c_double),
        ("network_decay", ctypes.c_double),
        ("first_beta", ctypes.c_double),
        ("second_beta", ctypes.c_double),
        ("epsilon", ctypes.c_double),
        ("theta", _Moments * len(PIECES)),
        ("networks", _Network * 2),
        ("mean", ctypes.c_void_p),
        ("scale", ctypes.c_void_p),
        ("share", ctypes.c_double),
        ("squared", ctypes.c_int64),
        ("seen", ctypes.c_double),
        ("loss_sum", ctypes.c_double),
    )
