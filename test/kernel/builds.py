"""How tests build the kernel: with setup.py's own flags, and others on top."""

import importlib.util
import os
import subprocess
from pathlib import Path
from types import ModuleType

REPOSITORY = Path(__file__).resolve().parents[2]
REPLAY = "test/kernel/replay.cpp"


def setup_module() -> ModuleType:
    """setup.py, which sets nothing up when it is imported."""
    spec = importlib.util.spec_from_file_location("kernel_setup", REPOSITORY / "setup.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def build_kernel(compiler: str, library: Path, flags: list[str]) -> None:
    """A library of its own."""
    setup = setup_module()
    _run(setup.kernel_command([compiler], flags, setup.kernel_sources(), library))


def build_replay(compiler: str, program: Path, flags: list[str]) -> None:
    """The kernel and replay.cpp as one program, which needs no libraries."""
    setup = setup_module()
    command = setup.kernel_command([compiler], flags, [*setup.kernel_sources(), REPLAY], program)
    _run([word for word in command if word != "-shared"] + ["-static"])


def _run(command: list[str]) -> None:
    done = subprocess.run(command, env=os.environ | {"LC_ALL": "C"}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
