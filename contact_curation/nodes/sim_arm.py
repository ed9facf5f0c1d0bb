"""Node `sim_arm`: a simulated arm that executes ExecuteThrow goals; publishes joint states and the body's true motion.

A refused goal ends at once; its result names the limit and the nearest feasible throw. The arm begins disarmed. `~/arm` arms
it; `~/stop` and a missing heartbeat disarm it until it is armed again. With the parameter `armed` it arms itself at its first
activation, and again when its own heartbeat returns, but never after `~/stop`. Deactivated, it stops as by `~/stop` and refuses
goals and `~/arm`, while simulated time goes on. The topic `throw_begun` names the throw to which the frames after its stamp
belong, so that a simulated tracker can draw its noise by throw.
"""

import sys
import threading
from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import Throw as ThrowMessage
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.arm_frame import joint_state_message, truth_message
from contact_curation.nodes.messages.headers import Stamped, time_message
from contact_curation.nodes.messages.throw import commanded_throw_of, throw_message, throw_of
from contact_curation.nodes.ros.body_parameter import declared_body
from contact_curation.nodes.ros.health import Health, HealthReport
from contact_curation.nodes.ros.node_main import run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import TRUTH_DEPTH, latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Worker
from contact_curation.nodes.throw_server import GatedArm, ThrowServer, declared_oldest_goal
from contact_curation.simulation.arm.feasibility import ArmFeasibility
from contact_curation.simulation.arm.frame import ArmFrame
from contact_curation.simulation.arm.model import ArmConfig
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.simulation.arm.simulation import ControlConfig
from contact_curation.simulation.arm.throw_motion import ThrowPlanner
from contact_curation.stages.arm import ArmStage
from contact_curation.stages.simulated_time import AwakeClock, RateLimiter, SimulatedTime, Ticks

BEAT = 0.1
"""Time between the node's own heartbeats, which come from the thread that would receive a stop [s]."""

LONGEST_HUSH = 10.0
"""Time for which the simulation waits for the node's own heartbeat before its absence counts as a failure [s]."""

BREATH, BREATH_FRAMES = 1e-3, 4
"""Pause after a number of frames without waiting, so that other threads, among them the heartbeat, get the processor [s]."""

IDLE = 0.05
"""Time between looks for a goal while simulated time stands still [s]."""

COUNTED = 0.1
"""Largest time between two checks of the heartbeat that counts [s]: a process without processor time moves nothing."""


