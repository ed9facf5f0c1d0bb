"""Two arms by their public descriptions alone: a UR5e as URDF, an xArm7 as MJCF."""

from pathlib import Path

from contact_curation.simulation.arm.described import read_arm

HERE = Path(__file__).resolve().parent

FILES = {"ur5e": HERE / "ur5e.yaml", "xarm7": HERE / "xarm7.yaml"}
ARMS = {name: read_arm(file) for name, file in FILES.items()}
UR5E, XARM7 = ARMS["ur5e"], ARMS["xarm7"]
