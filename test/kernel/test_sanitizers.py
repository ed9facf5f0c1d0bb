"""The tests of the solver and of contact with a kernel that watches its memory and its arithmetic."""

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.solver.compiled import CHOICE, usable_levels
from test.kernel.builds import REPOSITORY, build_kernel, setup_module

pytestmark = pytest.mark.slow

SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer", "-g", "-O1"]
"""The last level of optimisation counts."""
GOLDEN = "test/kernel/test_levels.py::test_the_kernel_that_is_loaded_gives_the_bytes_in_the_repository"
WATCHED = ("test/solver", "test/contact", GOLDEN)


def runtime_library(name: str) -> Path | None:
    """One of the compiler's own; none where it has no such library."""
    found = Path(subprocess.run(["c++", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout.strip())
    return found.resolve() if found.is_absolute() and found.exists() else None


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """In which Python loads a kernel with AddressSanitizer and UndefinedBehaviorSanitizer."""
    libraries = [runtime_library(name) for name in ("libasan.so", "libstdc++.so")]
    if not all(libraries):
        pytest.skip("the compiler has no libasan: apt install libgcc-12-dev or the like")
    kernel = tmp_path_factory.mktemp("sanitized") / "kernel.so"
    build_kernel("c++", kernel, [*setup_module().kernel_levels(platform.machine())[usable_levels()[0]], *SANITIZERS])
    # Python itself and its libraries leave memory behind when they end; only the kernel is of interest.
    options = {"ASAN_OPTIONS": "detect_leaks=0:abort_on_error=1", "UBSAN_OPTIONS": "print_stacktrace=1"}
    return os.environ | options | {CHOICE: str(kernel), "LD_PRELOAD": " ".join(map(str, libraries)), "PYTHONMALLOC": "malloc"}


def test_the_sanitizers_watch(environment: dict[str, str]) -> None:
    code = """
import ctypes
import numpy as np
from contact_curation.solver.compiled import load_kernel
powers = load_kernel().function("contact_curation_powers", None, ctypes.c_int64, *3 * [ctypes.c_void_p])
bases, exponents = np.ones(64), np.ones(64, np.int64)
powers(65, bases.ctypes.data, exponents.ctypes.data, np.ones(64).ctypes.data)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "heap-buffer-overflow" in done.stderr


def test_the_solver_and_contact_have_no_errors_of_memory_or_arithmetic(environment: dict[str, str]) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *WATCHED]
    done = subprocess.run(command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (done.stdout + done.stderr)[-6000:]
