"""The kernel without Python: on this machine, and for aarch64 in an emulator, with the same bytes."""

import json
import platform
import shutil
import subprocess
from pathlib import Path

import pytest

from contact_curation.solver.compiled import usable_levels
from test.kernel.builds import build_replay, setup_module
from test.kernel.golden import DIGESTS, golden_calls, replayed, split

pytestmark = pytest.mark.slow

CROSS_COMPILER, EMULATOR = "aarch64-linux-gnu-g++", "qemu-aarch64"


def replay(folder: Path, *command: str) -> dict[str, str]:
    calls = golden_calls()
    (folder / "calls").write_bytes(replayed(calls))
    subprocess.run([*command, str(folder / "calls"), str(folder / "results")], check=True)
    return split((folder / "results").read_bytes(), calls)


def test_a_program_without_python_gives_the_same_bytes(tmp_path: Path) -> None:
    flags = setup_module().kernel_levels(platform.machine())[usable_levels()[-1]]
    build_replay("c++", tmp_path / "replay", flags)
    assert replay(tmp_path, str(tmp_path / "replay")) == json.loads(DIGESTS.read_text())["outputs"]


def test_an_emulated_aarch64_gives_the_same_bytes(tmp_path: Path) -> None:
    missing = [name for name in (CROSS_COMPILER, EMULATOR) if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{' and '.join(missing)} not found: apt install g++-aarch64-linux-gnu qemu-user")
    build_replay(CROSS_COMPILER, tmp_path / "replay", setup_module().kernel_levels("aarch64")["aarch64"])
    assert replay(tmp_path, EMULATOR, str(tmp_path / "replay")) == json.loads(DIGESTS.read_text())["outputs"]
