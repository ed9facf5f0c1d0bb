"""Two arms by their public descriptions alone: a UR5e as URDF, an xArm7 as MJCF."""

from pathlib import Path

import numpy as np

from contact_curation.simulation.arm.described import DescribedArmConfig

HERE = Path(__file__).resolve().parent

UR5E = DescribedArmConfig(
    description=str(HERE / "ur5e.urdf"),
    joints=(
        "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
    ),
    base=(-0.307, -0.55, 0.0),
    home=(-0.2, -1.9, -1.9, -0.9, 1.57, 0.0),
    acceleration=(8.0,) * 6,
)  # fmt: skip
"""Universal Robots publishes no limits of acceleration; 8 rad/s^2 is moderate for throws."""

XARM7 = DescribedArmConfig(
    description=str(HERE / "xarm7.xml"),
    joints=tuple(f"joint{number}" for number in range(1, 8)),
    flange="link7",
    base=(-0.307, -0.5, -0.1),
    home=(0.0, -0.6, 0.0, 1.0, 0.0, 1.6, 0.0),
    speed=(np.pi,) * 7,
    acceleration=(20.0,) * 7,
    torque=(50.0, 50.0, 30.0, 30.0, 30.0, 20.0, 20.0),
)
"""Speeds and accelerations of the maker's user manual (180 deg/s, 1145 deg/s^2), torques of xarm_description."""

ARMS = {"ur5e": UR5E, "xarm7": XARM7}
