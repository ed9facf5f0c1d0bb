"""Finds and loads the compiled kernel: the variant built for this CPU where it fits, otherwise the portable one.

A library built with -march=native stops the process with an illegal instruction on a CPU that lacks one of the features it was
built for (a copied folder, a container image), so the features are recorded beside it and compared before it is loaded.
"""

import ctypes
import functools
import os
import platform
from pathlib import Path

from contact_curation.errors import MissingDependencyError

KERNEL_FOLDER = Path(__file__).resolve().parent
CPU_DESCRIPTION = Path("/proc/cpuinfo")
REMEDY = "build it with `make test` in a clone, or `pip install .` (both need a C++ compiler)"


@functools.cache
def load_kernel() -> ctypes.CDLL:
    """Load the kernel once per process; its functions run without the GIL.

    Raises:
        MissingDependencyError: no variant was built, or the one that fits does not load.
    """
    path = choose_kernel(KERNEL_FOLDER, cpu_features(CPU_DESCRIPTION))
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise MissingDependencyError(f"a usable kernel ({path.name}: {error})", REMEDY) from error


def choose_kernel(folder: Path, features: frozenset[str]) -> Path:
    """The kernel in `folder` for a CPU with these features.

    Raises:
        MissingDependencyError: there is none.
    """
    native, recorded, baseline = (folder / f"_kernel_{name}" for name in ("native.so", "native.flags", "baseline.so"))
    if native.exists() and recorded.exists():
        required = frozenset(recorded.read_text().split())
        if len(required) > 1 and required <= features:
            return native
    if baseline.exists():
        return baseline
    raise MissingDependencyError(f"the compiled kernel (expected {baseline})", REMEDY)


def cpu_features(description: Path) -> frozenset[str]:
    """The machine's architecture and the features that Linux lists in `description`; only the former without such a file."""
    lines = description.read_text().splitlines() if description.exists() else []
    found = next((line for line in lines if line.startswith(("flags", "Features"))), ":")
    return frozenset([platform.machine(), *found.split(":", 1)[1].split()])


@functools.cache
def processor_count() -> int:
    """How many threads can work at once; asking the system takes a tenth of a training step, and the answer stays."""
    return os.cpu_count() or 1
