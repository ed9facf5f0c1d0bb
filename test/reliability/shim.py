"""The preloaded library under which calls fail on purpose (`failing_calls.c`), and processes that run under it."""

import ctypes
import os
import shutil
import subprocess
import sys
from enum import IntEnum
from functools import cache
from pathlib import Path
from tempfile import gettempdir

import pytest

SOURCE = Path(__file__).with_name("failing_calls.c")
LIBRARY = "CONTACT_CURATION_FAILING_CALLS"
"""Environment variable with the path of the compiled library, in a process that runs under it."""


class Action(IntEnum):
    """What becomes of the n-th call, as failing_calls.c has it."""

    COUNT = 0
    FULL = 1
    """ENOSPC; a write takes half of its bytes first, and whatever needs space fails from then on."""
    BROKEN = 2
    """EIO, once."""
    KILLED = 3
    """SIGKILL; a write makes half of its bytes first."""


@cache
def compiled() -> Path:
    """The library, compiled into a folder of this process; skips the test where there is no C compiler for Linux."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        pytest.skip("no C compiler (cc) on Linux: calls cannot be made to fail")
    library = Path(gettempdir()) / f"failing_calls-{os.getpid()}.so"
    command = [compiler, "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o", str(library), str(SOURCE)]
    subprocess.run(command, check=True)
    return library


def environment() -> dict[str, str]:
    """Of a process that runs under the library."""
    library = str(compiled())
    return {**os.environ, "LD_PRELOAD": library, LIBRARY: library, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def arm(folder: Path, call: int, action: Action, trace: int = -1) -> None:
    """Calls of this process on paths below `folder` count from now on, and the one with number `call`, from 1, fails.

    Args:
        folder: with absolute path.
        call: 0 for none.
        action: what becomes of it.
        trace: descriptor that a line is written to for each counted call.
    """
    ctypes.CDLL(os.environ[LIBRARY]).arm(str(folder).encode(), ctypes.c_long(call), int(action), trace)
