"""Installs contact_curation with pip or colcon and builds its kernel; names and version come from package.xml.

The kernel is one shared library with a plain C interface, loaded with ctypes: no tie to the ABI of an interpreter or of torch,
the GIL is free while it runs, and it builds in seconds. It is built for this CPU, and again for any CPU of its kind.
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

HERE = Path(__file__).resolve().parent
MANIFEST = ElementTree.parse(HERE / "package.xml").getroot()
NAME = MANIFEST.findtext("name", "")

NODES = [
    *("pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "sim_camera", "player"),
    "session_recorder",
    "dashboard",
]

KERNEL_FOLDERS = [Path(NAME, "solver", "kernel"), Path(NAME, "contact", "kernel")]
KERNEL_FLAGS = ["-std=c++17", "-O3", "-fno-math-errno", "-ffp-contract=fast", "-funroll-loops", "-fvisibility-inlines-hidden"]
# Vectors wider than a CPU's registers are passed in memory; both ends are in this library, so the psABI note is of no interest.
# Arrays have room for the most contacts there may be, and only those there are get filled: gcc 12 takes that for a mistake.
KERNEL_FLAGS += [
    "-Wall",
    "-Wextra",
    "-Wno-psabi",
    "-Wno-maybe-uninitialized",
    "-fPIC",
    "-shared",
    "-pthread",
    f"-I{HERE / KERNEL_FOLDERS[0]}",
]
KERNEL_VARIANTS = {"_kernel_native": ["-march=native"], "_kernel_baseline": []}


def kernel_sources() -> list[str]:
    """All C++ files of the kernel, relative to this file, as setuptools wants them."""
    return sorted(str(path.relative_to(HERE)) for folder in KERNEL_FOLDERS for path in (HERE / folder).glob("*.cpp"))


def cpu_features() -> str:
    """The features that the Linux kernel reports for this CPU, sorted; empty where it reports none."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    found = next((line for line in lines if line.startswith(("flags", "Features"))), ":")
    return " ".join(sorted(found.split(":", 1)[1].split()))


class BuildKernel(build_ext):
    """Compiles each variant in one call of the C++ compiler; beside the native one it writes the features it needs."""

    def finalize_options(self) -> None:
        super().finalize_options()
        self.parallel = len(KERNEL_VARIANTS)

    def get_ext_filename(self, fullname: str) -> str:
        return str(Path(*fullname.split("."))) + ".so"

    def build_extension(self, ext: Extension) -> None:
        library = Path(self.get_ext_fullpath(ext.name)).absolute()
        library.parent.mkdir(parents=True, exist_ok=True)
        compiler = shlex.split(os.environ.get("CXX", "c++"))
        if shutil.which(compiler[0]) is None:
            raise CompileError(f"found no C++ compiler {compiler[0]}, expected one (Debian, Ubuntu: sudo apt install g++)")
        command = [*compiler, *KERNEL_FLAGS, *ext.extra_compile_args, *(str(HERE / source) for source in ext.sources)]
        command += ["-o", str(library)]
        self.announce(shlex.join(command), level=2)
        if subprocess.run(command, check=False).returncode != 0:
            raise CompileError(f"{ext.name} did not compile; the compiler's message is above")
        if ext.extra_compile_args:
            library.with_suffix(".flags").write_text(f"{platform.machine()} {cpu_features()}\n")

    def copy_extensions_to_source(self) -> None:
        super().copy_extensions_to_source()
        for built in Path(self.build_lib, NAME).rglob("*.flags"):
            self.copy_file(str(built), str(HERE / built.relative_to(self.build_lib)))


setup(
    name=NAME,
    version=MANIFEST.findtext("version"),
    description=MANIFEST.findtext("description"),
    license=MANIFEST.findtext("license"),
    maintainer=MANIFEST.findtext("maintainer"),
    maintainer_email=next(MANIFEST.iter("maintainer")).get("email"),
    long_description=(HERE / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    python_requires=">=3.12",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "config/*.yaml", "launch/*.py"]},
    ext_modules=[
        Extension(f"{NAME}.solver.{variant}", sources=kernel_sources(), extra_compile_args=flags)
        for variant, flags in KERNEL_VARIANTS.items()
        if kernel_sources()
    ],
    cmdclass={"build_ext": BuildKernel},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", sorted(str(path.relative_to(HERE)) for path in HERE.glob(f"{NAME}/launch/*.py"))),
        (f"share/{NAME}/config", sorted(str(path.relative_to(HERE)) for path in HERE.glob(f"{NAME}/config/*.yaml"))),
    ],
    install_requires=[
        "cmaes",
        "daqp",
        "matplotlib",
        "mcap",
        "mink",
        "mujoco",
        "numpy>=1.26",
        "opencv-python-headless",
        "pupil-apriltags",
        "pyarrow",
        "PyYAML",
        "rerun-sdk",
        "rosbags",
        "safetensors",
        "scipy",
        "torch",
        "tqdm",
        "zstandard",
    ],
    entry_points={
        "console_scripts": [
            f"contact-curation = {NAME}.cli.main:main",
            *[f"{node} = {NAME}.nodes.{node}:main" for node in NODES],
        ]
    },
    zip_safe=False,
)
