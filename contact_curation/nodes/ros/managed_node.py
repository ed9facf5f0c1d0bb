"""A node with ROS 2's lifecycle: it works only while it is active. By default it configures and activates itself at its start.

    unconfigured -configure-> inactive -activate-> active -deactivate-> inactive -cleanup-> unconfigured

Everything but the work is there in every state: parameters, stores, services, diagnostics. Parameters are read when the process
starts, so `configure` and `cleanup` change nothing but the state. `shutdown` ends the process with status 0.
"""

from typing import Any

from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from contact_curation.nodes.ros.node_main import StageNode
from contact_curation.nodes.ros.parameters import declare

ACTIVE = "active"


class ManagedNode(LifecycleNodeMixin, StageNode):
    """A node that can be deactivated and activated again."""

    def __init__(self, name: str) -> None:
        StageNode.__init__(self, name)
        LifecycleNodeMixin.__init__(self)
        about = "configure and activate at the start; false: a lifecycle manager does so"
        self._starts_itself = declare(self, "autostart", True, about)
        self._checked(self._service_change_state)

    @property
    def state(self) -> str:
        """Name of the lifecycle's state."""
        return str(self._state_machine.current_state[1])

    @property
    def active(self) -> bool:
        """Whether the node does its work."""
        return self.state == ACTIVE

    @property
    def inactive(self) -> str:
        """In one line that the node is not active; empty if it is."""
        if self.active:
            return ""
        return f"{self.get_name()}: found it {self.state}, expected it active; ros2 lifecycle set activates it"

    def start(self) -> None:
        """Configures and activates the node, unless `autostart` is false; called once, when the node can work."""
        if self._starts_itself:
            self.trigger_configure()
            self.trigger_activate()

    def deactivated(self) -> None:
        """Ends the node's work; called when an active node is deactivated. At its end a node is closed instead."""

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As rclpy asks for it: ends the work. rclpy would drop an exception, so it is passed on and ends the node."""
        try:
            self.deactivated()
        except BaseException as error:  # noqa: BLE001  (passed on to the main thread, never ignored)
            self.fail(error)
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As rclpy asks for it: ends the process as a signal does."""
        self.end()
        return TransitionCallbackReturn.SUCCESS

    def _checked(self, service: Any) -> None:
        """Makes the service refuse a transition that the state does not have; rclpy would raise, which ends the process."""
        change = service.callback

        def changed(request: Any, response: Any) -> Any:
            possible = {label: number for number, label, *_ in self._state_machine.available_transitions}
            asked = request.transition
            if asked.label in possible or (not asked.label and asked.id in possible.values()):
                return change(request, response)
            found, expected = asked.label or f"number {asked.id}", ", ".join(possible)
            self.get_logger().warning(f"transition: found {found} while {self.state}, expected one of {expected}")
            response.success = False
            return response

        service.callback = changed
