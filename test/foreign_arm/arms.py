"""Two arms by their public descriptions alone: a UR5e as URDF, an xArm7 as MJCF."""

from pathlib import Path

import numpy as np

from contact_curation.design.throw import Throw
from contact_curation.geometry.quaternions import IDENTITY
from contact_curation.simulation.arm.described import read_arm

HERE = Path(__file__).resolve().parent

FILES = {"ur5e": HERE / "ur5e.yaml", "xarm7": HERE / "xarm7.yaml"}
ARMS = {name: read_arm(file) for name, file in FILES.items()}
UR5E, XARM7 = ARMS["ur5e"], ARMS["xarm7"]


def throw(number: int) -> Throw:
    """One of the throws that both arms can make."""
    velocity = np.array([0.5 + 0.04 * number, 0.0, 0.1])
    place, spin = np.array([-0.3, 0.02 * number, 0.17]), np.array([0.0, 0.8, 0.0])
    return Throw(f"throw-{number}", "cube", place, IDENTITY, velocity, spin)
