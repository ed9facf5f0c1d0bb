"""Reports of throws: what cannot be is refused, and the wire keeps every bit."""

import math
from dataclasses import replace

import pytest
from contact_curation_msgs.msg import ThrowReport as ThrowReportMessage
from rclpy.serialization import deserialize_message, serialize_message

from contact_curation.design.throw import ThrowKind, ThrowReport, ThrowState, throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.nodes.messages.throw_report import report_message, report_of
from test.design.cases import releases

COMMANDED, EXECUTED = (throw_of_state("cube-throw-3", "cube", state, 4.5, "abc") for state in releases(2))
BEGUN = ThrowReport(ThrowKind.DESIGNED, ThrowState.COMMANDED, COMMANDED, planned=4.5)
MADE = replace(BEGUN, state=ThrowState.EXECUTED, executed=EXECUTED, released_ns=5_000_000_001)
REPORTS = (
    BEGUN,
    replace(BEGUN, kind=ThrowKind.EXPLORATION, planned=0.0, detail="tosses: found 0, expected at least 4"),
    replace(BEGUN, state=ThrowState.NOT_MADE, detail="joint 4 is too fast"),
    MADE,
    replace(MADE, state=ThrowState.SCORED, toss_id="cube-1"),
    replace(MADE, state=ThrowState.SCORED, toss_id="cube-1", realised=3.25),
)


@pytest.mark.parametrize("report", REPORTS)
def test_a_report_comes_back_from_the_wire_bit_for_bit(report: ThrowReport) -> None:
    message = report_message(report, "body_surface")
    heard: ThrowReportMessage = deserialize_message(serialize_message(message), ThrowReportMessage)
    assert heard.header.frame_id == heard.throw_command.header.frame_id == "body_surface"
    back = report_of(heard)
    assert back.commanded.to_mapping() == report.commanded.to_mapping()
    assert (back.executed is None) == (report.executed is None)
    if back.executed is not None and report.executed is not None:
        assert back.executed.to_mapping() == report.executed.to_mapping()
    for name in ("kind", "state", "released_ns", "toss_id", "planned", "detail"):
        assert getattr(back, name) == getattr(report, name), name
    assert back.realised == report.realised or (math.isnan(back.realised) and math.isnan(report.realised))


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"state": ThrowState.EXECUTED}, "found executed with no executed throw"),
        ({"executed": EXECUTED}, "found commanded with an executed throw"),
        ({"toss_id": "cube-1"}, "found commanded with toss 'cube-1'"),
        ({"state": ThrowState.SCORED, "executed": EXECUTED}, "found scored with toss ''"),
        ({"state": ThrowState.EXECUTED, "executed": replace(EXECUTED, throw_id="other")}, "found executed as other"),
    ],
)
def test_a_report_that_contradicts_itself_is_refused(changed: dict[str, object], why: str) -> None:
    with pytest.raises(InvalidValueError, match=f"report of throw cube-throw-3: {why}"):
        replace(BEGUN, **changed)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"state": "lost"}, "state of a throw's report: found 'lost', expected commanded, not made, executed, scored"),
        ({"kind": ""}, "kind of a throw's report: found '', expected designed, exploration"),
    ],
)
def test_words_of_a_message_that_are_not_known_are_refused(changed: dict[str, str], why: str) -> None:
    message = report_message(BEGUN, "body_surface")
    for name, value in changed.items():
        setattr(message, name, value)
    with pytest.raises(InvalidValueError, match=why):
        report_of(message)
