"""The compiled kernel under libFuzzer, with the address sanitizer of clang.

Its arithmetic is watched in test/kernel/test_sanitizers.py: that sanitizer makes it a hundred times slower.
"""

import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
SOURCES = HERE.parents[1] / "contact_curation"
SANITIZERS = "-fsanitize=fuzzer,address"
FLAGS = ("-std=c++17", "-O2", "-g", "-ffp-contract=off", "-march=x86-64-v3")


def kernel_command(build: Path) -> list[str]:
    """The fuzzer, built; fails where there is no clang (Debian, Ubuntu: `sudo apt install clang`)."""
    compiler = shutil.which("clang++")
    if compiler is None:
        raise SystemExit("kernel: clang++ is not installed")
    fuzzer = build / "kernel_fuzzer"
    sources = [*sorted(SOURCES.glob("*/kernel/*.cpp")), HERE / "kernel_fuzzer.cpp"]
    newest = max(path.stat().st_mtime for path in [*sources, *SOURCES.glob("*/kernel/*.hpp")])
    if not fuzzer.exists() or fuzzer.stat().st_mtime < newest:
        build.mkdir(parents=True, exist_ok=True)
        folders = [f"-I{SOURCES / part / 'kernel'}" for part in ("solver", "contact")]
        command = [compiler, SANITIZERS, *FLAGS, *folders, *map(str, sources), "-lpthread", "-o", str(fuzzer)]
        subprocess.run(command, check=True)
    return [str(fuzzer)]
