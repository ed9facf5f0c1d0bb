"""Node `trajectory_thrower`: serves execute_throw on an arm of one's own, whose controller follows trajectories with times.

It plans by the arm's description and publishes on `~/grip` how the body has to be held. Once the tracker sees it held so, it
sends control_msgs/action/FollowJointTrajectory, opens the gripper by an action, a service or a topic, and returns the release
as the tracker saw it. It begins disarmed: `~/arm` arms it, `~/stop` stops it until it is armed again, and so does every fault
in the motion; `~/home` then brings the arm home. `~/check` says what is missing and moves nothing.
"""

import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from contact_curation_msgs.action import ExecuteThrow
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from rclpy.action import ActionClient
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from contact_curation.design.release_delay import DelayConfig
from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.body_tracker import BodyPose, BodyTracker
from contact_curation.motion.release import ReleaseConfig
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import Stamped, header_message, nanoseconds_of, time_message
from contact_curation.nodes.messages.throw import commanded_throw_of
from contact_curation.nodes.ros.body_parameter import declared_body
from contact_curation.nodes.ros.health import Health, HealthReport
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.pose_topics import PoseTopics, Received
from contact_curation.nodes.ros.qos import latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Worker
from contact_curation.nodes.throw_server import ThrowServer
from contact_curation.simulation.arm.described import read_arm
from contact_curation.simulation.arm.path import JointPath
from contact_curation.simulation.arm.planned_throw import described_planner, planned_throw
from contact_curation.simulation.arm.safety import GateConfig, SafetyGate
from contact_curation.simulation.arm.steady_swing import SteadyConfig
from contact_curation.simulation.arm.throw_motion import STEP
from contact_curation.stages.arm import Ending
from contact_curation.stages.records import GripperRecord, read_record, write_record
from contact_curation.stages.trajectory_throw import Phase, Sent, Step, TrajectoryConfig, TrajectoryThrow
from contact_curation.storage.inputs.pose_source import PoseTopicConfig

LOOK = 0.002
"""Time between looks at a motion under way [s]."""

FOLLOW = 0.1
"""Time between looks at the graph for pose topics, and between heartbeats [s]."""

TOLD_EVERY = 0.5
"""Time between messages of feedback [s]."""

POINTS_EVERY = 8
"""Samples of a path between two points of the trajectory that is sent."""

IDLE = 0.05
"""Time between looks for a goal, and for the body in the gripper [s]."""

OLDEST_GOAL = 60.0
GRIPPERS = ("action", "service", "topic")

PHASES = {
    Phase.IDLE: ExecuteThrow.Feedback.PLANNING,
    Phase.HOLDING: ExecuteThrow.Feedback.PLANNING,
    Phase.MOVING: ExecuteThrow.Feedback.THROWING,
    Phase.HOMEWARD: ExecuteThrow.Feedback.MOVING,
    Phase.STOPPING: ExecuteThrow.Feedback.STOPPED,
}
"""Names of the phases in the feedback."""


