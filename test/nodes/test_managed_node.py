"""A managed node starts itself unless it shall not, refuses what its state does not have, and ends with the last transition."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from contact_curation.nodes.ros.managed_node import ManagedNode
from contact_curation.session.free_domain import free_domain


class Working(ManagedNode):
    """Counts how often its work was ended."""

    def __init__(self, breaks: bool = False) -> None:
        super().__init__("working")
        self.ended, self.breaks, self.at_end = 0, breaks, False
        self.when_ended(self.end_seen)
        self.start()

    def deactivated(self) -> None:
        assert not self.active
        if self.breaks:
            raise ZeroDivisionError("broken")
        self.ended += 1

    def end_seen(self) -> None:
        self.at_end = True

    def change(self, label: str = "", number: int = 0) -> bool:
        request = ChangeState.Request(transition=Transition(id=number, label=label))
        answer = self._service_change_state.callback(request, ChangeState.Response())
        return bool(answer.success)


@contextmanager
def working(*words: str, breaks: bool = False) -> Iterator[Working]:
    with free_domain() as domain:
        rclpy.init(args=["--ros-args", *words], domain_id=domain)
        try:
            node = Working(breaks)
            yield node
            node.destroy_node()
        finally:
            rclpy.try_shutdown()


def test_it_starts_itself_and_says_while_it_is_not_active_that_it_is_not() -> None:
    with working() as node:
        assert (node.state, node.inactive, node.ended) == ("active", "", 0)
        assert node.change("deactivate")
        assert (node.state, node.ended) == ("inactive", 1)
        assert node.inactive == "working: found it inactive, expected it active; ros2 lifecycle set activates it"
        assert node.change(number=Transition.TRANSITION_CLEANUP)
        assert node.change("configure")
        assert node.change(number=Transition.TRANSITION_ACTIVATE)
        assert (node.active, node.ended) == (True, 1)


def test_with_autostart_false_it_waits_for_somebody_who_activates_it() -> None:
    with working("-p", "autostart:=false") as node:
        assert node.state == "unconfigured"
        assert node.change("configure")
        assert not node.active
        assert node.change("activate")
        assert node.active


@pytest.mark.parametrize("asked", [{"label": "activate"}, {"number": Transition.TRANSITION_CONFIGURE}, {"label": "fly"}])
def test_a_transition_that_the_state_does_not_have_is_refused_and_changes_nothing(asked: dict[str, int]) -> None:
    with working() as node:
        assert not node.change(**asked)  # type: ignore[arg-type]
        assert (node.state, node.ended, node.failure) == ("active", 0, None)


def test_shutdown_ends_the_process() -> None:
    with working() as node:
        assert node.change("shutdown")
        assert (node.state, node.ended, node.at_end, node.failure) == ("finalized", 0, True, None)


def test_an_error_in_the_node_that_a_transition_meets_ends_the_process_and_is_not_dropped() -> None:
    with working(breaks=True) as node:
        assert not node.change("deactivate")
        assert not node.active
        assert node.at_end
        assert isinstance(node.failure, ZeroDivisionError)
