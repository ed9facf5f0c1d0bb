"""sim_arm: the simulated world with an arm that throws. Goals in; joints, the body's true motion and executed throws out.

Goals are always taken, so that a refusal can say why: a refused one is aborted at once, with the limit and the nearest feasible
throw in its result. The arm begins disarmed. Whoever arms it (`~/arm`) can stop it (`~/stop`), and it stops by itself when the
heartbeat fails; either latches until it is armed again.
"""

import sys
import threading
from pathlib import Path
from typing import Any

from contact_curation_msgs.action import ExecuteThrow
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionServer, CancelResponse
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.arm_frame import joint_state_message, truth_message
from contact_curation.nodes.messages.headers import Stamped, time_message
from contact_curation.nodes.messages.throw import throw_message, throw_of
from contact_curation.nodes.ros.awake_clock import AwakeClock
from contact_curation.nodes.ros.body_parameter import declared_body
from contact_curation.nodes.ros.health import Health, HealthReport
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import profile
from contact_curation.nodes.ros.simulated_time import SimulatedTime
from contact_curation.nodes.ros.throttled_warnings import Complaints
from contact_curation.nodes.ros.worker import Worker
from contact_curation.simulation.arm.feasibility import ArmFeasibility
from contact_curation.simulation.arm.frame import ArmFrame, Phase
from contact_curation.simulation.arm.model import ArmConfig
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.simulation.arm.simulation import ControlConfig
from contact_curation.simulation.arm.throw_motion import ThrowPlanner
from contact_curation.stages.arm import ArmStage, Ending

TRUTH_KEPT = 2000
"""Frames that a slow listener may lag behind."""

FRAMES_PER_FEEDBACK = 15
BEAT = 0.1
"""Between the node's own heartbeats, of the thread that would hear a stop [s]."""

BREATH = 1e-3
"""Given to the other threads after a frame that nothing waits for, or the heartbeat would starve [s]."""

IDLE = 0.05
"""Between looks for a goal where simulated time stands still [s]."""

COUNTED = 0.1
"""Of the time between two looks of the watchdog so much counts at most [s]: a process that stood still moved nothing."""

LAG = 0.5
"""A simulation that is later than this does not try to catch up [s]."""

PHASES = {
    Phase.MOVING: ExecuteThrow.Feedback.MOVING,
    Phase.THROWING: ExecuteThrow.Feedback.THROWING,
    Phase.RELEASED: ExecuteThrow.Feedback.RELEASED,
    Phase.RESTING: ExecuteThrow.Feedback.RELEASED,
    Phase.RETURNING: ExecuteThrow.Feedback.RELEASED,
    Phase.STOPPING: ExecuteThrow.Feedback.STOPPED,
    Phase.STOPPED: ExecuteThrow.Feedback.STOPPED,
}
"""The phases as feedback names them."""


