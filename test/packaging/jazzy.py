"""A ROS 2 Jazzy that can build packages, made of wheels in a virtual environment of its own, and a colcon workspace on top.

The wheels lack two things of an installed ROS, which are corrected here: their CMake files name the include folders of the
machine that built them, and tf2_msgs, apriltag_msgs and control_msgs are not among them.
"""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
REQUIREMENTS = Path(__file__).with_name("jazzy_requirements.txt")
LOCK = REPOSITORY / "requirements.lock"
SOURCES = ("setup.py", "setup.cfg", "pyproject.toml", "package.xml", "README.md", "LICENSE", "MANIFEST.in")
FOLDERS = ("resource", "contact_curation", "msg_defs")
NOT_SOURCES = ("build", "__pycache__", "*.egg-info", "*.so")

ANOTHER_ROS = {"PYTHONPATH", "PYTHONHOME", "AMENT_PREFIX_PATH", "COLCON_PREFIX_PATH", "CMAKE_PREFIX_PATH", "LD_LIBRARY_PATH"}
ANOTHER_ROS |= {"_ROS_WHEELS_BOOTSTRAP_COMPLETE"}

BUILDERS_INCLUDES = re.compile(r"/opt/python/[^\";]*/include(/python3\.\d+)?")
"""Group 1 for Python's own folder, none for numpy's."""


@dataclass(frozen=True)
class Workspace:
    """What colcon has built.

    Attributes:
        install: colcon's install folder.
        environment: variables after `. install/setup.sh`.
    """

    install: Path
    environment: Mapping[str, str]

    def python(self, *arguments: str) -> str:
        """What Python prints in the workspace."""
        return run(["python3", *arguments], self.environment, self.install)


def lacking() -> str:
    """Why no such environment can be made here; empty where it can."""
    absent = [tool for tool in ("cmake", "c++") if shutil.which(tool) is None]
    if absent:
        return f"building with colcon needs {' and '.join(absent)}"
    asked = [sys.executable, "-m", "pip", "index", "versions", "--retries", "1", "ros-jazzy-ament-cmake"]
    reached = subprocess.run(asked, capture_output=True, check=False).returncode == 0
    return "" if reached else "building with colcon needs a package index with ROS 2 Jazzy's wheels"


def make_jazzy(folder: Path) -> dict[str, str]:
    """Installs Jazzy's packages and colcon in `folder`; gives the environment variables of a shell that has sourced them."""
    environment = {name: value for name, value in os.environ.items() if name not in ANOTHER_ROS}
    run([sys.executable, "-m", "venv", str(folder)], environment, folder.parent)
    environment |= {
        "VIRTUAL_ENV": str(folder),
        "PATH": os.pathsep.join([str(folder / "bin"), environment["PATH"]]),
        "AMENT_PREFIX_PATH": str(folder),
        "COLCON_HOME": str(folder / "colcon"),
    }
    pip = ["python3", "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    constraints = folder / "constraints.txt"  # with hashes pip would want one for every package
    constraints.write_text(re.sub(r" --hash=\S+", "", LOCK.read_text()))
    run([*pip, "-r", str(REQUIREMENTS), "-c", str(constraints)], environment, folder)
    site_packages = Path(run(["python3", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], environment, folder))
    _correct_includes(folder, site_packages)
    vendored = shutil.copytree(REPOSITORY / "msg_defs", folder / "msg_defs", ignore=shutil.ignore_patterns(*NOT_SOURCES))
    packages = sorted(str(path) for path in (vendored / "vendored").iterdir())
    run([*pip, "--no-build-isolation", "--no-deps", *packages], environment, folder)
    # What Ubuntu does not package (torch, for one) is that of the tests; its path comes last, behind Jazzy's own.
    (site_packages / "of_the_tests.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return environment


def build(project: Path, environment: Mapping[str, str]) -> Workspace:
    """Copies the sources to `project` and builds them with the README's command."""
    project.mkdir()
    for name in SOURCES:
        shutil.copy(REPOSITORY / name, project)
    for name in FOLDERS:
        shutil.copytree(REPOSITORY / name, project / name, ignore=shutil.ignore_patterns(*NOT_SOURCES))
    run(["python3", "-m", "colcon", "build", "--base-paths", ".", "msg_defs"], environment, project)
    sourced = run(["sh", "-c", ". install/setup.sh && env -0"], environment, project)
    return Workspace(project / "install", dict(line.split("=", 1) for line in sourced.split("\0") if line))


def run(command: Sequence[str], environment: Mapping[str, str], folder: Path) -> str:
    """Standard output, stripped; a failure shows the end of all that was said."""
    program = shutil.which(command[0], path=environment["PATH"]) or command[0]
    done = subprocess.run([program, *command[1:]], cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{(done.stdout + done.stderr)[-6000:]}"
    return done.stdout.strip()


def _correct_includes(prefix: Path, site_packages: Path) -> None:
    """The include folders of this machine's Python and of this environment's numpy, in every CMake file."""
    numpy = str(site_packages / "numpy" / "_core" / "include")
    for path in (prefix / "share").glob("*/cmake/*.cmake"):
        text = path.read_text()
        corrected = BUILDERS_INCLUDES.sub(lambda found: sysconfig.get_path("include") if found[1] else numpy, text)
        if corrected != text:
            path.write_text(corrected)
