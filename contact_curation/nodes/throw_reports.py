"""Publishes `throw_report`: the state of each throw, again whenever it changes."""

from collections.abc import Iterable

from contact_curation_msgs.msg import ThrowReport as ThrowReportMessage
from rclpy.node import Node

from contact_curation.design.throw import ThrowReport
from contact_curation.nodes.messages.throw_report import report_message
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched


class ThrowReports:
    """Publishes reports of throws.

    Args:
        node: node that publishes.
        board_frame: board frame of the headers.
    """

    def __init__(self, node: Node, board_frame: str) -> None:
        self._publisher = node.create_publisher(ThrowReportMessage, "throw_report", latched(RESULTS_DEPTH))
        self._board_frame = board_frame
        self._told: dict[str, tuple[str, str, str]] = {}

    def tell(self, reports: Iterable[ThrowReport]) -> None:
        """Publishes the reports that have changed."""
        for report in reports:
            known = (report.state.value, repr(report.realised), report.detail)
            if self._told.get(report.commanded.throw_id) != known:
                self._told[report.commanded.throw_id] = known
                self._publisher.publish(report_message(report, self._board_frame))
