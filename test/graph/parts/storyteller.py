"""Says what a trainer and a throw designer would say, where none of them runs."""

from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import ThrowReport, TrainingStatus

from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched
from test.dashboard.sessions import throw_of
from test.graph.parts.graph import Graph
from test.graph.parts.offline import tosses_of

FRAME = "body_surface"


def stamped(seconds: float) -> Any:
    return header_message(Stamped(int(seconds * 1e9), FRAME))


class Storyteller:
    """Publishes on latched topics; keep it as long as late listeners are to hear it.

    Args:
        graph: whose listener speaks.
        bag: whose tosses the throws are those of.
    """

    def __init__(self, graph: Graph, bag: Path) -> None:
        node = graph.listener.node
        self._tosses = tosses_of(bag)
        self._statuses = node.create_publisher(TrainingStatus, "/training_status", latched(64))
        self._reports = node.create_publisher(ThrowReport, "/throw_report", latched(RESULTS_DEPTH))

    def tell(self, round_number: int = 1) -> None:
        """A round of training, a throw that was scored, and one that is under way."""
        self._statuses.publish(
            TrainingStatus(
                header=stamped(1_600_000_010.0 + round_number),
                state="training",
                gradient_steps=100 * round_number,
                training_loss=0.1 / round_number,
                held_out_loss=0.2 / round_number,
                position_error=15.0 + 10.0 / round_number,
                rotation_error=20.0 + 15.0 / round_number,
            )
        )
        self._report(round_number, "scored", 2.5 / round_number)
        self._report(round_number + 1, "commanded", float("nan"))

    def _report(self, number: int, state: str, realised: float) -> None:
        command = throw_message(throw_of(self._tosses[number], f"throw-{number}"), Stamped(0, FRAME))
        report = ThrowReport(kind="designed", state=state, throw_command=command)
        report.planned_gain, report.realised_gain = 3.0 / number, realised
        self._reports.publish(report)
