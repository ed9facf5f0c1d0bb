"""An arm that is not active takes no goal and is not armed; activation moves nothing, and arms only where `armed` is set."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import rclpy
from std_srvs.srv import Trigger

from contact_curation.errors import UnreadableInputError
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.sim_arm import SimArm
from contact_curation.nodes.trajectory_thrower import TrajectoryThrower
from contact_curation.session.free_domain import free_domain
from contact_curation.stages.arm import Ending
from contact_curation.stages.records import GripperRecord, read_record
from contact_curation.stages.trajectory_throw import Step
from test.simulation.throws import PLAIN

pytestmark = pytest.mark.slow

UR5E = Path(__file__).resolve().parents[1] / "foreign_arm" / "ur5e.yaml"
GOAL = throw_message(PLAIN, Stamped(0, "body_surface"))
ARMS: dict[type[Any], tuple[str, ...]] = {SimArm: (), TrajectoryThrower: (f"arm:={UR5E}",)}


@contextmanager
def arm(kind: type[Any], *words: str) -> Iterator[Any]:
    """An arm's node that nobody spins."""
    given = [word for setting in (*ARMS[kind], *words) for word in ("-p", setting)]
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", *given], domain_id=domain)
        try:
            node = kind()
            yield node
            node.close()
            node.destroy_node()
        finally:
            rclpy.try_shutdown()


def armed(node: Any) -> tuple[bool, str]:
    answer = node._arm(None, Trigger.Response())
    return answer.success, answer.message


@pytest.mark.parametrize("kind", ARMS)
def test_goals_and_arming_are_refused_in_one_line_unless_the_node_is_active_and_a_deactivation_latches(
    kind: type[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with arm(kind, "autostart:=false") as node:
        line = f"{node.get_name()}: found it unconfigured, expected it active; ros2 lifecycle set activates it"
        assert (armed(node), node._admits(GOAL)) == ((False, line), line)
        assert node._health().message == line
        node.trigger_configure()
        node.trigger_activate()
        assert node._gate.reason == "it was never armed"
        assert armed(node) == (True, "armed (arming number 1)")
        node.trigger_deactivate()
        assert node._gate.reason == "the node was deactivated"
        assert "found it inactive" in node._admits(GOAL)
        assert not armed(node)[0]
        node.trigger_activate()
        assert node._gate.reason == "the node was deactivated"
        assert armed(node) == (True, "armed (arming number 2)")


def test_the_way_home_is_refused_and_what_is_missing_says_that_the_node_is_not_active(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with arm(TrajectoryThrower, "autostart:=false") as node:
        home, missing = node._home(None, Trigger.Response()), node._check(None, Trigger.Response())
        assert not home.success
        assert home.message == node.inactive
        assert missing.message.startswith(node.inactive)


def test_a_throw_ends_though_what_was_learned_cannot_be_written_and_that_is_written_after_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with arm(TrajectoryThrower) as node:
        (tmp_path / "gripper.json").mkdir()
        goal = Mock()
        assert node._done(goal, Step(ending=Ending(True, "thrown")))
        goal.execute.assert_called_once()
        assert node._warnings.counts == {"state not written": 1}
        (tmp_path / "gripper.json").rmdir()
        assert node._done(goal, Step(ending=Ending(True, "thrown")))
        assert read_record(tmp_path / "gripper.json", GripperRecord) == node._stage.record


def test_two_throwers_do_not_learn_their_grippers_into_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with arm(TrajectoryThrower):
        release = "gripper.json: is written by another process, expected one that nobody writes: give each node a file"
        with pytest.raises(UnreadableInputError, match=release):
            TrajectoryThrower()
    with arm(TrajectoryThrower) as again:
        assert again._recorded is None


def test_an_arm_that_arms_itself_does_so_at_its_first_activation_and_not_after_it_was_deactivated() -> None:
    with arm(SimArm, "autostart:=false", "armed:=true") as node:
        node._beat()
        assert node._gate.arming == 0
        node.trigger_configure()
        node.trigger_activate()
        node._beat()
        assert node._gate.arming == 1
        node.trigger_deactivate()
        node.trigger_activate()
        node._beat()
        assert node._gate.arming == 0
    with arm(SimArm, "armed:=true") as node:
        assert node._gate.arming == 1


def test_an_arm_that_arms_itself_does_so_again_when_its_own_heartbeat_comes_back_and_never_after_a_stop() -> None:
    with arm(SimArm, "armed:=true") as node:
        gate = node._gate
        gate.watch(node._awake.now() + 10.0)
        assert gate.reason.startswith("no heartbeat for")
        before = node._awake.now()
        node._beat()
        gate.watch(before)
        assert gate.reason == ""
        node._stop(None, Trigger.Response())
        node._beat()
        assert gate.reason == "the stop service was called"
    with arm(SimArm, "armed:=true", "external_heartbeat:=true") as node:
        node._beat()
        node._gate.watch(node._awake.now() + 10.0)
        node._beat()  # somebody else's heartbeat arms once only
        assert node._gate.reason.startswith("no heartbeat for")
