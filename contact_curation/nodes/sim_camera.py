"""Node `sim_camera`: a simulated tracker; takes a body's true poses and publishes what a tracker would measure.

In mode `poses` it publishes TagSLAM's Odometry with noise and faults. In mode `rendered` it renders images and publishes the
tags that the AprilTag library finds in them. Stamps are those of the ground truth, however long rendering takes. Noise depends
on the throw (`throw_begun`) and the time since it began, not on a clock or the machine's load. Late subscribers, for example a
`pose_ingest` that was killed, receive the last `history` messages again.
"""

import sys
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from contact_curation_msgs.msg import Throw as ThrowMessage
from nav_msgs.msg import Odometry
from rclpy.clock import Clock, ClockType

from contact_curation.geometry.poses import Pose
from contact_curation.geometry.tag_rig import rig_of
from contact_curation.motion.pose_stream import BadPose
from contact_curation.nodes.camera_modes import RenderedTags, Sight, TrackedPoses, TrueFrame
from contact_curation.nodes.messages.headers import nanoseconds_of
from contact_curation.nodes.ros.body_parameter import declared_body
from contact_curation.nodes.ros.health import Health, HealthReport, Rate, awaited
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import TRUTH_DEPTH, latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Worker
from contact_curation.simulation.camera.camera import CameraConfig
from contact_curation.simulation.camera.tag_detection import DetectorConfig
from contact_curation.simulation.tracker_noise import TrackerNoiseConfig
from contact_curation.storage.datasets.tagslam_bag import TagslamRig
from contact_curation.storage.inputs.pose_messages import ODOMETRY, measured_pose
from contact_curation.storage.tag_map_file import read_tag_rig

THROWS_KNOWN = 2
"""Number of throws that are remembered: a new throw may be announced before the last frames of the previous one arrive."""

SILENCE = 0.2
"""Time without a frame after which poses that wait for their latency are published [s]."""


class SimCamera(StageNode):
    """Publishes measurements of one body."""

    def __init__(self) -> None:
        super().__init__("sim_camera")
        self._body = declared_body(self)
        self._body_frame = f"body_{self._body.name}"
        self._warnings = ThrottledWarnings(self)
        self._received, self._told, self._before = Rate(), 0, 0
        self._begun: deque[tuple[int, str]] = deque(maxlen=THROWS_KNOWN)
        self._sight = self._declared_sight()
        self._worker = Worker(self.fail)
        self.create_subscription(ThrowMessage, "throw_begun", self._throw_begun, latched(1))
        self.create_subscription(Odometry, "ground_truth", self._arrived, profile(TRUTH_DEPTH, reliable=True, latched=False))
        self.create_timer(SILENCE, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        HealthReport(self, "camera", self._health, self._body.name)

    def close(self) -> None:
        self._worker.do(self._sight.close)
        self._worker.stop()

    def _declared_sight(self) -> Sight:
        mode = declare(self, "mode", "poses", "what is published", choices=("poses", "rendered"))
        seed = declare(self, "seed", 0, "random seed of the noise", bounds=(0, 2**31))
        board_frame = declare(self, "board_frame", "body_surface", "frame of the board, in which the ground truth is given")
        tag_map = declare(
            self, "tag_map", "", "YAML file with the tags; empty: one on each of the body's faces, seven on the board"
        )
        history = declare(self, "history", 4096, "poses or detections that late subscribers still get", bounds=(1, 1 << 20))
        images = declare(self, "images", False, "publish rendered images too")
        noise = declare_config(self, TrackerNoiseConfig(), "noise.")
        camera, detector = declare_config(self, CameraConfig(), "camera."), declare_config(self, DetectorConfig(), "detector.")
        if mode == "poses":
            return TrackedPoses(self, self._body, TagslamRig(board_frame=board_frame), noise, seed, history=history)
        if tag_map:
            rig = read_tag_rig(Path(tag_map), self._body_frame, board_frame)
        else:
            rig = rig_of(self._body.tracked_polytope, self._body_frame, board_frame)
        return RenderedTags(self, self._body, rig, camera, detector, seed, history=history, images=images)

    def _arrived(self, message: Any) -> None:
        self._received.count += 1
        measured = measured_pose(ODOMETRY, message, self._body_frame)
        if isinstance(measured, BadPose):
            self._warnings.note("bad pose", measured.why)
            return
        position, orientation = measured.pose
        begun_ns, throw_id = next((one for one in reversed(self._begun) if one[0] <= measured.stamp_ns), (0, ""))
        true = TrueFrame(measured.stamp_ns, Pose(np.array(position), np.array(orientation)), throw_id, begun_ns)
        self._worker.do(lambda: self._see(true))

    def _throw_begun(self, message: Any) -> None:
        self._begun.append((nanoseconds_of(message.header.stamp), message.throw_id))

    def _see(self, true: TrueFrame) -> None:
        self._sight.see(true)
        self._told += 1

    def _look(self) -> None:
        if self._received.count == self._before:
            self._worker.do(self._sight.rest)
        self._before = self._received.count

    def _health(self) -> Health:
        rate = self._received.per_second()
        values = {"frames": self._received.count, "told": self._told, "queue": self._worker.waiting, **self._warnings.counts}
        missing = "" if self._received.count else awaited(self, "true poses", "ground_truth")
        return Health(f"{rate:.0f} frames/s", values, warning=rate == 0.0, waiting_for=missing)


def main() -> int:
    """Runs the node."""
    return run(SimCamera, "sim_camera")


if __name__ == "__main__":
    sys.exit(main())
