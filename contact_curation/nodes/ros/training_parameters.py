"""Declares the parameters of the trainer: model, initial parameters, protocol, recordings to evaluate on."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from rclpy.node import Node

from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.model import Model, Rows
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.models.registry import model_class
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.learning.training.plan import first_model
from contact_curation.learning.training.protocols import ROUND_TRIMMED, USUAL_STARTS, TrainingConfig, budgeted, exact
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import evaluation_tosses
from contact_curation.stages.held_out_tosses import HeldOutConfig, HeldOutTosses
from contact_curation.storage.parameters_file import Parameters, read_theta

ROUND_STEPS = 400
"""Default number of steps of a round; it continues the last round, so it needs fewer steps than a separate training."""


PROTOCOLS = ("auto", "exact", "budgeted")
PROTOCOLS_EXPLAINED = (
    "how a round trains; budgeted: takes the gradient steps of parameter steps; exact: goes to a polytope's optimum, without "
    "steps, batch, polytope.*, network.* and influence.*; auto: exact for a polytope in other forms than contactnets"
)


def declared_protocol(node: Node, kind: str) -> TrainingConfig:
    """Declares the parameters of a round's protocol; defaults are our protocol for this kind of model.

    Raises:
        InvalidValueError: the exact protocol is asked for a model that does not have it.
    """
    ours = budgeted(kind)
    protocol = declare(node, "protocol", PROTOCOLS[0], PROTOCOLS_EXPLAINED, choices=PROTOCOLS)
    usual = Form.RIGID if protocol != "budgeted" and model_class(kind).has_exact_fit(Form.RIGID) else ours.form
    form = Form(declare(node, "form", usual.value, "parameterisation of theta", choices=[form.value for form in Form]))
    has_optimum = model_class(kind).has_exact_fit(form)
    if protocol == "exact" and not has_optimum:
        raise InvalidValueError("protocol", f"exact for {kind}, {form.value}", "budgeted, or a polytope, physical or rigid")
    if protocol != "budgeted" and has_optimum:
        ours = exact(ROUND_TRIMMED, USUAL_STARTS)
    trimmed = declare(
        node,
        "trimmed",
        ours.trimmed,
        "share of the worst explained transitions that an exact fit leaves out",
        bounds=(0.0, 0.5),
    )
    starts = declare(node, "starts", ours.starts, "how often an exact fit starts; the lowest minimum counts", bounds=(1, 1000))
    bounces = declare(node, "restitution", False, "whether an exact fit in the form rigid learns a restitution")
    about_shape = "how exactly the described corners are known [m]; 0: not, theta begins at the published initialisation"
    shape = declare(node, "shape_known_to", 0.0, about_shape, bounds=(0.0, 1.0))
    steps = declare(node, "steps", ROUND_STEPS, "gradient steps in a round", bounds=(1, 1 << 31))
    return replace(
        ours,
        form=form,
        trimmed=trimmed,
        starts=starts,
        restitution=bounces,
        shape_known_to=shape or None,
        batch=declare(node, "batch", ours.batch, "transitions in a gradient step", bounds=(1, 1 << 20)),
        steps=steps,
        evaluation_steps=steps,
        polytope=declare_config(node, ours.polytope, "polytope."),
        network=declare_config(node, ours.network, "network."),
        influence=declare_config(node, ours.influence, "influence."),
        loss=declare_config(node, replace(DEFAULT_LOSS, threads=1), "loss."),
    )


def first_model_of(
    path: str, kind: str, body: Body, protocol: TrainingConfig, seed: int
) -> tuple[Callable[[Rows], Model], Body]:
    """Returns a function that makes the initial model, from a file or `learning.training.plan.first_model`, and its body.

    Args:
        path: of the file, the parameter `params`; empty for none.
        kind: of the model.
        body: that was declared.
        protocol: of a round.
        seed: of a random initialisation.

    Raises:
        ContactCurationError: the file contains no model of this kind.
    """
    protocol.shape_of(body)  # refuses what is no length of it
    if not path:
        return lambda data: first_model(kind, body, protocol, data, seed), body
    model = _stored_model(Path(path), body, protocol.form)
    if model.kind != kind:
        raise InvalidValueError(f"model in {path}", model.kind, kind)
    return lambda _: model, model.body


def declared_held_out(node: Node, body: Body) -> HeldOutTosses:
    """Declares the recordings to evaluate on, and reads their tosses.

    Raises:
        InvalidValueError: the recordings contain no toss.
    """
    paths = declare(node, "evaluate_on", [""], "recordings on which training_status reports errors; they are never trained on")
    config = declare_config(node, HeldOutConfig())
    recordings = [Path(path) for path in paths if path]
    return HeldOutTosses(evaluation_tosses("parameter evaluate_on", recordings, ReadingConfig(body, config.inputs)))


def _stored_model(path: Path, body: Body, form: Form) -> Model:
    theta = read_theta(path, body)
    if isinstance(theta, Parameters):
        geometry = theta.geometry.rigid() if form is Form.RIGID else theta.geometry
        return PolytopeModel(geometry, theta.body, form)
    return theta
