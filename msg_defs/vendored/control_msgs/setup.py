"""Builds control_msgs where ROS has not installed it; msg_defs/install.py decides."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

from pip_build.wheel import setup_interface_package  # noqa: E402

setup_interface_package(HERE, distribution="contact_curation_vendored_control_msgs")
