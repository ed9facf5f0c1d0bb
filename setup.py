"""Installs contact_curation with pip or colcon and builds its kernel; names and version come from package.xml.

The kernel is one shared library with a plain C interface, loaded with ctypes: no tie to the ABI of an interpreter or of torch,
the GIL is free while it runs, and it builds in seconds. It is built for each named level of this machine's kind of CPU, and the
loader takes the highest that the CPU has (solver/compiled.py); all of them give the same bytes.
"""

import os
import platform
import shlex
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # that of Ubuntu 24.04, which colcon calls, and which makes no wheels
    bdist_wheel = object

HERE = Path(__file__).resolve().parent
MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()
NAME = MANIFEST.findtext("name", "")

NODES = [
    *("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "sim_camera", "player"),
    *("session_recorder", "dashboard", "container", "trajectory_thrower"),
]

REQUIRES = [
    *(
        "argcomplete",
        "cmaes>=0.11",
        "matplotlib>=3.6",
        "mcap>=1.1",
        "numpy>=1.26",
        "pyarrow>=15",
        "PyYAML>=6",
        "rosbags>=0.10,<0.12",
        "safetensors>=0.4",
    ),
    *("scipy>=1.14", "tqdm", "trimesh>=4", "zstandard"),
]
"""All that reading, ranking and drawing need for a polytope: no torch, no simulator, no ROS."""

VERSION = MANIFEST.findtext("version", "")
TRAIN = ["torch>=2.4"]
SIM = ["daqp>=0.5", "mink>=0.0.6", "mujoco>=3.2", "opencv-python-headless>=4.8", "pupil-apriltags>=1.0.4"]
DASHBOARD = ["rerun-sdk>=0.41"]
CLOUD = ["fsspec[http]>=2024.6", "s3fs>=2024.6"]
RAY = ["ray>=2.30"]
ROS = ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces", f"contact_curation_msgs=={VERSION}"]
ROS += [f"contact_curation_vendored_{name}" for name in ("apriltag_msgs", "control_msgs", "tf2_msgs")]
EXTRAS = {"train": TRAIN, "sim": SIM, "dashboard": DASHBOARD, "cloud": CLOUD, "ray": RAY, "ros": ROS}
EXTRAS["all"] = [each for extra in list(EXTRAS.values()) for each in extra]
"""What more is needed for what: contact_curation/extras.py names them where one is missing. `make wheel` builds the last three
of `ros` beside this package, because no package index has them."""

KERNEL_FOLDERS = [Path(NAME, "solver", "kernel"), Path(NAME, "contact", "kernel")]
# Every level gives the same bytes: nothing is fused, reordered or approximated that the source does not write down.
KERNEL_FLAGS = ["-std=c++17", "-O3", "-fno-math-errno", "-ffp-contract=off"]
KERNEL_FLAGS += ["-fvisibility=hidden", "-fvisibility-inlines-hidden", "-fPIC", "-shared", "-pthread", "-Wall", "-Wextra"]
# Vectors wider than a CPU's registers are passed in memory; both ends are in this library, so the psABI note is of no interest.
# Arrays have room for the most contacts there may be, and only those there are get filled: gcc 12 takes that for a mistake.
KERNEL_FLAGS += ["-Wno-psabi", "-Wno-maybe-uninitialized", *(f"-I{HERE / folder}" for folder in KERNEL_FOLDERS)]
KERNEL_LEVELS = {"x86_64": [f"x86-64-v{number}" for number in (2, 3, 4)]}
"""What is built where, by the machine's name; elsewhere one level of the machine's own name, for any CPU of its kind."""


def kernel_sources() -> list[str]:
    """All C++ files of the kernel, relative to this file, as setuptools wants them."""
    return sorted(str(path.relative_to(HERE)) for folder in KERNEL_FOLDERS for path in (HERE / folder).glob("*.cpp"))


def kernel_levels(machine: str) -> dict[str, list[str]]:
    """The levels of the kernel for a machine, and the compiler's flags for each."""
    # Against -ffp-contract=off, gcc 12 fuses alternating sums and differences of products, where there are such instructions.
    return {level: [f"-march={level}", "-mno-fma"] for level in KERNEL_LEVELS.get(machine, [])} or {machine: []}


def kernel_command(compiler: list[str], flags: list[str], sources: list[str], library: Path) -> list[str]:
    """The call of the C++ compiler that builds one library."""
    return [*compiler, *KERNEL_FLAGS, *flags, *(str(HERE / source) for source in sources), "-o", str(library)]


def kernel_extensions() -> list[Extension]:
    """A library for each level of this machine; none where there are no sources."""
    name = f"{NAME}.solver._kernel_{{}}"
    return [
        Extension(name.format(level.replace("-", "_")), sources=kernel_sources(), extra_compile_args=flags)
        for level, flags in kernel_levels(platform.machine()).items()
        if kernel_sources()
    ]


class BuildKernel(build_ext):
    """Compiles each level in one call of the C++ compiler, the levels side by side."""

    def finalize_options(self) -> None:
        super().finalize_options()
        self.parallel = os.cpu_count()

    def get_ext_filename(self, fullname: str) -> str:
        return str(Path(*fullname.split("."))) + ".so"

    def build_extension(self, ext: Extension) -> None:
        library = Path(self.get_ext_fullpath(ext.name)).absolute()
        library.parent.mkdir(parents=True, exist_ok=True)
        compiler = shlex.split(os.environ.get("CXX", "c++"))
        if shutil.which(compiler[0]) is None:
            raise CompileError(f"found no C++ compiler {compiler[0]}, expected one (Debian, Ubuntu: sudo apt install g++)")
        command = kernel_command(compiler, ext.extra_compile_args, ext.sources, library)
        self.announce(shlex.join(command), level=2)
        if subprocess.run(command, check=False).returncode != 0:
            raise CompileError(f"{ext.name} did not compile; the compiler's message is above")


class TagWheel(bdist_wheel):
    """One wheel for every Python from 3.12 on: the kernel is loaded with ctypes and knows none of them."""

    def get_tag(self) -> tuple[str, str, str]:
        platform_tag: str = super().get_tag()[2]
        return "py3", "none", platform_tag


# Tests and benchmarks take from here how the kernel is built.
if __name__ == "__main__":
    setup(
        name=NAME,
        version=MANIFEST.findtext("version"),
        description=MANIFEST.findtext("description"),
        license=MANIFEST.findtext("license"),
        maintainer=MANIFEST.findtext("maintainer"),
        maintainer_email=next(MANIFEST.iter("maintainer")).get("email"),
        project_urls={
            "Paper" if "arxiv" in (url.text or "") else str(url.get("type")): url.text for url in MANIFEST.iter("url")
        },
        long_description=(HERE / "README.md").read_text(encoding="utf-8"),
        long_description_content_type="text/markdown",
        python_requires=">=3.12",
        packages=find_packages(include=[NAME, f"{NAME}.*"]),
        package_data={NAME: ["py.typed", "config/*.yaml", "config/*.xml", "launch/*.launch.*"]},
        ext_modules=kernel_extensions(),
        cmdclass={"build_ext": BuildKernel, "bdist_wheel": TagWheel},
        data_files=[
            ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
            (f"share/{NAME}", ["package.xml"]),
            (f"share/{NAME}/launch", sorted(str(path.relative_to(HERE)) for path in HERE.glob(f"{NAME}/launch/*.launch.*"))),
            (f"share/{NAME}/config", sorted(str(path.relative_to(HERE)) for path in HERE.glob(f"{NAME}/config/*.*ml"))),
        ],
        install_requires=REQUIRES,
        extras_require=EXTRAS,
        entry_points={
            "console_scripts": [
                f"contact-curation = {NAME}.cli.main:main",
                *[f"{node} = {NAME}.nodes.{node}:main" for node in NODES],
            ]
        },
        zip_safe=False,
    )
