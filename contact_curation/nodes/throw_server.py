"""The action execute_throw: one goal at a time, whose outcome is reported once, on the executor's thread.

Goals are always taken, so that a refusal can say why: a refused one is aborted at once, with the reason in its result.
"""

from collections.abc import Callable
from typing import Any

from contact_curation_msgs.action import ExecuteThrow
from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.simulation.arm.frame import ArmFrame, Phase
from contact_curation.stages.arm import Ending

FRAMES_PER_FEEDBACK = 15

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


class ThrowServer:
    """Serves the action.

    Args:
        node: node that serves.
        admits: takes a goal's throw message, or says in one line why not; called on the executor's thread.
        taken: called on the executor's thread when a goal was taken.
        released: gives stamp and frame of a release, from the simulated time [s].
        warnings: warnings of throws that were not made.

    Attributes:
        goal: under way; None without.
        made: how many throws were made.
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
            "execute_throw",
            execute_callback=self._conclude,
            handle_accepted_callback=self._goal_came,
            cancel_callback=self._cancelled,
        )

    def tell(self, frame: ArmFrame) -> None:
        """Tells the goal's client of a frame, now and then."""
        self._frames += 1
        if self.goal is not None and (frame.phase is not self._told_phase or self._frames % FRAMES_PER_FEEDBACK == 0):
            self._told_phase = frame.phase
            self._feedback(PHASES[frame.phase], frame.progress)

    def conclude(self, goal: Any, ending: Ending | None) -> None:
        """Ends a goal, if this is an ending; hands it to the executor, which answers the client."""
        if ending is None or goal is None:
            return
        if self.goal is goal:
            self.goal = None
        self.made += ending.success
        if not ending.success:
            self._warnings.note("no throw", f"{goal.request.throw_command.throw_id[:80]}: {ending.message}")
        goal.execute(lambda handle: self._conclude(handle, ending))

    def close(self) -> None:
        """Serves no more."""
        self._server.destroy()

    def _goal_came(self, handle: Any) -> None:
        """On the executor's thread: a goal is taken, or ends here."""
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
