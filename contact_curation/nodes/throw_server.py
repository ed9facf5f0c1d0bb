"""Serves the action execute_throw: one goal at a time, whose outcome is reported once, on the executor's thread.

Every goal is accepted, because only a result can carry a reason: a refused goal is aborted at once, with the reason.
"""

import threading
from collections.abc import Callable
from typing import Any

from contact_curation_msgs.action import ExecuteThrow
from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node
from std_srvs.srv import Trigger

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.ros.managed_node import ManagedNode
from contact_curation.nodes.ros.own_namespace import action_name
from contact_curation.nodes.ros.parameters import declare
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.simulation.arm.frame import ArmFrame, Phase
from contact_curation.simulation.arm.safety import SafetyGate
from contact_curation.stages.arm import Ending

FRAMES_PER_FEEDBACK = 15

OLDEST_GOAL = 60.0
"""Default age at which a goal is stale [s]; throw_designer gives goals up after the same time."""

PHASES = {
    Phase.MOVING: ExecuteThrow.Feedback.MOVING,
    Phase.THROWING: ExecuteThrow.Feedback.THROWING,
    Phase.RELEASED: ExecuteThrow.Feedback.RELEASED,
    Phase.RESTING: ExecuteThrow.Feedback.RELEASED,
    Phase.RETURNING: ExecuteThrow.Feedback.RELEASED,
    Phase.STOPPING: ExecuteThrow.Feedback.STOPPED,
    Phase.STOPPED: ExecuteThrow.Feedback.STOPPED,
}
"""Names of the phases in the feedback."""


def declared_oldest_goal(node: Node) -> float:
    """Declares the age from which on goals are stale [s]."""
    about = "goals whose stamp is further from now are refused as stale [s]; 0: no goal is"
    return float(declare(node, "oldest_goal", OLDEST_GOAL, about, bounds=(0.0, 3600.0)))


class GatedArm(ManagedNode):
    """A node with an arm behind a safety gate, which the services `~/arm` and `~/stop` arm and stop."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._wake = threading.Event()
        """Set when the thread that moves the arm has something to do."""

    def serve_gate(self, gate: SafetyGate, now: Callable[[], float]) -> None:
        """Offers the services.

        Args:
            gate: that every command passes.
            now: its time [s].
        """
        self._gate, self._gate_time = gate, now
        self.create_service(Trigger, "~/arm", self._arm)
        self.create_service(Trigger, "~/stop", self._stop)

    def deactivated(self) -> None:
        """Stops the arm, until it is active and armed again."""
        self._gate.stop("the node was deactivated")
        self._wake.set()

    def _arm(self, _: Any, response: Any) -> Any:
        refusal = self.inactive
        response.success = not refusal
        response.message = refusal or f"armed (arming number {self._gate.arm(self._gate_time())})"
        self._wake.set()
        return response

    def _stop(self, _: Any, response: Any) -> Any:
        self._gate.stop("the stop service was called")
        self._wake.set()
        response.success, response.message = True, "stopped until it is armed again"
        return response


class ThrowServer:
    """Serves the action.

    Args:
        node: node that serves.
        admits: takes a goal's throw message, or returns in one line why it is refused; called on the executor's thread.
        taken: called on the executor's thread when a goal was taken.
        released: returns stamp and frame of a release from the simulated time [s].
        warnings: counts throws that were not made.

    Attributes:
        goal: goal that is under way; None if there is none.
        made: number of throws that were made.
    """

    def __init__(
        self,
        node: Node,
        admits: Callable[[Any], str | None],
        taken: Callable[[], None],
        released: Callable[[float], Stamped],
        warnings: ThrottledWarnings,
    ) -> None:
        self._admits, self._taken, self._released, self._warnings = admits, taken, released, warnings
        self.goal: Any = None
        self.made = 0
        self._told_phase, self._frames = Phase.RESTING, 0
        self._server = ActionServer(
            node,
            ExecuteThrow,
            action_name(node, "execute_throw"),
            execute_callback=self._conclude,
            handle_accepted_callback=self._goal_came,
            cancel_callback=self._cancelled,
        )

    def tell(self, frame: ArmFrame) -> None:
        """Sends feedback to the goal's client at some of the frames."""
        self._frames += 1
        if self.goal is not None and (frame.phase is not self._told_phase or self._frames % FRAMES_PER_FEEDBACK == 0):
            self._told_phase = frame.phase
            self._feedback(PHASES[frame.phase], frame.progress)

    def report(self, phase: str) -> None:
        """Sends a phase to the goal's client."""
        self._feedback(phase, 0.0)

    def conclude(self, goal: Any, ending: Ending | None) -> None:
        """Ends a goal if `ending` is given: passes it to the executor, which sends the result to the client."""
        if ending is None or goal is None:
            return
        if self.goal is goal:
            self.goal = None
        self.made += ending.success
        if not ending.success:
            self._warnings.note("no throw", f"{goal.request.throw_command.throw_id[:80]}: {ending.message}", dropped=False)
        goal.execute(lambda handle: self._conclude(handle, ending))

    def close(self) -> None:
        """Stops serving the action."""
        self._server.destroy()

    def _goal_came(self, handle: Any) -> None:
        """Takes a goal or ends it as refused; on the executor's thread."""
        try:
            refusal = self._admits(handle.request.throw_command)
        except InvalidValueError as error:
            refusal = str(error)
        if refusal is not None:
            self.conclude(handle, Ending(False, refusal))
            return
        self.goal = handle
        self._feedback(ExecuteThrow.Feedback.PLANNING, 0.0)
        self._taken()

    def _cancelled(self, handle: Any) -> CancelResponse:
        return CancelResponse.ACCEPT if handle is self.goal else CancelResponse.REJECT

    def _feedback(self, phase: str, progress: float) -> None:
        handle = self.goal
        if handle is not None:
            handle.publish_feedback(ExecuteThrow.Feedback(phase=phase, progress=progress))

    def _conclude(self, handle: Any, ending: Ending | None = None) -> Any:
        result = ExecuteThrow.Result()
        if ending is None:
            handle.abort()
            return result
        result.success, result.message = ending.success, ending.message
        if ending.executed is not None:
            result.executed = throw_message(ending.executed, self._released(ending.released_at))
        if ending.success:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return result
