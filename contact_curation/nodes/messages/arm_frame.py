"""A frame of the simulated arm as messages."""

from geometry_msgs.msg import Point, Pose, PoseWithCovariance, Quaternion, Twist, TwistWithCovariance, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.simulation.arm.frame import ArmFrame
from contact_curation.simulation.arm.model import JOINT_NAMES

BASE_FRAME = "fr3_link0"


def joint_state_message(frame: ArmFrame, stamp_ns: int) -> JointState:
    """The arm's joint positions [rad], speeds [rad/s] and torques [N m]."""
    return JointState(
        header=header_message(Stamped(stamp_ns, BASE_FRAME)),
        name=list(JOINT_NAMES),
        position=frame.joints.tolist(),
        velocity=frame.speeds.tolist(),
        effort=frame.torques.tolist(),
    )


def truth_message(frame: ArmFrame, stamped: Stamped, body: str) -> Odometry:
    """The body's true pose in the board's frame and its twist in the body's frame, as Odometry specifies."""
    x, y, z, w, qx, qy, qz = frame.body[:7].tolist()
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=w, x=qx, y=qy, z=qz))
    (vx, vy, vz), (wx, wy, wz) = frame.twist_in_body.reshape(2, 3).tolist()
    twist = Twist(linear=Vector3(x=vx, y=vy, z=vz), angular=Vector3(x=wx, y=wy, z=wz))
    return Odometry(
        header=header_message(stamped),
        child_frame_id=f"body_{body}",
        pose=PoseWithCovariance(pose=pose),
        twist=TwistWithCovariance(twist=twist),
    )
