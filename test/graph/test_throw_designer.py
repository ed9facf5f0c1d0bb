"""The designer as a process: it proposes, has throws made one after the other, and goes on where it was killed."""

from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from action_msgs.msg import GoalStatus
from contact_curation_msgs.action import ExecuteThrow
from contact_curation_msgs.msg import ModelParameters, Throw, ThrowReport, TossRejected
from contact_curation_msgs.srv import ProposeThrow
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionServer, GoalResponse
from rclpy.task import Future
from std_msgs.msg import Header

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.design.predicted_information import Particle
from contact_curation.nodes import throw_goals
from contact_curation.nodes.messages.headers import time_message
from contact_curation.nodes.messages.throw import throw_of
from contact_curation.nodes.ros.health import key_of
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched
from contact_curation.nodes.throw_designer import MOST_PROPOSALS
from contact_curation.stages.records import ThrowLogRecord, ThrowRecord, load_record
from contact_curation.storage.stores.state import StateStore
from test.cli.commands import write_parameters
from test.graph.parts.graph import Graph, Listener
from test.graph.parts.instant_thrower import Thrower, settled

LONG = 90.0
SMALL: dict[str, Any] = {
    "design.pool": 24,
    "design.reference": 8,
    "refinement.generations": 2,
    "forecast.executions": 2,
    "safety.motions": 20,
    "safety.share": 0.1,
    "await_tracker": False,
}


def started(graph: Graph, **changed: Any) -> Any:
    parameters = {**SMALL, "store": graph.folder / "throws.sqlite", "retry_period": 0.3, **changed}
    return graph.start("throw_designer", label=f"designer{len(graph.processes)}", **parameters)


def turn_auto(graph: Graph, *, on: bool) -> None:
    request = SetParameters.Request(parameters=[Parameter(name="auto", value=ParameterValue(type=1, bool_value=on))])
    assert graph.listener.call(SetParameters, "/throw_designer/set_parameters", request).results[0].successful


def trusted(graph: Graph) -> dict[str, Any]:
    return {"params": write_parameters(graph.folder / "true.json"), "readiness.enabled": False}


def made(folder: Path) -> tuple[ThrowRecord, ...]:
    with StateStore(folder / "throws.sqlite") as states:
        return (load_record(states.load, ThrowLogRecord) or ThrowLogRecord()).made


def counted(heard: list[Any], kind: str) -> int:
    values = {pair.key: pair.value for array in list(heard) for status in array.status for pair in status.values}
    return int(values.get(key_of(kind), 0))


def reported(graph: Graph) -> list[Any]:
    return graph.listener.listen(ThrowReport, "/throw_report", RESULTS_DEPTH)


