"""The kernel's gradient steps of a model with networks, a transition each."""

from collections.abc import Mapping
from typing import NamedTuple

from contact_curation.contact.body import Body
from contact_curation.contact.compiled.descent import (
    MAX_LAYERS,
    MAX_WIDTH,
    PIECES,
    CompiledDescent,
    CompiledLayer,
    CompiledMoments,
    CompiledNetwork,
    DescentTask,
    KernelDescent,
    Moments,
)
from contact_curation.contact.compiled.evaluation import CompiledModel
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.stream_network import Activation, InputScaling, StreamNetwork
from contact_curation.solver.cone_problem import MAX_CONTACTS


class DescentParts(NamedTuple):
    """Constants of a model with networks that the kernel needs.

    Attributes:
        kind: names the kernel's function.
        body: mass, inertia and gravity.
        geometry: of its contacts, which change in place where there is a polytope.
        networks: by name, in the kernel's order.
        share: what the networks' outputs are multiplied with.
        scaling: of their inputs, where there is one.
        polytope: what the names of the polytope's parameters begin with, where it has one in the published form.
        squared: whether an end-to-end loss is squared.
    """

    kind: str
    body: Body
    geometry: ContactGeometry
    networks: Mapping[str, StreamNetwork]
    share: float = 1.0
    scaling: InputScaling | None = None
    polytope: str | None = None
    squared: bool = False

    @property
    def fits(self) -> bool:
        """Whether the kernel has room for its contacts and networks."""
        layers = [network.linear for network in self.networks.values()]
        width = max(max(layer.in_features, layer.out_features) for each in layers for layer in each)
        return self.geometry.vertex_count <= MAX_CONTACTS and width <= MAX_WIDTH and max(map(len, layers)) <= MAX_LAYERS


def network_descent(parts: DescentParts, task: DescentTask) -> KernelDescent | None:
    """Makes gradient steps of a model with networks; None where the kernel has no room for it."""
    if not parts.fits:
        return None
    compiled = CompiledModel(parts.geometry, parts.body, task.rules.loss)
    job = CompiledDescent(polytope=task.polytope, network=task.network, share=parts.share, squared=int(parts.squared))
    for place, (name, one) in enumerate(parts.networks.items()):
        job.networks[place] = _network(name, one, task.moments)
    if parts.polytope is not None:
        job.take_polytope(compiled, {piece: task.moments[f"{parts.polytope}.{piece}"] for piece in PIECES})
    constants = (parts.scaling.mean, parts.scaling.scale) if parts.scaling else ()
    if constants:
        job.mean, job.scale = (value.data_ptr() for value in constants)
    function = f"contact_curation_descend_{parts.kind}"
    return KernelDescent(function, compiled, task.rows, task.rules, job, (task.moments, constants))


def _network(name: str, network: StreamNetwork, moments: Mapping[str, Moments]) -> CompiledNetwork:
    layers = CompiledNetwork(len(network.linear), int(network.activation is Activation.RELU))
    for depth, layer in enumerate(network.linear):
        weight, bias = (CompiledMoments.of(moments[f"{name}.layers.{depth}.{part}"]) for part in ("weight", "bias"))
        layers.layer[depth] = CompiledLayer(layer.in_features, layer.out_features, weight, bias)
    return layers
