"""pip's way to build contact_curation_msgs; colcon uses CMakeLists.txt."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from pip_build.wheel import setup_interface_package  # noqa: E402

setup_interface_package(HERE, distribution="contact_curation_msgs")