def test_a_throw_is_proposed_without_being_made_and_the_same_seed_proposes_it_again(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    started(graph, **trusted(graph))
    answers = [
        graph.listener.call(ProposeThrow, "propose_throw", ProposeThrow.Request(body="cube", seed=seed), LONG)
        for seed in (5, 5, 6)
    ]
    assert [answer.success for answer in answers] == [True] * 3, graph.logs()
    assert answers[0].throw_command == answers[1].throw_command != answers[2].throw_command
    throw = throw_of(answers[0].throw_command)
    assert throw.expected_information > 0.0
    described = ContactGeometry.of_body(CONTACTNETS_CUBE).rigid()
    assert throw.parameters_version == Particle(described, CONTACTNETS_CUBE).version
    other = graph.listener.call(ProposeThrow, "propose_throw", ProposeThrow.Request(body="brick"), LONG)
    assert not other.success
    assert other.message == "body: found brick, expected cube"
    assert not thrower.commands


def test_a_proposal_under_way_keeps_no_other_callback_waiting(graph: Graph) -> None:
    started(graph, **{**trusted(graph), "design.pool": 96})
    client = graph.listener.node.create_client(ProposeThrow, "propose_throw")
    assert client.wait_for_service(LONG)
    proposals = [client.call_async(ProposeThrow.Request(seed=seed)) for seed in range(MOST_PROPOSALS + 1)]
    graph.until(lambda: any(one.done() for one in proposals), LONG, "the refusal of one proposal too many")
    refused = [one.result() for one in proposals if one.done()]
    assert [one.message for one in refused] == ["proposals under way: found 8, expected fewer than 8: wait for an answer"]
    request = GetParameters.Request(names=["auto"])
    for _ in range(2):
        assert graph.listener.call(GetParameters, "/throw_designer/get_parameters", request, LONG).values[0].type == 1
    assert sum(one.done() for one in proposals) < len(proposals)
    graph.until(lambda: sum(one.done() for one in proposals) > 1, LONG, "a proposed throw")
    assert any(one.result().success for one in proposals if one.done())


@pytest.mark.slow
def test_without_a_theta_that_it_can_use_makes_exploration_throws(graph: Graph) -> None:
    publisher = graph.listener.node.create_publisher(ModelParameters, "/model_parameters", latched(1))
    publisher.publish(ModelParameters(body="cube", model="deep", safetensors=b"nothing"))
    heard = graph.diagnostics()
    started(graph)
    graph.until(lambda: counted(heard, "bad parameters") == 1, LONG, "a warning")
    request = ProposeThrow.Request(body="cube", seed=1)
    first = graph.listener.call(ProposeThrow, "propose_throw", request, LONG)
    assert first.success
    assert first.message == "exploration (parameters: found none, expected model_parameters)"
    assert first.throw_command.expected_information == 0.0


def test_in_auto_throws_are_made_one_after_the_other_each_when_the_last_ones_toss_was_scored(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    reports = reported(graph)
    started(graph, auto=True, max_throws=3, toss_timeout=LONG, **trusted(graph))
    graph.until(lambda: len(made(graph.folder)) == 3 and made(graph.folder)[-1].realised, LONG, "three throws and tosses")
    settled(1.0)
    entries = made(graph.folder)
    assert [entry.toss_id for entry in entries] == thrower.toss_ids
    assert len(thrower.commands) == 3
    realised = [entry.realised for entry in entries if entry.realised]
    ratios = [one.ratio for one in realised]
    assert all(0.3 < ratio < 3.0 for ratio in ratios), ratios
    assert realised[1].planned < realised[0].planned  # what is known is not gained again
    told = [(one.throw_command.throw_id, one.state) for one in reports]
    states = ("commanded", "executed", "scored")
    assert [pair for pair in told if pair[1] == "commanded"] == [(f"cube-throw-{k}", "commanded") for k in range(3)]
    for number, entry in enumerate(entries):
        own = [one for one in reports if one.throw_command.throw_id == f"cube-throw-{number}"]
        assert [one.state for one in own if one.state != "executed"] == [
            "commanded",
            "scored",
        ]  # both at once where it is quick
        assert {one.state for one in own} <= set(states)
        assert (own[-1].toss_id, own[-1].realised_gain) == (entry.toss_id, entry.realised_gain)
        assert own[-1].kind == "designed"
        assert own[-1].planned_gain == pytest.approx(entry.commanded.expected_information)  # predicted again
        assert own[-1].executed.throw_id == own[-1].throw_command.throw_id


@pytest.mark.slow
def test_a_throw_whose_motion_is_rejected_is_followed_by_the_next_at_once(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    thrower.silent.set()
    reports = reported(graph)
    publisher = graph.listener.node.create_publisher(TossRejected, "/toss_rejected", latched(RESULTS_DEPTH))
    started(graph, auto=True, max_throws=2, toss_timeout=10.0 * LONG, **trusted(graph))
    graph.until(lambda: len(made(graph.folder)) == 1, LONG, "a first throw")
    stamp = time_message(made(graph.folder)[0].released_ns)
    reasons = ["gap: found 0.2 s", "depth: found 9 mm"]
    publisher.publish(TossRejected(header=Header(stamp=stamp), toss_id="cube-1", body="cube", reasons=reasons))
    graph.until(lambda: len(made(graph.folder)) == 2, LONG, "a second throw")
    told = [one.detail for one in reports if one.throw_command.throw_id == "cube-throw-0" and one.state == "executed"]
    assert told[-1] == "rejected: gap: found 0.2 s; depth: found 9 mm"


@pytest.mark.slow
def test_no_throw_is_made_once_auto_is_off(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    reports = reported(graph)
    started(graph, auto=True, **{**trusted(graph), "design.pool": 192, "toss_timeout": LONG})
    graph.until(lambda: reports and reports[-1].state == "scored", LONG, "a throw whose toss was scored")
    settled(0.3)  # the next one is being designed
    turn_auto(graph, on=False)
    sent = len(thrower.commands)
    graph.until(lambda: reports[-1].detail == "auto was turned off", LONG, "the throw that was being designed")
    settled(1.0)
    assert len(thrower.commands) == sent


def test_a_goal_that_is_taken_when_it_was_given_up_is_cancelled(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes: list[throw_goals.Outcome] = []
    answer, handle = Future(), Mock(accepted=True)
    client = Mock(send_goal_async=Mock(return_value=answer))
    monkeypatch.setattr(throw_goals, "ActionClient", Mock(return_value=client))
    goals = throw_goals.ThrowGoals(graph.listener.node, outcomes.append, patience=0.01)
    goals.send(Throw())
    settled(0.02)
    goals.look()
    answer.set_result(handle)
    assert [one.message for one in outcomes] == ["no feedback or result for 0.01 s"]
    handle.cancel_goal_async.assert_called_once_with()
    assert not goals.busy


@pytest.mark.parametrize(
    ("status", "success", "message", "why"),
    [
        (GoalStatus.STATUS_ABORTED, False, "", "the thrower gave no reason"),
        (GoalStatus.STATUS_ABORTED, False, "too\n cold", "too cold"),
        (GoalStatus.STATUS_ABORTED, True, "done", "its result says success, but its goal was not succeeded (done)"),
        (GoalStatus.STATUS_SUCCEEDED, False, "9" * 9999, "9" * throw_goals.LONGEST_REASON),
    ],
)
def test_why_a_throw_was_not_made_is_one_line(
    graph: Graph, monkeypatch: pytest.MonkeyPatch, status: int, success: bool, message: str, why: str
) -> None:
    outcomes: list[throw_goals.Outcome] = []
    answer, ended = Future(), Future()
    monkeypatch.setattr(throw_goals, "ActionClient", Mock(return_value=Mock(send_goal_async=Mock(return_value=answer))))
    goals = throw_goals.ThrowGoals(graph.listener.node, outcomes.append, patience=LONG)
    goals.send(Throw())
    answer.set_result(Mock(accepted=True, get_result_async=Mock(return_value=ended)))
    ended.set_result(Mock(status=status, result=ExecuteThrow.Result(success=success, message=message)))
    assert outcomes == [throw_goals.Outcome(None, why)]


@pytest.mark.slow
def test_a_designer_that_can_plan_no_throw_says_so_at_level_warn(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    heard = graph.diagnostics()
    started(graph, auto=True, **{**trusted(graph), "safety.largest_speed": 0.01})

    def warned() -> bool:
        statuses = [status for array in list(heard) for status in array.status]
        wanted = "0 throws made, the next one cannot be planned: safe releases: found 0 of "
        return any(one.level == DiagnosticStatus.WARN and one.message.startswith(wanted) for one in statuses)

    graph.until(warned, LONG, "a warning")
    assert not thrower.commands


def test_beside_a_second_thrower_no_throw_is_commanded(graph: Graph) -> None:
    thrower, second = Thrower(graph.listener), Listener(graph.domain)
    reject = Mock(return_value=GoalResponse.REJECT)
    server = ActionServer(second.node, ExecuteThrow, "execute_throw", Mock(), goal_callback=reject)
    heard = graph.diagnostics()
    started(graph, max_throws=1, **trusted(graph))
    graph.until(lambda: heard, LONG, "the designer")
    settled(1.0)  # it has discovered both, which it may not do at once
    turn_auto(graph, on=True)
    why = "0 throws made, waiting for a single thrower: found 2 servers of /execute_throw, which would all throw"
    graph.until(lambda: any(one.message == why for array in list(heard) for one in array.status), LONG, "a warning")
    settled(1.0)
    assert not thrower.commands
    assert not reject.called
    second.close()
    server.destroy()
    graph.until(lambda: len(made(graph.folder)) == 1, LONG, "a throw")


def test_the_action_is_remapped_on_both_sides(graph: Graph) -> None:
    renamed = {"execute_throw": "/robot/throw"}
    reports = graph.listener.listen(ThrowReport, "/throw_report")
    graph.start("sim_arm", renamed, state=graph.folder / "arm.json", rate=0.0, armed=True)
    store = graph.folder / "throws.sqlite"
    graph.start("throw_designer", renamed, **SMALL, store=store, auto=True)
    graph.until(lambda: any(one.state == ThrowReport.EXECUTED for one in reports), LONG, "a throw")
    node = graph.listener.node  # which may discover the arm later than the designer does
    graph.until(lambda: node.count_services("/robot/throw/_action/send_goal") == 1, LONG, "the arm's action by its new name")
    assert node.count_services("/execute_throw/_action/send_goal") == 0


def test_a_throw_whose_toss_does_not_come_is_told_and_followed_by_the_next(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    thrower.silent.set()
    designer = started(graph, auto=True, max_throws=2, toss_timeout=0.5, **trusted(graph))
    graph.until(lambda: len(made(graph.folder)) == 2, LONG, "two throws")
    line = "no toss: cube-throw-0: found no toss or rejected motion after its release, expected one within 0.5 s"
    assert designer.log().count(line) == 1


@pytest.mark.slow
def test_a_designer_that_is_killed_goes_on_with_the_throws_it_had(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    thrower.silent.set()  # so that it waits for a toss
    designer = started(graph, auto=True, max_throws=2, toss_timeout=LONG, **trusted(graph))
    graph.until(lambda: len(made(graph.folder)) == 1, LONG, "a first throw")
    designer.kill()
    reports = reported(graph)
    thrower.silent.clear()
    started(graph, auto=True, max_throws=2, toss_timeout=0.5, **trusted(graph))
    graph.until(lambda: len(made(graph.folder)) == 2, LONG, "a second throw")
    names = [entry.commanded.throw_id for entry in made(graph.folder)]
    assert names == ["cube-throw-0", "cube-throw-1"]
    graph.until(lambda: reports[-1:] and reports[-1].toss_id, LONG, "the report of the second throw")
    assert (reports[0].throw_command.throw_id, reports[0].state) == ("cube-throw-0", "executed")  # told by who came back


@pytest.mark.slow
def test_a_thrower_that_refuses_is_asked_again_after_a_pause_and_the_loop_goes_on_when_it_takes_throws(graph: Graph) -> None:
    thrower = Thrower(graph.listener)
    thrower.refuse = True
    started(graph, auto=True, max_throws=1, **trusted(graph))
    heard, reports = graph.diagnostics(), reported(graph)
    graph.until(lambda: counted(heard, "throw not made") >= 2, LONG, "two refusals")
    assert not thrower.commands
    told = [(one.throw_command.throw_id, one.state, one.detail) for one in reports]
    assert told[:3] == [
        ("cube-throw-0", "commanded", ""),
        ("cube-throw-0", "not made", "the thrower rejected the goal"),
        ("cube-throw-1", "commanded", ""),
    ]
    thrower.refuse = False
    graph.until(lambda: len(made(graph.folder)) == 1, LONG, "a throw")


def test_settings_that_no_stage_accepts_are_one_line(graph: Graph) -> None:
    designer = started(graph, **{"forecast.executions": 3})
    assert designer.wait(30.0) == 1
    assert "throw_designer: forecast.executions: found 3, expected an even number of at least 2" in designer.log()
    assert "Traceback" not in designer.log()
