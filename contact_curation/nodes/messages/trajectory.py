"""What a throw by an arm of one's own sends: a trajectory for its controller, and how the body has to be held."""

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, PoseStamped, Quaternion
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from contact_curation.geometry.poses import Pose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.nodes.messages.headers import Stamped, header_message, time_message
from contact_curation.stages.trajectory_throw import Sent


def trajectory_message(sent: Sent, joints: tuple[str, ...], began_ns: int) -> JointTrajectory:
    """A trajectory of these joints; its stamp is its beginning, counted from `began_ns` [ns]."""
    message = JointTrajectory(joint_names=list(joints))
    message.header.stamp = time_message(began_ns + round(sent.begin * NANOSECONDS))
    times, points = sent.points
    for row, time in enumerate(times.tolist()):
        seconds, nanoseconds = divmod(round(time * NANOSECONDS), NANOSECONDS)
        message.points.append(
            JointTrajectoryPoint(
                positions=points.positions[row].tolist(), velocities=points.speeds[row].tolist(),
                accelerations=points.accelerations[row].tolist(),
                time_from_start=Duration(sec=seconds, nanosec=nanoseconds),
            )
        )  # fmt: skip
    return message


def grip_message(grip: Pose, stamped: Stamped) -> PoseStamped:
    """The pose of the held body in the frame of the flange."""
    x, y, z = grip.position.tolist()
    qw, qx, qy, qz = grip.orientation_wxyz.tolist()
    message = PoseStamped(header=header_message(stamped))
    message.pose.position, message.pose.orientation = Point(x=x, y=y, z=z), Quaternion(x=qx, y=qy, z=qz, w=qw)
    return message
