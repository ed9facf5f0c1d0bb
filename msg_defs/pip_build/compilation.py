"""From generated sources to the libraries of an interface package, compiled against this environment's headers and libraries.

Names and contents are ament_cmake's: five shared libraries that the type support dispatch finds by name in the library path,
and one Python extension per type support.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pip_build.generation import ALL_TYPE_SUPPORTS, GeneratedSources

PREFIX = Path(sys.prefix)
OURS = "this package's "
SHARED_LIBRARIES: dict[str, tuple[str, tuple[str, ...]]] = {
    "rosidl_generator_c": (".c", ("rosidl_runtime_c", "rcutils")),
    "rosidl_typesupport_fastrtps_c": (
        ".cpp",
        (
            f"{OURS}rosidl_generator_c",
            "rosidl_typesupport_fastrtps_c",
            "rosidl_typesupport_fastrtps_cpp",
            "fastcdr",
            "rosidl_runtime_c",
        ),
    ),
    "rosidl_typesupport_introspection_c": (
        ".c",
        (f"{OURS}rosidl_generator_c", "rosidl_typesupport_introspection_c", "rosidl_runtime_c"),
    ),
    "rosidl_typesupport_c": (".cpp", (f"{OURS}rosidl_generator_c", "rosidl_typesupport_c", "rosidl_runtime_c")),
    "rosidl_generator_py": ("_s.c", (f"{OURS}rosidl_generator_c", f"{OURS}rosidl_typesupport_c", "rosidl_runtime_c")),
}
"""Per generator: the ending of its sources, and what its library links."""


@dataclass(frozen=True)
class Library:
    """A shared library to build.

    Attributes:
        target: file to write.
        sources: C or C++ files, all of one language.
        links: libraries by name, without lib and .so.
        rpath: where the loader looks for the package's other libraries, relative to this one.
    """

    target: Path
    sources: tuple[Path, ...]
    links: tuple[str, ...]
    rpath: str


def compile_all(generated: GeneratedSources, libraries: Path, modules: Path) -> None:
    """Build the shared libraries into `libraries` and the Python extensions into `modules`.

    Raises:
        RuntimeError: a compiler or Python's headers are missing, or a source does not compile; says which.
    """
    check_tools()
    libraries.mkdir(parents=True, exist_ok=True)
    shared = _shared_libraries(generated, libraries)
    extensions = _extensions(generated, modules)
    includes = _includes(generated)
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        compiled = {
            library.target: [pool.submit(_compile, source, includes) for source in library.sources]
            for library in (*shared, *extensions)
        }
        for library in (*shared, *extensions):
            _link(library, [task.result() for task in compiled[library.target]], libraries)


def check_tools() -> None:
    """Raise RuntimeError when no C++ compiler or no Python.h is there; the message says what to install."""
    if shutil.which(_compiler(".c")[0]) is None or shutil.which(_compiler(".cpp")[0]) is None:
        raise RuntimeError("no C++ compiler: found none, expected cc and c++ (Debian, Ubuntu: sudo apt install g++)")
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        raise RuntimeError(f"no Python headers: found no {header} (Ubuntu 24.04: sudo apt install python3.12-dev)")


def _shared_libraries(generated: GeneratedSources, folder: Path) -> list[Library]:
    """The libraries in the order of their dependence; each links its namesakes of the packages that this one depends on."""
    name = generated.package.name
    libraries = []
    for generator, (suffix, links) in SHARED_LIBRARIES.items():
        ours = [f"{name}__{link.removeprefix(OURS)}" if link.startswith(OURS) else link for link in links]
        others = [f"{depend}__{generator}" for depend in generated.package.depends]
        target = folder / f"lib{name}__{generator}.so"
        libraries.append(Library(target, tuple(generated.sources(generator, suffix)), (*ours, *others), "$ORIGIN"))
    return libraries


def _extensions(generated: GeneratedSources, modules: Path) -> list[Library]:
    """The Python extensions, which hand the C type supports to rclpy."""
    name = generated.package.name
    extensions = []
    for support in ALL_TYPE_SUPPORTS:
        target = modules / name / f"{name}_s__{support}{sysconfig.get_config_var('EXT_SUFFIX')}"
        sources = tuple(generated.sources("rosidl_generator_py", f".ep.{support}.c"))
        ours = dict.fromkeys(("rosidl_generator_py", "rosidl_typesupport_c", "rosidl_generator_c", support))
        links = (*(f"{name}__{generator}" for generator in ours), support, "rosidl_runtime_c")
        extensions.append(Library(target, sources, links, "$ORIGIN/../../.."))
    return extensions


def _includes(generated: GeneratedSources) -> list[str]:
    # ROS packages keep their headers in include/PACKAGE/PACKAGE, others (fastcdr) in include/PACKAGE.
    environment = [PREFIX / "include", *sorted(path for path in (PREFIX / "include").iterdir() if (path / path.name).is_dir())]
    folders = [*generated.roots.values(), *environment, Path(sysconfig.get_path("include")), Path(np.get_include())]
    return [f"-I{folder}" for folder in folders]


def _compile(source: Path, includes: list[str]) -> Path:
    target = source.with_suffix(".o")
    standard = "-std=c++17" if source.suffix == ".cpp" else "-std=gnu11"
    _run([*_compiler(source.suffix), standard, "-O2", "-fPIC", *includes, "-c", str(source), "-o", str(target)])
    return target


def _link(library: Library, objects: list[Path], libraries: Path) -> None:
    library.target.parent.mkdir(parents=True, exist_ok=True)
    search = [f"-L{libraries}", f"-L{PREFIX / 'lib'}", f"-Wl,-rpath,{library.rpath}"]
    links = [f"-l{name}" for name in library.links]
    _run([*_compiler(".cpp"), "-shared", "-o", str(library.target), *map(str, objects), *search, *links])


def _compiler(suffix: str) -> list[str]:
    return (os.environ.get("CXX") or "c++").split() if suffix == ".cpp" else (os.environ.get("CC") or "cc").split()


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{done.stderr}failed: {' '.join(command)}")