class SimArm(StageNode):
    """Throws one body, goal after goal."""

    def __init__(self) -> None:
        super().__init__("sim_arm")
        self._body = declared_body(self)
        about_rate = "simulated seconds a second; 0: as fast as possible"
        self._rate = declare(self, "rate", 1.0, about_rate, bounds=(0.0, 1e3), fixed=False)
        self._clock_hertz = declare(self, "clock", 0.0, "rate of /clock in simulated time [Hz]; 0: none", bounds=(0.0, 148.0))
        self._board_frame = declare(self, "board_frame", "body_surface", "frame of the board")
        epoch = declare(self, "epoch", 0.0, "time at which the simulation begins [s]; 0: now", bounds=(0.0, 4e9))
        about_state = "file that remembers how far time got, so that it never goes back after a restart; empty: none"
        state = declare(self, "state", "", about_state)
        self._arm_first = declare(self, "armed", False, "be armed with the first heartbeat, without a call of ~/arm")
        outside = declare(self, "external_heartbeat", False, "beat on topic ~/heartbeat (std_msgs/Empty), not the node itself")
        seed = declare(self, "seed", 0, "of the gripper's delays", bounds=(0, 2**31))
        arm, control = declare_config(self, ArmConfig(), "arm."), declare_config(self, ControlConfig(), "control.")
        limits = declare_config(self, GateConfig(keep_out_place=(arm.base[0], arm.base[1])), "gate.")
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._awake = AwakeClock(self._now, COUNTED)
        epoch_ns = round(epoch * NANOSECONDS) or self.get_clock().now().nanoseconds
        self._simulated = SimulatedTime(Path(state) if state else None, epoch_ns)
        self._gate = SafetyGate(limits)
        self._stage = ArmStage(ArmFeasibility(ThrowPlanner(self._body, arm), limits), self._gate, control, seed)
        self._complaints = Complaints(self)
        self._goal: Any = None
        self._ended = False
        self._thrown, self._told_phase, self._frames = 0, Phase.RESTING, 0
        self._time: Any = None
        self._wake = threading.Event()
        self._paced: tuple[float, float] | None = None
        self._publish()
        if outside:
            self.create_subscription(Empty, "~/heartbeat", lambda _: self._beat(), profile(1, reliable=True, latched=False))
        else:
            self.create_timer(BEAT, self._beat, clock=self._steady)
        self._worker = Worker(self.fail)
        self._worker.do(self._work)
        self.add_on_set_parameters_callback(self._parameters_set)
        HealthReport(self, self._health)

    def close(self) -> None:
        self._ended = True
        self._wake.set()
        self._worker.stop()
        self._simulated.close()
        self._server.destroy()

    def _publish(self) -> None:
        often = profile(50, reliable=True, latched=False)
        self._joints = self.create_publisher(JointState, "/joint_states", often)
        self._truth = self.create_publisher(Odometry, "ground_truth", profile(TRUTH_KEPT, reliable=True, latched=False))
        if self._clock_hertz:
            self._time = self.create_publisher(ClockMessage, "/clock", profile(1, reliable=True, latched=False))
        self.create_service(Trigger, "~/stop", self._stop)
        self.create_service(Trigger, "~/arm", self._arm)
        self._server = ActionServer(
            self,
            ExecuteThrow,
            "execute_throw",
            execute_callback=self._conclude,
            handle_accepted_callback=self._goal_came,
            cancel_callback=self._cancelled,
        )

    def _parameters_set(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "rate":
                self._rate, self._paced = parameter.value, None
        self._wake.set()
        return SetParametersResult(successful=True)

    def _beat(self) -> None:
        self._gate.heartbeat(self._awake.now())
        if self._arm_first:
            self._arm_first = False
            self._gate.arm(self._awake.now())

    def _stop(self, _: Any, response: Any) -> Any:
        self._gate.stop("the stop service was called")
        self._wake.set()
        response.success, response.message = True, "stopped until it is armed again"
        return response

    def _arm(self, _: Any, response: Any) -> Any:
        number = self._gate.arm(self._awake.now())
        self._wake.set()
        response.success, response.message = True, f"armed, for the {number}. time"
        return response

    def _goal_came(self, handle: Any) -> None:
        """On the executor's thread: a goal is taken, or ends here."""
        try:
            refusal = self._stage.admits(throw_of(handle.request.throw_command), self._awake.now())
        except InvalidValueError as error:
            refusal = str(error)
        if refusal is not None:
            self._finish(handle, Ending(False, refusal))
            return
        self._goal = handle
        self._feedback(ExecuteThrow.Feedback.PLANNING, 0.0)
        self._wake.set()

    def _cancelled(self, handle: Any) -> CancelResponse:
        return CancelResponse.ACCEPT if handle is self._goal else CancelResponse.REJECT

    def _work(self) -> None:
        """On the worker's thread, until the node ends: frame after frame."""
        while not self._ended:
            now = self._awake.tick()
            goal = self._goal  # whose ending this is, whichever goal comes meanwhile
            if goal is not None and self._stage.waits:
                self._conclude_if(goal, self._stage.begin())
                continue
            if self._rate == 0.0 and not self._stage.busy and not self._out_of_date():
                self._tell_time(self._stage.frame())
                self._wake.wait(IDLE)
                self._wake.clear()
                continue
            if goal is not None and goal.is_cancel_requested:
                self._stage.cancel()
            frame, ending = self._stage.advance(now)
            self._tell(frame)
            self._conclude_if(goal, ending)
            self._keep_pace(frame.time)

    def _out_of_date(self) -> bool:
        """Whether the arm stands still and the gate wants it otherwise, or the other way round."""
        return (self._stage.phase is Phase.STOPPED) == bool(self._gate.arming)

    def _tell(self, frame: ArmFrame) -> None:
        self._frames += 1
        stamped = Stamped(self._simulated.stamp_ns(frame.time), self._board_frame)
        self._joints.publish(joint_state_message(frame, stamped.stamp_ns))
        self._truth.publish(truth_message(frame, stamped, self._body.name))
        self._tell_time(frame)
        if self._goal is not None and (frame.phase is not self._told_phase or self._frames % FRAMES_PER_FEEDBACK == 0):
            self._told_phase = frame.phase
            self._feedback(PHASES[frame.phase], frame.progress)

    def _tell_time(self, frame: ArmFrame) -> None:
        if self._time is not None and self._frames % max(round(148.0 / self._clock_hertz), 1) == 0:
            self._time.publish(ClockMessage(clock=time_message(self._simulated.stamp_ns(frame.time))))

    def _feedback(self, phase: str, progress: float) -> None:
        handle = self._goal
        if handle is not None:
            handle.publish_feedback(ExecuteThrow.Feedback(phase=phase, progress=progress))

    def _keep_pace(self, time: float) -> None:
        """Waits until a frame's time has come."""
        rate, paced, now = self._rate, self._paced, self._now()
        if rate == 0.0:
            self._wake.wait(BREATH)
            return
        began, simulated = paced or (now, time)
        ahead = began + (time - simulated) / rate - now
        if ahead < -LAG or paced is None:
            self._paced = (now, time)
        elif ahead > 0.0:
            self._wake.wait(ahead)
            self._wake.clear()

    def _conclude_if(self, goal: Any, ending: Ending | None) -> None:
        if ending is not None and goal is not None:
            if self._goal is goal:
                self._goal = None
            self._finish(goal, ending)

    def _finish(self, handle: Any, ending: Ending) -> None:
        """Hands an ending to the executor, which answers the client."""
        self._thrown += ending.success
        if not ending.success:
            self._complaints.note("no throw", f"{handle.request.throw_command.throw_id[:80]}: {ending.message}")
        handle.execute(lambda goal: self._conclude(goal, ending))

    def _conclude(self, handle: Any, ending: Ending | None = None) -> Any:
        result = ExecuteThrow.Result()
        if ending is None:
            handle.abort()
            return result
        result.success, result.message = ending.success, ending.message
        if ending.executed is not None:
            result.executed = throw_message(
                ending.executed, Stamped(self._simulated.stamp_ns(ending.released_at), self._board_frame)
            )
        if ending.success:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return result

    def _now(self) -> float:
        return float(self._steady.now().nanoseconds) / NANOSECONDS

    def _health(self) -> Health:
        reason = self._gate.reason
        phase = self._stage.phase.value
        time = f"{self._stage.time:.2f}"
        values = {"phase": phase, "armed": not reason, "thrown": self._thrown, "time": time, **self._complaints.counts}
        return Health(f"disarmed: {reason}" if reason else phase, values, warning=bool(reason))


def main() -> int:
    """Runs the node."""
    return run(SimArm, "sim_arm")


if __name__ == "__main__":
    sys.exit(main())
