"""The controller, gripper and tracker of a described arm as a process of their own, for tests of `trajectory_thrower`.

`test/foreign_arm/cell.py` says what they do. Time is simulated, `rate` seconds a second and slower where the machine is busy;
topic `clock` tells it. Parameter `fault` may be set at any time, and takes effect `fault_after` seconds after the beginning of
a trajectory; 0: at once.
"""

import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

from test.foreign_arm.cell import STEP, Cell, Trajectory

CLOCK_EVERY, JOINTS_EVERY, POSES_EVERY, STATE_EVERY = 2, 4, 7, 20
"""Steps between messages of the clock, joint states (250 Hz), poses of the cube (143 Hz), and states of the controller."""

BEGINS, HURRY = 100.0, 0.02
"""First moment, and the largest delay that the simulation makes up for [s]."""


class Controller(Node):
    """Speaks for the cell."""

    def __init__(self) -> None:
        super().__init__("foreign_controller")
        file = Path(self.declare_parameter("arm", "").value)
        seed = self.declare_parameter("seed", 0).value
        self.declare_parameter("fault", "")
        self.declare_parameter("fault_after", 0.0)
        self._rate = self.declare_parameter("rate", 0.5).value
        self._cell = Cell(file, seed, BEGINS)
        self._lock, self._wanted = threading.Lock(), ("", 0.0)
        self.add_post_set_parameters_callback(self._parameters_set)
        self._clock_told = self.create_publisher(Clock, "/clock", 10)
        self._joints = self.create_publisher(JointState, "joint_states", 50)
        self._poses = self.create_publisher(Odometry, "body_cube", 50)
        self._scaling = self.create_publisher(Float64, "speed_scaling_state_broadcaster/speed_scaling", 10)
        name = "joint_trajectory_controller"
        self._state = self.create_publisher(JointTrajectoryControllerState, f"{name}/controller_state", 10)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(PoseStamped, "trajectory_thrower/grip", self._gripped, kept)
        self.create_service(SetBool, "gripper/open", self._opened)
        self._server = ActionServer(
            self, FollowJointTrajectory, f"{name}/follow_joint_trajectory", self._end,
            handle_accepted_callback=self._taken, cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def run(self) -> None:
        """Moves the cell on."""
        steps, due = 0, time.monotonic()
        while rclpy.ok():
            now = time.monotonic()
            due = max(due + STEP / self._rate, now - HURRY)
            time.sleep(max(due - now, 0.0))
            with self._lock:
                self._be_faulty()
                self._cell.step()
                ended = self._cell.ended()
            if ended is not None:
                self._finish(*ended)
            steps += 1
            self._tell(steps)

    def _parameters_set(self, _: Any) -> None:
        self._wanted, self._cell.fault = (self.get_parameter("fault").value, self.get_parameter("fault_after").value), ""

    def _be_faulty(self) -> None:
        cell, (fault, after) = self._cell, self._wanted
        if not after or (cell.trajectories and cell.time - cell.trajectories[0].begin > after):
            cell.fault = fault  # until another one is wanted

    def _finish(self, goal: Any, failure: str) -> None:
        goal.execute(lambda handle: self._end(handle, failure))

    def _end(self, handle: Any, failure: str = "") -> Any:
        result = FollowJointTrajectory.Result
        if failure:
            handle.abort()
            return result(error_code=result.PATH_TOLERANCE_VIOLATED, error_string=failure)
        handle.succeed()
        return result(error_code=result.SUCCESSFUL)

    def _taken(self, handle: Any) -> None:
        message = handle.request.trajectory
        order = [list(message.joint_names).index(name) for name in self._cell.names]
        positions, speeds = (
            np.array([getattr(point, name) for point in message.points])[:, order] for name in ("positions", "velocities")
        )
        times = np.array([_seconds(point.time_from_start) for point in message.points])
        newest = Trajectory(_seconds(message.header.stamp), times, positions, speeds, handle)
        with self._lock:
            replaced = self._cell.trajectories[-1:]
            self._cell.take(newest)
        for one in replaced:
            self._finish(one.goal, "replaced by a newer trajectory")

    def _gripped(self, message: Any) -> None:
        place, turn = message.pose.position, message.pose.orientation
        with self._lock:
            self._cell.hold([place.x, place.y, place.z], [turn.w, turn.x, turn.y, turn.z])

    def _opened(self, request: Any, response: Any) -> Any:
        with self._lock:
            if request.data:
                self._cell.open(self._cell.time)
        response.success = True
        return response

    def _tell(self, steps: int) -> None:
        cell = self._cell
        if steps % CLOCK_EVERY == 0:
            self._clock_told.publish(Clock(clock=_stamp(cell.time)))
        if steps % JOINTS_EVERY == 0 and cell.fault != "silent":
            joints = JointState(name=cell.names, position=cell.joints.tolist(), velocity=cell.joint_speeds.tolist())
            self._joints.publish(self._stamped(joints))
        if steps % POSES_EVERY == 0 and cell.fault != "unseen":
            self._poses.publish(self._pose())
        if steps % STATE_EVERY == 0:
            self._scaling.publish(Float64(data=100.0 * cell.speed))
            if cell.fault != "inactive":
                self._state.publish(self._stamped(JointTrajectoryControllerState(joint_names=cell.names)))

    def _pose(self) -> Odometry:
        place, turned = self._cell.cube()
        message = self._stamped(Odometry(child_frame_id="body_cube"))
        message.header.frame_id = "body_surface"
        pose = message.pose.pose
        pose.position.x, pose.position.y, pose.position.z = place.tolist()
        pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z = turned.tolist()
        return message

    def _stamped(self, message: Any) -> Any:
        message.header.stamp = _stamp(self._cell.time)
        return message


def _stamp(seconds: float) -> Time:
    return Time(sec=int(seconds), nanosec=int(1e9 * (seconds % 1.0)))


def _seconds(time: Any) -> float:
    return float(time.sec + 1e-9 * time.nanosec)


def main() -> None:
    """Runs it until it is told to end."""
    rclpy.init(args=sys.argv)
    node = Controller()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        node.run()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
