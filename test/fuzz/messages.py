"""Messages on topics: CDR bytes as the middleware hands them on, then the checks at the nodes' door."""

from collections.abc import Callable
from typing import Any

from contact_curation_msgs.msg import CuratedBuffer, ModelParameters, Throw, ThrowReport, Toss, TossInformation, TrainingStatus
from rclpy.serialization import deserialize_message

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.nodes.messages.shown import selected_set_of, theta_of, throw_made_of, training_of
from contact_curation.nodes.messages.throw import throw_of
from contact_curation.nodes.messages.throw_report import report_of
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.messages.toss_bytes import toss_in
from contact_curation.nodes.messages.toss_information import information_of


def _theta(message: Any) -> object:
    return theta_of(message, CONTACTNETS_CUBE)


DOORS: tuple[tuple[Any, tuple[Callable[[Any], object], ...]], ...] = (
    (Toss, (toss_of,)),
    (TossInformation, (information_of,)),
    (ModelParameters, (_theta,)),
    (Throw, (throw_of,)),
    (ThrowReport, (report_of, throw_made_of)),
    (CuratedBuffer, (selected_set_of,)),
    (TrainingStatus, (training_of,)),
)


def read_message(data: bytes) -> None:
    """The first byte chooses the type; the rest is a message of it, with its header of 4 bytes.

    Raises:
        InvalidValueError: the middleware or the door refuses it.
    """
    if len(data) < 5:
        return
    kind, readers = DOORS[data[0] % len(DOORS)]
    try:
        message = deserialize_message(data[1:], kind)
    except Exception as error:  # the middleware's own: such bytes never reach a node
        raise InvalidValueError("bytes", len(data), f"a message of {kind.__name__}") from error
    for read in readers:
        read(message)
    if kind is Toss:
        toss_of(toss_in(data[1:]))
