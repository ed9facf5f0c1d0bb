"""Translates reports of throws."""

from enum import StrEnum
from typing import Any

from contact_curation_msgs.msg import Throw as ThrowMessage
from contact_curation_msgs.msg import ThrowReport as ThrowReportMessage

from contact_curation.design.throw import ThrowKind, ThrowReport, ThrowState
from contact_curation.errors import InvalidValueError
from contact_curation.nodes.messages.headers import Stamped, check_format, header_message, nanoseconds_of
from contact_curation.nodes.messages.throw import throw_message, throw_of


def report_message(report: ThrowReport, board_frame: str) -> ThrowReportMessage:
    """Makes the message of a throw's report; the header's stamp is the time of the release, 0 before the release."""
    released = Stamped(report.released_ns, board_frame)
    return ThrowReportMessage(
        format_version=ThrowReportMessage.FORMAT_VERSION,
        header=header_message(released),
        kind=report.kind.value,
        state=report.state.value,
        throw_command=throw_message(report.commanded, Stamped(0, board_frame)),
        executed=ThrowMessage() if report.executed is None else throw_message(report.executed, released),
        toss_id=report.toss_id,
        planned_gain=report.planned,
        realised_gain=report.realised,
        detail=report.detail,
    )


def report_of(message: Any) -> ThrowReport:
    """Reads the report of a message, with the same bits.

    Raises:
        InvalidValueError: the format is newer, or the report is invalid.
    """
    check_format(message)
    return ThrowReport(
        kind=_one_of(ThrowKind, "kind", message.kind),
        state=_one_of(ThrowState, "state", message.state),
        commanded=throw_of(message.throw_command),
        executed=throw_of(message.executed) if message.executed.throw_id else None,
        released_ns=nanoseconds_of(message.header.stamp),
        toss_id=message.toss_id,
        planned=float(message.planned_gain),
        realised=float(message.realised_gain),
        detail=message.detail,
    )


def _one_of[Word: StrEnum](words: type[Word], name: str, found: str) -> Word:
    if found not in set(words):
        raise InvalidValueError(f"{name} of a throw's report", repr(found)[:40], ", ".join(words))
    return words(found)
