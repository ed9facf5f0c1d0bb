"""The loop without a trainer, of real processes: design, the simulated arm, its camera, ingest, score, curate, design.

Slow: an arm whose heartbeat is starved stops, as it should, so that the machine has to be quiet.
"""

import math
from typing import Any

import pytest
from contact_curation_msgs.msg import ThrowReport
from std_srvs.srv import Trigger

from contact_curation.nodes.ros.qos import RESULTS_DEPTH
from contact_curation.stages.records import ThrowRecord
from test.cli.commands import write_parameters
from test.graph.parts.graph import Graph
from test.graph.parts.processes import NodeProcess
from test.graph.test_throw_designer import SMALL, made

pytestmark = pytest.mark.slow

LONG = 180.0
THROWS = 6
ARM: dict[str, Any] = {"rate": 0.0, "armed": True}


class Loop:
    """The graph's processes that a test kills, and what the designer tells.

    Args:
        graph: to start them in.
        throws: after which the designer ends.
    """

    def __init__(self, graph: Graph, throws: int) -> None:
        self.graph = graph
        self._theta = write_parameters(graph.folder / "true.json")
        self._throws = throws
        self.reports: list[ThrowReport] = graph.listener.listen(ThrowReport, "/throw_report", RESULTS_DEPTH)
        graph.start("pose_ingest")
        graph.start("fisher_scorer", params=self._theta)
        graph.start("curator", top=4)
        graph.start("sim_camera")
        self.arm = self.started_arm()
        self.designer = self.started_designer()

    def started_arm(self, **changed: Any) -> NodeProcess:
        state = self.graph.folder / "arm.json"
        self.arm = self.graph.start("sim_arm", label=f"arm{len(self.graph.processes)}", state=state, **{**ARM, **changed})
        return self.arm

    def started_designer(self) -> NodeProcess:
        settings = {
            **SMALL,
            "await_tracker": True,
            "params": self._theta,
            "readiness.enabled": False,
            "thrower": "arm",
            "toss_timeout": 20.0,
        }
        store, label = self.graph.folder / "throws.sqlite", f"designer{len(self.graph.processes)}"
        self.designer = self.graph.start(
            "throw_designer", label=label, store=store, auto=True, max_throws=self._throws, retry_period=0.3, **settings
        )
        return self.designer

    def entries(self) -> tuple[ThrowRecord, ...]:
        """Throws that were made."""
        return made(self.graph.folder)

    def last_reports(self) -> list[ThrowReport]:
        """The last one of each throw."""
        return list({report.throw_command.throw_id: report for report in self.reports}.values())

    def last_states(self) -> list[str]:
        """Of them."""
        return [str(report.state) for report in self.last_reports()]

    def until_made(self, throws: int) -> None:
        """Waits until so many throws were made and the last one's toss was scored."""
        self.graph.until(
            lambda: len(self.entries()) >= throws and self.entries()[-1].realised, LONG, f"{throws} throws and gains"
        )

    def until_under_way(self) -> str:
        """Waits for the next throw to be commanded; its name."""
        known = len(self.reports)
        self.graph.until(lambda: any(report.state == "commanded" for report in self.reports[known:]), LONG, "a throw under way")
        return str([report for report in self.reports[known:] if report.state == "commanded"][-1].throw_command.throw_id)


def test_each_throw_of_the_arm_gets_its_toss_and_a_gain_like_the_planned_one(graph: Graph) -> None:
    loop = Loop(graph, THROWS)
    loop.until_made(THROWS)
    entries = loop.entries()
    assert len({entry.toss_id for entry in entries}) == THROWS
    assert [entry.commanded.throw_id for entry in entries] == [f"cube-throw-{number}" for number in range(THROWS)]
    gains = [(entry.realised.planned, entry.realised.realised) for entry in entries if entry.realised]
    assert len(gains) == THROWS
    assert all(planned > 0.0 for planned, _ in gains)
    assert 0.3 < sum(realised for _, realised in gains) / sum(planned for planned, _ in gains) < 3.0, gains
    assert gains[-1][0] < 0.7 * gains[0][0]  # what is known is not gained again
    graph.until(lambda: loop.last_states() == ["scored"] * THROWS, LONG, "reports of all throws")
    assert not any(math.isnan(report.realised_gain) for report in loop.last_reports())


def test_a_designer_that_is_killed_in_mid_throw_goes_on_and_no_toss_is_given_to_two_throws(graph: Graph) -> None:
    loop = Loop(graph, 4)
    loop.until_made(1)
    lost = loop.until_under_way()
    loop.designer.kill()
    loop.started_designer()
    loop.until_made(4)
    entries = loop.entries()
    assert lost not in {entry.commanded.throw_id for entry in entries}
    tosses = [entry.toss_id for entry in entries]
    assert all(tosses)
    assert len(set(tosses)) == len(tosses)
    states = [report.state for report in loop.reports if report.throw_command.throw_id == lost]
    assert states[0] == "commanded"
    assert states[-1] == "not made"


def test_an_arm_that_is_killed_in_mid_throw_leaves_a_loop_that_goes_on_when_it_is_armed_again(graph: Graph) -> None:
    loop = Loop(graph, 4)
    loop.until_made(1)
    lost = loop.until_under_way()
    loop.arm.kill()
    graph.until(
        lambda: any(report.throw_command.throw_id == lost and report.state == "not made" for report in loop.reports),
        LONG,
        "the designer to give the throw up",
    )
    loop.started_arm(armed=False)
    graph.until(
        lambda: any("never armed" in report.detail for report in loop.reports), LONG, "a throw that a disarmed arm refuses"
    )
    assert graph.listener.call(Trigger, "/sim_arm/arm", Trigger.Request(), LONG).success
    loop.until_made(4)
    entries = loop.entries()
    assert lost not in {entry.commanded.throw_id for entry in entries}
    assert len({entry.toss_id for entry in entries}) == 4
    stamps = [entry.released_ns for entry in entries]
    assert stamps == sorted(stamps)
