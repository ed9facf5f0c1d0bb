"""Translates messages to the records that the dashboard shows."""

from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.registry import model_entry
from contact_curation.contact.parameter_form import Form
from contact_curation.dashboard.evidence import SelectedSet
from contact_curation.dashboard.live.health_view import NodeHealth
from contact_curation.dashboard.live.learning_view import TrainingMoment
from contact_curation.dashboard.live.throw_view import ThrowMade
from contact_curation.dashboard.toss_motion import ShownTheta
from contact_curation.errors import InvalidValueError
from contact_curation.information.scoring import scored_geometry
from contact_curation.learning.checkpoints.theta_bytes import geometry_of_bytes
from contact_curation.nodes.messages.bounds import MOST_IDS, check_size
from contact_curation.nodes.messages.headers import check_format
from contact_curation.nodes.messages.model_parameters import theta_in
from contact_curation.nodes.messages.throw import throw_of
from contact_curation.nodes.ros.health import PACKAGE, node_of
from contact_curation.stages.scored_theta import ScoredTheta, read_scored_theta


def first_theta(parameters: str, body: Body) -> tuple[ShownTheta, Body]:
    """The initial theta, before any is published, and its body.

    Raises:
        UnreadableInputError, InvalidValueError: the file contains no theta.
    """
    if not parameters:
        return ShownTheta("", _as_scored(ContactGeometry.of_body(body))), body
    theta, body = read_scored_theta(Path(parameters), body)
    return _shown("", theta, body), body


def theta_of(message: Any, body: Body) -> ShownTheta:
    """Reads the theta of a ModelParameters message.

    Raises:
        InvalidValueError, UnreadableInputError: the format is newer, the body is another one, or the bytes are not a theta.
    """
    return _shown(message.version, theta_in(message, body), body)


def _shown(version: str, theta: ScoredTheta, body: Body) -> ShownTheta:
    if model_entry(theta.model).is_geometry:
        geometry = geometry_of_bytes(theta.data)
        wanted = len(body.vertices)  # it is drawn along the body's edges
        if geometry.vertex_count != wanted:
            raise InvalidValueError("vertices of the parameters", geometry.vertex_count, f"{wanted}, as the body has")
        return ShownTheta(version, geometry=_as_scored(geometry))
    from contact_curation.learning.checkpoints.stored_model import model_of_bytes  # torch takes over a second to import

    return ShownTheta(version, model=model_of_bytes(theta.data, "model_parameters", body))


def _as_scored(geometry: ContactGeometry) -> ContactGeometry:
    """The geometry that tosses are scored at, where the scorer's form is the default one."""
    return scored_geometry(geometry, Form.RIGID)


def selected_set_of(message: Any) -> SelectedSet:
    """Reads the selected set of a CuratedBuffer message.

    Raises:
        InvalidValueError: the format is newer, or there are too many tosses.
    """
    check_format(message)
    check_size("toss_ids of the buffer", message.toss_ids, MOST_IDS)
    return SelectedSet(
        criterion=message.criterion,
        capacity=message.capacity,
        toss_ids=tuple(message.toss_ids),
        gains=tuple(message.marginal_gains),
        version=message.parameters_version,
        seen=message.tosses_seen,
        bound=message.efficiency_bound,
    )


def training_of(message: Any) -> TrainingMoment:
    """Reads the state of the training from a TrainingStatus message.

    Raises:
        InvalidValueError: the format is newer.
    """
    check_format(message)
    return TrainingMoment(
        state=message.state,
        gradient_steps=message.gradient_steps,
        training_loss=message.training_loss,
        held_out_loss=message.held_out_loss,
        position_error=message.position_error,
        rotation_error=message.rotation_error,
    )


def throw_made_of(message: Any) -> ThrowMade:
    """Reads a throw and its outcome from a ThrowReport message.

    Raises:
        InvalidValueError: the format is newer, or the throw is invalid.
    """
    check_format(message)
    return ThrowMade(
        kind=message.kind,
        state=message.state,
        commanded=throw_of(message.throw_command),
        planned=message.planned_gain,
        realised=message.realised_gain,
        detail=message.detail,
    )


def healths_of(message: Any, now: float) -> list[NodeHealth]:
    """Reads the health of each node from a DiagnosticArray that was received at `now` [s]."""
    return [
        NodeHealth(
            name=node_of(status.name),
            warning=status.level != DiagnosticStatus.OK,
            message=status.message,
            values={value.key: value.value for value in status.values if value != PACKAGE},
            heard=now,
        )
        for status in message.status
        if PACKAGE in status.values
    ]
