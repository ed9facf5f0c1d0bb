"""Node `trajectory_thrower`: serves execute_throw on an arm of one's own, whose controller follows trajectories with times.

It plans by the arm's description and publishes on `~/grip` how the body has to be held. Once the tracker sees it held so, it
sends control_msgs/action/FollowJointTrajectory, opens the gripper by an action, a service or a topic, and returns the release
as the tracker saw it. It begins disarmed: `~/arm` arms it, `~/stop` stops it until it is armed again, and so does every fault
in the motion; `~/home` then brings the arm home. `~/check` says what is missing and moves nothing. Deactivated, it stops as by
`~/stop` and refuses goals, `~/arm` and `~/home`.
"""

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from contact_curation_msgs.action import ExecuteThrow
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from contact_curation.design.release_delay import DelayConfig
from contact_curation.errors import InvalidValueError, UnwritableOutputError
from contact_curation.files import claimed
from contact_curation.motion.body_tracker import BodyPose, BodyTracker
from contact_curation.motion.release import ReleaseConfig
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.arm_clients import ControllerClient, GripperClient, control, declared_gripper
from contact_curation.nodes.messages.headers import Stamped, nanoseconds_of
from contact_curation.nodes.messages.throw import commanded_throw_of
from contact_curation.nodes.messages.trajectory import grip_message
from contact_curation.nodes.ros.body_parameter import declared_body
from contact_curation.nodes.ros.health import Health, HealthReport
from contact_curation.nodes.ros.node_main import run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.pose_topics import PoseTopics, Received, declared_poses
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Worker
from contact_curation.nodes.throw_server import GatedArm, ThrowServer, declared_oldest_goal
from contact_curation.simulation.arm.described import read_arm
from contact_curation.simulation.arm.planned_throw import described_planner, planned_throw, way_home
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.simulation.arm.steady_swing import SteadyConfig
from contact_curation.stages.arm import Ending
from contact_curation.stages.records import GripperRecord, read_record, write_record
from contact_curation.stages.trajectory_throw import Phase, Step, TrajectoryConfig, TrajectoryThrow

LOOK = 0.002
"""Time between looks at a motion under way [s]."""

FOLLOW = 0.1
"""Time between looks at the graph for pose topics, and between heartbeats [s]."""

TOLD_EVERY = 0.5
"""Time between messages of feedback [s]."""

IDLE = 0.05
"""Time between looks for a goal, and for the body in the gripper [s]."""

PHASES = {
    Phase.IDLE: ExecuteThrow.Feedback.PLANNING,
    Phase.HOLDING: ExecuteThrow.Feedback.PLANNING,
    Phase.MOVING: ExecuteThrow.Feedback.THROWING,
    Phase.HOMEWARD: ExecuteThrow.Feedback.MOVING,
    Phase.STOPPING: ExecuteThrow.Feedback.STOPPED,
}
"""Names of the phases in the feedback."""


