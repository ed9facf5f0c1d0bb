"""The kernel's gradient steps of a model with networks, a transition each: its structures field by field, and its call."""

import ctypes
import functools
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from contact_curation.contact.compiled_descent import PIECES, Moments
from contact_curation.contact.compiled_evaluation import ROW, CompiledModel, CompiledRows
from contact_curation.contact.deep_model import NETWORK_SHARE as DEEP_SHARE
from contact_curation.contact.deep_model import DeepModel
from contact_curation.contact.deepvertex_model import NETWORK_SHARE as DEEPVERTEX_SHARE
from contact_curation.contact.deepvertex_model import DeepvertexModel
from contact_curation.contact.end_to_end_model import EndToEndModel, ImpulseLoss
from contact_curation.contact.geometry_parameters import UPWARD, ContactGeometry
from contact_curation.contact.input_scaling import InputScaling
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.model_kind import ModelKind
from contact_curation.contact.stream_network import Activation, StreamNetwork
from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import load_kernel

type NetworkModel = DeepModel | DeepvertexModel | EndToEndModel
type Pace = tuple[float, float]
"""Learning rate and decay."""

MAX_LAYERS, MAX_WIDTH = 8, 256
"""The kernel's."""


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


class CompiledNetworkDescent:
    """Gradient steps of a model with networks, a transition each: loss, regulariser and AdamW in the kernel.

    Args:
        model: a deep one in the published form, or one of the other two; what stays of it: body, constants and shapes.
        geometry: its `fixed_geometry`.
        moments: of all its parameters, by name.
        config: weights and solver.
        before, after, periods: (N, 13), (N, 13) and (N,), checked.
        regularizer: weight of each contact's.
        polytope, network: paces of the two kinds of parameters.
        betas, epsilon: of AdamW.
    """

    def __init__(
        self,
        model: NetworkModel,
        geometry: ContactGeometry,
        moments: Mapping[str, Moments],
        config: LossConfig,
        before: Array,
        after: Array,
        periods: Array,
        *,
        regularizer: float,
        polytope: Pace,
        network: Pace,
        betas: tuple[float, float],
        epsilon: float,
    ) -> None:
        rows = [np.ascontiguousarray(values, dtype=float) for values in (before, after, periods)]
        self._owners = moments, rows, model  # ctypes holds bare addresses: keep the arrays alive
        self._model = CompiledModel(geometry, model.body, config)
        columns = dict(zip(ROW, (values.ctypes.data for values in rows), strict=True))
        self._rows = CompiledRows(**columns, max_iterations=config.max_iterations, residual_tolerance=config.tolerance)
        self._job = _Descent(
            regularizer=regularizer,
            polytope_rate=polytope[0],
            polytope_decay=polytope[1],
            network_rate=network[0],
            network_decay=network[1],
            first_beta=betas[0],
            second_beta=betas[1],
            epsilon=epsilon,
        )
        match model:
            case DeepModel():
                for place, piece in enumerate(PIECES):
                    own = moments[f"polytope.{piece}"]
                    setattr(self._model, piece, own.theta.ctypes.data)
                    self._job.theta[place] = _Moments.of(own)
                self._take_networks(model, moments, "normal_network", "tangent_network")
                self._job.share = DEEP_SHARE
            case DeepvertexModel():
                self._take_networks(model, moments, "network")
                self._take_scaling(model.scaling)
                self._job.share = DEEPVERTEX_SHARE
            case EndToEndModel():
                self._take_networks(model, moments, "network")
                self._take_scaling(model.scaling)
                self._job.squared = int(model.loss is ImpulseLoss.SQUARED)
        self._descend = _compiled_descent(model.kind)

    def descend(self, rows: NDArray[np.int64], shares: Array, seen: float, loss_sum: float) -> tuple[int, float]:
        """Steps down the rows in turn, to the first that is not solved, or whose loss or slope is not finite.

        Args:
            rows: (S,) places of transitions.
            shares: (S,) of both learning rates.
            seen: steps that the moments have seen.
            loss_sum: of the rows before.

        Returns:
            How many steps were taken, and the sum with theirs.
        """
        rows, shares = np.ascontiguousarray(rows, np.int64), np.ascontiguousarray(shares, float)
        job = self._job
        job.rows, job.shares, job.steps = rows.ctypes.data, shares.ctypes.data, len(rows)
        job.seen, job.loss_sum = seen, loss_sum
        taken = self._descend(ctypes.byref(self._model), ctypes.byref(self._rows), ctypes.byref(job))
        return taken, job.loss_sum

    def _take_networks(self, model: NetworkModel, moments: Mapping[str, Moments], *names: str) -> None:
        for place, name in enumerate(names):
            network = model.get_submodule(name)
            assert isinstance(network, StreamNetwork)
            taken = self._job.networks[place]
            taken.layers, taken.rectified = len(network.linear), int(network.activation is Activation.RELU)
            assert taken.layers <= MAX_LAYERS
            for depth, layer in enumerate(network.linear):
                assert max(layer.in_features, layer.out_features) <= MAX_WIDTH
                weight, bias = (_Moments.of(moments[f"{name}.layers.{depth}.{part}"]) for part in ("weight", "bias"))
                taken.layer[depth] = _Layer(layer.in_features, layer.out_features, weight, bias)

    def _take_scaling(self, scaling: InputScaling) -> None:
        self._job.mean, self._job.scale = scaling.mean.data_ptr(), scaling.scale.data_ptr()


def fixed_geometry(model: NetworkModel) -> ContactGeometry:
    """What the kernel is told of a model's contacts: those of `DeepModel` change in place; `EndToEndModel` has none."""
    match model:
        case DeepModel():
            return model.polytope.geometry()
        case DeepvertexModel():
            vertices, tangents = (model.get_buffer(name).numpy() for name in ("vertices", "tangents"))
            return ContactGeometry(vertices, UPWARD, vertices, tangents)
        case EndToEndModel():
            nowhere = np.zeros((1, 3))
            return ContactGeometry(nowhere, UPWARD, nowhere, model.body.friction * np.eye(2, 3))


@functools.cache
def _compiled_descent(kind: ModelKind) -> Callable[..., int]:
    signature = ctypes.CFUNCTYPE(
        ctypes.c_int64, ctypes.POINTER(CompiledModel), ctypes.POINTER(CompiledRows), ctypes.POINTER(_Descent)
    )
    return signature((f"contact_curation_descend_{kind.value}", load_kernel()))