class TrajectoryThrower(StageNode):
    """Throws one body by one arm."""

    def __init__(self) -> None:
        super().__init__("trajectory_thrower")
        self._body = declared_body(self)
        poses = declare_config(self, PoseTopicConfig())
        self._board_frame = poses.board_frame
        arm_file = declare(self, "arm", "", "YAML file that describes the arm; see docs/how-to/your_arm.md")
        arm = read_arm(Path(arm_file)) if arm_file else None
        about_controller = "action of the controller that follows trajectories"
        controller = declare(self, "controller", "joint_trajectory_controller/follow_joint_trajectory", about_controller)
        about_state = "topic on which the controller reports its state while it is active"
        controller_state = declare(self, "controller_state", "joint_trajectory_controller/controller_state", about_state)
        scaling = declare(self, "speed_scaling", "speed_scaling_state_broadcaster/speed_scaling", "topic of the speed scaling")
        self._full_speed = declare(self, "full_speed", 100.0, "value of the speed scaling at full speed", bounds=(1e-3, 1e3))
        kind = declare(self, "gripper", "service", "how the gripper is opened", choices=GRIPPERS)
        name = declare(self, "gripper_name", "gripper/open", "name of the gripper's action, service or topic")
        open_value = declare(self, "gripper_open", True, "value that opens a gripper that is a service or a topic")
        position = declare(
            self, "gripper_position", 0.08, "open position of a gripper that is an action [m]", bounds=(0.0, 1.0)
        )
        effort = declare(self, "gripper_effort", 0.0, "largest effort of a gripper that is an action [N]", bounds=(0.0, 1e4))
        self._oldest_goal = declare(
            self, "oldest_goal", OLDEST_GOAL, "goals older than this are stale [s]", bounds=(0.0, 3600.0)
        )
        self._state_path = Path(declare(self, "state", "gripper.json", "file that stores what was learned of the gripper"))
        steady = declare_config(self, SteadyConfig(), "steady.")
        config = declare_config(self, TrajectoryConfig(window=steady.window), "trajectory.")
        delay = declare_config(self, DelayConfig(), "delay.")
        release = declare_config(self, ReleaseConfig(), "release.")
        limits = GateConfig() if arm is None else GateConfig(keep_out_place=(arm.base[0], arm.base[1]))
        gate = declare_config(self, limits, "gate.")
        if arm is None:
            raise InvalidValueError("arm", "nothing", "the YAML file of your arm; see docs/how-to/your_arm.md")
        self._began_ns = self.get_clock().now().nanoseconds
        self._gate = SafetyGate(gate)
        planner = described_planner(self._body, arm, steady)
        self._joints, self._flange = arm.joints, arm.flange

        def homeward(posture: Array) -> JointPath | str:
            found = planner.homeward(posture)
            return found if isinstance(found, JointPath) else str(found)

        record = read_record(self._state_path, GripperRecord)
        self._stage = TrajectoryThrow(
            self._body, planner.arm.limits, planner.arm.home_posture, lambda throw: planned_throw(planner, throw), homeward,
            self._gate, self._now, config, delay, release, record,
        )  # fmt: skip
        self._recorded = self._stage.record
        self._warnings = ThrottledWarnings(self)
        self._ended, self._wake, self._told = False, threading.Event(), 0.0
        self._gripper = _Gripper(self, kind, name, opens=open_value, position=position, effort=effort)
        self._follow = _Follow(self, controller, self._stage)
        self._listen(config, controller_state, scaling)
        self._tracker = BodyTracker(poses.tracker(self._body, poses.board_frame))
        self._topics = PoseTopics(self, self._body.name, poses, "", 1024, lambda _: {}, self._pose_came)
        self.create_timer(FOLLOW, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_service(Trigger, "~/arm", self._arm)
        self.create_service(Trigger, "~/stop", self._stop)
        self.create_service(Trigger, "~/home", self._home)
        self.create_service(Trigger, "~/check", self._check)
        self._grip = self.create_publisher(PoseStamped, "~/grip", latched(1))
        self._server = ThrowServer(self, self._admits, self._wake.set, self._stamped, self._warnings)
        self._worker = Worker(self.fail)
        self._worker.do(self._work)
        HealthReport(self, "arm", self._health, self._body.name)

    def close(self) -> None:
        self._ended = True
        self._wake.set()
        self._worker.stop()
        self._server.close()

    def _listen(self, config: TrajectoryConfig, controller_state: str, scaling: str) -> None:
        often = profile(50, reliable=False, latched=False)
        self.create_subscription(JointState, "joint_states", self._joints_came, often)
        if config.controller_state:
            state = _control("msg").JointTrajectoryControllerState
            # Raw: that it speaks says that it is active, whatever later versions of the type hold.
            self.create_subscription(state, controller_state, lambda _: self._stage.controller_seen(), often, raw=True)
        if config.speed_scaling:
            self.create_subscription(
                Float64, scaling, lambda message: self._stage.scaling_seen(message.data / self._full_speed), often
            )

    def _joints_came(self, message: Any) -> None:
        places = dict(zip(message.name, message.position))
        if all(name in places for name in self._joints):
            positions = np.array([places[name] for name in self._joints])
            self._stage.joints_seen(self._seconds(nanoseconds_of(message.header.stamp)), positions)

    def _pose_came(self, received: Received) -> None:
        _, _, measured = self._topics.read(received)
        for one in measured:
            for event in self._tracker.push(one):
                if isinstance(event, BodyPose):
                    position, orientation = event.pose
                    self._stage.body_seen(self._seconds(event.stamp_ns), np.array(position), np.array(orientation))

    def _admits(self, message: Any) -> str | None:
        now_ns = self.get_clock().now().nanoseconds
        throw = commanded_throw_of(message, self._board_frame, now_ns, self._oldest_goal)
        return self._unready() or self._stage.admits(throw)

    def _unready(self) -> str | None:
        return self._follow.missing() or self._gripper.missing()

    def _arm(self, _: Any, response: Any) -> Any:
        response.success, response.message = True, f"armed (arming number {self._gate.arm(self._now())})"
        return response

    def _stop(self, _: Any, response: Any) -> Any:
        self._gate.stop("the stop service was called")
        self._wake.set()
        response.success, response.message = True, "stopped until it is armed again"
        return response

    def _home(self, _: Any, response: Any) -> Any:
        refusal = self._follow.missing() or self._stage.admits_homeward()
        self._wake.set()
        response.success, response.message = not refusal, refusal or "on its way home"
        return response

    def _check(self, _: Any, response: Any) -> Any:
        lines = [line for line in (self._follow.missing(), self._gripper.missing(), *self._stage.missing()) if line]
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
        began = self._stage.begin()
        if began is None and self._stage.grip is not None:
            self._grip.publish(self._grip_message(self._stage.grip))
        while began is None and not self._ended:
            if goal.is_cancel_requested and self._done(goal, self._stage.cancel()):
                return
            self._tell()
            time.sleep(IDLE)
            began = self._stage.begin()
        if isinstance(began, Ending):
            self._server.conclude(goal, began)
        elif began is not None:
            self._follow.send(began)
            self._watch(goal)

    def _go_home(self) -> None:
        began = self._stage.begin_homeward()
        if isinstance(began, Ending):
            self._warnings.note("not home", began.message)
            return
        self._follow.send(began)
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
        """Sends feedback, so that the client knows that the goal is under way."""
        now = self._now()
        if now - self._told >= TOLD_EVERY:
            self._told = now
            self._server.report(PHASES[self._stage.phase])

    def _done(self, goal: Any, step: Step) -> bool:
        """Does what is to be done; whether the goal has ended."""
        if step.opens:
            self._gripper.open()
        if step.stop is not None:
            self._follow.send(step.stop)
        if step.ending is None:
            return False
        if self._stage.record != self._recorded:
            self._recorded = self._stage.record
            write_record(self._state_path, self._recorded)
        if goal is None and not step.ending.success:
            self._warnings.note("not home", step.ending.message)
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

    def _grip_message(self, grip: Pose) -> PoseStamped:
        x, y, z = grip.position.tolist()
        qw, qx, qy, qz = grip.orientation_wxyz.tolist()
        message = PoseStamped(header=header_message(Stamped(self._stamp_ns(self._now()), self._flange)))
        message.pose.position, message.pose.orientation = Point(x=x, y=y, z=z), Quaternion(x=qx, y=qy, z=qz, w=qw)
        return message

    def trajectory(self, sent: Sent) -> JointTrajectory:
        """A path as the controller takes it."""
        rows = np.unique(np.append(np.arange(0, len(sent.path), POINTS_EVERY), len(sent.path) - 1))
        points = []
        for row in rows.tolist():
            seconds, nanoseconds = divmod(round(row * STEP * NANOSECONDS), NANOSECONDS)
            points.append(
                JointTrajectoryPoint(
                    positions=sent.path.positions[row].tolist(), velocities=sent.path.speeds[row].tolist(),
                    accelerations=sent.path.accelerations[row].tolist(),
                    time_from_start=Duration(sec=seconds, nanosec=nanoseconds),
                )
            )  # fmt: skip
        message = JointTrajectory(joint_names=list(self._joints), points=points)
        message.header.stamp = time_message(self._stamp_ns(sent.begin))
        return message

    def _health(self) -> Health:
        reason, delay = self._gate.reason, self._stage.delay
        values = {
            "phase": self._stage.phase, "armed": not reason, "thrown": self._server.made,
            "lag_ms": f"{1e3 * self._stage.lag:.1f}",
            "delay_ms": f"{1e3 * delay.mean:.1f}", "jitter_ms": f"{1e3 * delay.jitter:.1f}", **self._warnings.counts,
        }  # fmt: skip
        return Health(f"disarmed: {reason}" if reason else self._stage.phase, values, warning=bool(reason))


class _Follow:
    """The controller's action: each trajectory replaces the one before.

    Args:
        node: node that sends.
        name: of the action.
        stage: is told how the newest one ended.
    """

    def __init__(self, node: TrajectoryThrower, name: str, stage: TrajectoryThrow) -> None:
        self._node, self._stage, self._name, self._number = node, stage, node.resolve_topic_name(name), 0
        self._type = _control("action").FollowJointTrajectory
        self._client = ActionClient(node, self._type, name)

    def missing(self) -> str:
        """In one line that there is no such controller; empty if there is."""
        return "" if self._client.server_is_ready() else f"controller: found no action {self._name}; is it loaded?"

    def send(self, sent: Sent) -> None:
        """Sends a trajectory; the end of an earlier one does not count any more. May be called from any thread.

        The executor's thread sends: the answer to another thread could come before the client waits for it, and be lost.
        """
        self._number += 1
        self._node.executor.create_task(self._send, sent, self._number)

    def _send(self, sent: Sent, number: int) -> None:
        future = self._client.send_goal_async(self._type.Goal(trajectory=self._node.trajectory(sent)))
        future.add_done_callback(lambda done: self._answered(number, done.result()))

    def _answered(self, number: int, handle: Any) -> None:
        if handle.accepted:
            handle.get_result_async().add_done_callback(lambda done: self._ended(number, done.result().result))
        elif number == self._number:
            self._stage.controller_ended("it rejected the trajectory")

    def _ended(self, number: int, result: Any) -> None:
        if number == self._number:
            fine = result.error_code == self._type.Result.SUCCESSFUL
            self._stage.controller_ended("" if fine else result.error_string or f"error {result.error_code}")


class _Gripper:
    """Opens the gripper.

    Args:
        node: node that tells it.
        kind: one of `GRIPPERS`.
        name: of its action, service or topic.
        opens: what opens it, as service or topic.
        position: that opens it, as action [m].
        effort: largest one, as action [N].
    """

    def __init__(self, node: StageNode, kind: str, name: str, *, opens: bool, position: float, effort: float) -> None:
        self._kind, self._opens, self._name = kind, opens, node.resolve_topic_name(name)
        if kind == "action":
            action = _control("action").GripperCommand
            self._client: Any = ActionClient(node, action, name)
            command = _control("msg").GripperCommand(position=position, max_effort=effort)
            self._goal = action.Goal(command=command)
        elif kind == "service":
            self._client = node.create_client(SetBool, name)
        else:
            self._client = node.create_publisher(Bool, name, profile(1, reliable=True, latched=False))

    def missing(self) -> str:
        """In one line that there is no gripper; empty if there is."""
        if self._kind == "action":
            ready = self._client.server_is_ready()
        elif self._kind == "service":
            ready = self._client.service_is_ready()
        else:
            ready = self._client.get_subscription_count() > 0
        return "" if ready else f"gripper: found no {self._kind} {self._name}; set gripper and gripper_name"

    def open(self) -> None:
        """Tells it to open and does not wait."""
        if self._kind == "action":
            self._client.send_goal_async(self._goal)
        elif self._kind == "service":
            self._client.call_async(SetBool.Request(data=self._opens))
        else:
            self._client.publish(Bool(data=self._opens))


def _control(kind: str) -> Any:
    """control_msgs' actions or messages.

    Raises:
        MissingDependencyError: they are not installed.
    """
    try:
        import control_msgs.action
        import control_msgs.msg
    except ImportError as error:
        raise MissingDependencyError("control_msgs", "install the ROS package control_msgs, or run make") from error
    return getattr(control_msgs, kind)


def main() -> int:
    """Runs the node."""
    return run(TrajectoryThrower, "trajectory_thrower")


if __name__ == "__main__":
    sys.exit(main())