class TrajectoryThrower(GatedArm):
    """Throws one body by one arm."""

    def __init__(self) -> None:
        super().__init__("trajectory_thrower")
        self._body = declared_body(self)
        poses = declared_poses(self)
        self._board_frame = poses.board_frame
        arm_file = declare(self, "arm", "", "YAML file that describes the arm; see docs/how-to/your_arm.md")
        arm = read_arm(Path(arm_file)) if arm_file else None
        about_controller = "action of the controller that follows trajectories"
        controller = declare(self, "controller", "joint_trajectory_controller/follow_joint_trajectory", about_controller)
        about_state = "topic on which the controller reports its state while it is active"
        controller_state = declare(self, "controller_state", "joint_trajectory_controller/controller_state", about_state)
        scaling = declare(self, "speed_scaling", "speed_scaling_state_broadcaster/speed_scaling", "topic of the speed scaling")
        self._full_speed = declare(self, "full_speed", 100.0, "value of the speed scaling at full speed", bounds=(1e-3, 1e3))
        gripper = declared_gripper(self)
        self._oldest_goal = declared_oldest_goal(self)
        self._state_path = Path(declare(self, "state", "gripper.json", "file that stores what was learned of the gripper"))
        steady = declare_config(self, SteadyConfig(), "steady.")
        config = declare_config(self, TrajectoryConfig(), "trajectory.")
        delay = declare_config(self, DelayConfig(), "delay.")
        release = declare_config(self, ReleaseConfig(), "release.")
        limits = GateConfig() if arm is None else GateConfig(keep_out_place=(arm.base[0], arm.base[1]))
        gate = declare_config(self, limits, "gate.")
        if arm is None:
            raise InvalidValueError("arm", "nothing", "the YAML file of your arm; see docs/how-to/your_arm.md")
        self._began_ns: int = self.get_clock().now().nanoseconds
        self.serve_gate(SafetyGate(gate), self._now)
        planner = described_planner(self._body, arm, steady)
        self._joints, self._flange = arm.joints, arm.flange
        self._release_state = claimed(self._state_path)
        self._recorded = read_record(self._state_path, GripperRecord)
        self._stage = TrajectoryThrow(
            self._body, planner.arm.limits, planner.arm.home_posture, lambda throw: planned_throw(planner, throw),
            lambda posture: way_home(planner, posture), self._gate, self._now, config, steady.window, delay, release,
            self._recorded,
        )  # fmt: skip
        self._warnings = ThrottledWarnings(self)
        self._ended, self._told = False, (0.0, "")
        self._gripper = GripperClient(self, gripper, self._stage)
        self._controller = ControllerClient(self, controller, arm.joints, self._began_ns, self._stage)
        self._listen(config, controller_state, scaling)
        self._tracker = BodyTracker(poses.tracker(self._body, poses.board_frame))
        self._topics = PoseTopics(self, self._body.name, poses, "", 1024, lambda _: {}, self._pose_came)
        self.create_timer(FOLLOW, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_service(Trigger, "~/home", self._home)
        self.create_service(Trigger, "~/check", self._check)
        self._grip = self.create_publisher(PoseStamped, "~/grip", latched(1))
        self._server = ThrowServer(self, self._admits, self._wake.set, self._stamped, self._warnings)
        self._worker = Worker(self.fail)
        self._worker.do(self._work)
        HealthReport(self, "arm", self._health, self._body.name)
        self.start()

    def close(self) -> None:
        """Ends the thread, and stops the arm if it moves."""
        self._ended = True
        self._wake.set()
        self._worker.stop()
        stop = self._stage.cancel("the node has ended").stop or self._controller.unsent
        if stop is not None:
            self._controller.send_at_end(stop)
        self._server.close()
        self._release_state()

    def _listen(self, config: TrajectoryConfig, controller_state: str, scaling: str) -> None:
        often = profile(50, reliable=False, latched=False)
        self.create_subscription(JointState, "joint_states", self._joints_came, often)
        if config.controller_state:
            state = control("msg").JointTrajectoryControllerState
            # Raw: that it speaks says that it is active, whatever later versions of the type hold.
            self.create_subscription(state, controller_state, lambda _: self._stage.signals.controller_seen(), often, raw=True)
        if config.speed_scaling:
            self.create_subscription(
                Float64, scaling, lambda message: self._stage.signals.scaling_seen(message.data / self._full_speed), often
            )

    def _joints_came(self, message: Any) -> None:
        places = dict(zip(message.name, message.position))
        if all(name in places for name in self._joints):
            positions = np.array([places[name] for name in self._joints])
            self._stage.signals.joints_seen(self._seconds(nanoseconds_of(message.header.stamp)), positions)

    def _pose_came(self, received: Received) -> None:
        _, _, measured = self._topics.read(received)
        for one in measured:
            for event in self._tracker.push(one):
                if isinstance(event, BodyPose):
                    position, orientation = event.pose
                    self._stage.signals.body_seen(self._seconds(event.stamp_ns), np.array(position), np.array(orientation))

    def _admits(self, message: Any) -> str | None:
        now_ns = self.get_clock().now().nanoseconds
        throw = commanded_throw_of(message, self._board_frame, now_ns, self._oldest_goal)
        return self.inactive or self._controller.missing() or self._gripper.missing() or self._stage.admits(throw)

    def _home(self, _: Any, response: Any) -> Any:
        refusal = self.inactive or self._controller.missing() or self._stage.admits_homeward()
        self._wake.set()
        response.success, response.message = not refusal, refusal or "on its way home"
        return response

    def _check(self, _: Any, response: Any) -> Any:
        clients = (self._controller.missing(), self._gripper.missing())
        lines = [line for line in (self.inactive, *clients, *self._stage.signals.missing(), self._stage.busy) if line]
        armed = f"disarmed: {self._gate.reason}" if self._gate.reason else "armed"
        response.success, response.message = not lines, "\n".join(lines) or f"nothing is missing; {armed}"
        return response

    def _look(self) -> None:
        self._gate.heartbeat(self._now())
        self._topics.follow()

    def _work(self) -> None:
        """Begins goals and watches motions until the node ends; on the worker's thread."""
        while not self._ended:
            goal = self._server.goal
            if goal is not None:
                self._throw(goal)
            elif self._stage.wants_home:
                self._go_home()
            else:
                self._wake.wait(IDLE)
                self._wake.clear()

    def _throw(self, goal: Any) -> None:
        """Plans a goal, waits for the body in the gripper, and makes the throw."""
        self._tell()
        began, told = self._stage.begin(), False
        while began is None and not self._ended:
            if not told and self._stage.grip is not None:
                told = True
                self._grip.publish(grip_message(self._stage.grip, Stamped(self._stamp_ns(self._now()), self._flange)))
            if goal.is_cancel_requested and self._done(goal, self._stage.cancel()):
                return
            self._tell()
            time.sleep(IDLE)
            began = self._stage.begin()
        if isinstance(began, Ending):
            self._server.conclude(goal, began)
        elif began is not None:
            self._controller.send(began)
            self._watch(goal)

    def _go_home(self) -> None:
        began = self._stage.begin_homeward()
        if isinstance(began, Ending):
            self._warnings.note("not home", began.message, dropped=False)
            return
        self._controller.send(began)
        self._watch(None)

    def _watch(self, goal: Any) -> None:
        """Watches a motion to its end."""
        while not self._ended:
            if goal is not None and goal.is_cancel_requested:
                self._done(goal, self._stage.cancel())
            if self._done(goal, self._stage.advance()):
                return
            self._tell()
            due = self._stage.opens_at
            time.sleep(LOOK if due is None else min(max(due - self._now(), 0.0), LOOK))

    def _tell(self) -> None:
        """Sends feedback at each change of the phase and from time to time."""
        now, phase = self._now(), self._stage.phase
        shown = ExecuteThrow.Feedback.RELEASED if phase is Phase.MOVING and self._stage.released else PHASES[phase]
        if shown != self._told[1] or abs(now - self._told[0]) >= TOLD_EVERY:
            self._told = now, shown
            self._server.report(shown)

    def _done(self, goal: Any, step: Step) -> bool:
        """Does what is to be done; whether the goal has ended."""
        if step.opens:
            self._gripper.open()
        if step.stop is not None:
            self._controller.send(step.stop)
        if step.ending is None:
            return False
        if self._stage.record != self._recorded:
            try:
                write_record(self._state_path, self._stage.record)
                self._recorded = self._stage.record
            except UnwritableOutputError as error:  # the throw was made all the same; written after the next one
                self._warnings.note("state not written", str(error), dropped=False)
        if goal is None and not step.ending.success:
            self._warnings.note("not home", step.ending.message, dropped=False)
        self._server.conclude(goal, step.ending)
        return True

    def _now(self) -> float:
        return self._seconds(self.get_clock().now().nanoseconds)

    def _seconds(self, stamp_ns: int) -> float:
        """After the node's start, so that no digits are lost [s]."""
        return (stamp_ns - self._began_ns) / NANOSECONDS

    def _stamp_ns(self, time: float) -> int:
        return self._began_ns + round(time * NANOSECONDS)

    def _stamped(self, time: float) -> Stamped:
        return Stamped(self._stamp_ns(time), self._board_frame)

    def _health(self) -> Health:
        reason, delay = self._gate.reason, self._stage.delay
        values = {
            "phase": self._stage.phase, "armed": not reason, "thrown": self._server.made,
            "lag_ms": f"{1e3 * self._stage.lag:.1f}",
            "delay_ms": f"{1e3 * delay.mean:.1f}", "jitter_ms": f"{1e3 * delay.jitter:.1f}", **self._warnings.counts,
        }  # fmt: skip
        shown = self.inactive or (f"disarmed: {reason}" if reason else self._stage.phase)
        return Health(shown, values, warning=bool(reason), waiting_for=self._topics.waiting_for)


def main() -> int:
    """Runs the node."""
    return run(TrajectoryThrower, "trajectory_thrower")


if __name__ == "__main__":
    sys.exit(main())