class SimArm(GatedArm):
    """Throws one body, one goal after the other."""

    def __init__(self) -> None:
        super().__init__("sim_arm")
        self._body = declared_body(self)
        about_rate = "simulated seconds per second; 0: as fast as possible"
        self._limiter = RateLimiter(declare(self, "rate", 1.0, about_rate, bounds=(0.0, 1e3), fixed=False))
        clock_hertz = declare(self, "clock", 0.0, "rate of /clock in simulated time [Hz]; 0: none", bounds=(0.0, 148.0))
        self._board_frame = declare(self, "board_frame", "body_surface", "frame of the board")
        epoch = declare(self, "epoch", 0.0, "start time of the simulation [s]; 0: now", bounds=(0.0, 4e9))
        about_state = "file that stores the simulated time, so that it never goes back after a restart; empty: none"
        state = declare(self, "state", "", about_state)
        about_armed = "arm at the first activation without a call of ~/arm, and again when the node's own heartbeat comes back"
        self._arms_itself = declare(self, "armed", False, about_armed)
        outside = declare(self, "external_heartbeat", False, "expect the heartbeat on topic ~/heartbeat (std_msgs/Empty)")
        self._beats_itself = not outside
        self._oldest_goal = declared_oldest_goal(self)
        seed = declare(self, "seed", 0, "random seed of the gripper's delays", bounds=(0, 2**31))
        arm, control = declare_config(self, ArmConfig(), "arm."), declare_config(self, ControlConfig(), "control.")
        limits = declare_config(self, GateConfig(keep_out_place=(arm.base[0], arm.base[1])), "gate.")
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._awake = AwakeClock(self._now, COUNTED)
        epoch_ns = round(epoch * NANOSECONDS) or self.get_clock().now().nanoseconds
        self._simulated = SimulatedTime(Path(state) if state else None, epoch_ns)
        gate = SafetyGate(limits)
        self.serve_gate(gate, self._awake.now)
        self._stage = ArmStage(ArmFeasibility(ThrowPlanner(self._body, arm), limits), gate, control, seed)
        self._warnings = ThrottledWarnings(self)
        self._ended, self._beaten = False, threading.Event()
        self._since_breath = 0
        self._publish(Ticks(clock_hertz))
        self.start()
        if outside:
            self.create_subscription(Empty, "~/heartbeat", lambda _: self._beat(), profile(1, reliable=True, latched=False))
        else:
            self.create_timer(BEAT, self._beat, clock=self._steady)
            self._beat()  # armed before the first frame, so that all runs are equal
        self._worker = Worker(self.fail)
        self._worker.do(self._work)
        self.add_on_set_parameters_callback(self._parameters_set)
        HealthReport(self, "arm", self._health, self._body.name)

    def close(self) -> None:
        self._ended = True
        self._wake.set()
        self._beaten.set()
        self._worker.stop()
        self._simulated.close()
        self._server.close()

    def _publish(self, ticks: Ticks) -> None:
        often = profile(50, reliable=True, latched=False)
        self._joints = self.create_publisher(JointState, "joint_states", often)
        self._truth = self.create_publisher(Odometry, "ground_truth", profile(TRUTH_DEPTH, reliable=True, latched=False))
        self._begun = self.create_publisher(ThrowMessage, "throw_begun", latched(1))
        self._ticks = ticks
        if ticks.any:
            self._time = self.create_publisher(ClockMessage, "clock", profile(1, reliable=True, latched=False))
        self._server = ThrowServer(
            self,
            admits=self._admits,
            taken=self._wake.set,
            released=self._stamped,
            warnings=self._warnings,
        )

    def _admits(self, message: Any) -> str | None:
        now_ns = self.get_clock().now().nanoseconds
        throw = commanded_throw_of(message, self._board_frame, now_ns, self._oldest_goal)
        return self.inactive or self._stage.admits(throw, self._awake.now())

    def _parameters_set(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "rate":
                self._limiter.set_rate(parameter.value)
        self._wake.set()
        return SetParametersResult(successful=True)

    def _beat(self) -> None:
        """Records a heartbeat. If `armed` is set, arms an active node at the first one, and by its own after every failure."""
        self._gate.heartbeat(self._awake.now())
        if self._arms_itself and self.active and not self._gate.was_stopped:
            self._arms_itself = self._beats_itself
            self._gate.arm(self._awake.now())
        self._beaten.set()

    def _work(self) -> None:
        """Simulates frame after frame until the node ends; on the worker's thread."""
        while not self._ended:
            self._await_beat()
            now = self._awake.tick()
            goal = self._server.goal  # the goal that may end with this frame; another one may come meanwhile
            if goal is not None and self._stage.waits:
                self._begin(goal)
                continue
            if self._limiter.unlimited and self._stage.stands_still:
                self._tell_time(self._stage.frame())
                self._wake.wait(IDLE)
                self._wake.clear()
                continue
            if goal is not None and goal.is_cancel_requested:
                self._stage.cancel()
            frame, ending = self._stage.advance(now)
            self._tell(frame)
            self._server.conclude(goal, ending)
            self._keep_pace(frame.time)

    def _await_beat(self) -> None:
        """Waits for the node's own heartbeat: on a busy machine simulated time waits, so that the arm need not stop."""
        if self._beats_itself and self._gate.silence(self._awake.now()) > 2.0 * BEAT:
            self._beaten.clear()
            self._beaten.wait(LONGEST_HUSH)

    def _begin(self, goal: Any) -> None:
        """Publishes that the next frame is the first of this goal's throw."""
        self._begun.publish(throw_message(throw_of(goal.request.throw_command), self._stamped(self._stage.time)))
        self._server.conclude(goal, self._stage.begin())

    def _tell(self, frame: ArmFrame) -> None:
        stamped = self._stamped(frame.time)
        self._joints.publish(joint_state_message(frame, stamped.stamp_ns))
        self._truth.publish(truth_message(frame, stamped, self._body.name))
        self._ticks.count()
        self._tell_time(frame)
        self._server.tell(frame)

    def _tell_time(self, frame: ArmFrame) -> None:
        if self._ticks.due:
            self._time.publish(ClockMessage(clock=time_message(self._simulated.stamp_ns(frame.time))))

    def _keep_pace(self, time: float) -> None:
        """Waits until a frame's time has come."""
        ahead = self._limiter.ahead(time, self._now())
        self._since_breath += 1
        if self._limiter.unlimited and self._since_breath >= BREATH_FRAMES:
            self._since_breath = 0
            self._wake.wait(BREATH)
        elif ahead > 0.0:
            self._wake.wait(ahead)
            self._wake.clear()

    def _stamped(self, time: float) -> Stamped:
        return Stamped(self._simulated.stamp_ns(time), self._board_frame)

    def _now(self) -> float:
        return float(self._steady.now().nanoseconds) / NANOSECONDS

    def _health(self) -> Health:
        reason = self._gate.reason
        phase = self._stage.phase.value
        time = f"{self._stage.time:.2f}"
        values = {"phase": phase, "armed": not reason, "thrown": self._server.made, "time": time, **self._warnings.counts}
        shown = self.inactive or (f"disarmed: {reason}" if reason else phase)
        return Health(shown, values, warning=bool(reason))


def main() -> int:
    """Runs the node."""
    return run(SimArm, "sim_arm")


if __name__ == "__main__":
    sys.exit(main())
