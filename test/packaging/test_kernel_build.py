"""The kernel is built from whatever sources there are, for each level of this machine."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.solver.compiled import LEVELS, choose_kernel, usable_levels
from test.kernel.builds import setup_module

REPOSITORY = Path(__file__).resolve().parents[2]
SOLVER = Path("contact_curation", "solver")
X86 = LEVELS["x86_64"]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of what setup.py needs, with empty kernel folders."""
    for name in ("setup.py", "setup.cfg", "package.xml", "README.md", "LICENSE"):
        shutil.copy(REPOSITORY / name, tmp_path)
    for part in ("solver", "contact"):
        (tmp_path / "contact_curation" / part / "kernel").mkdir(parents=True)
        (tmp_path / "contact_curation" / part / "__init__.py").touch()
    (tmp_path / "contact_curation" / "__init__.py").touch()
    return tmp_path


def build(project: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-W", "ignore", "setup.py", "-q", "build_ext", "--inplace"]
    return subprocess.run(command, cwd=project, env=os.environ | environment, capture_output=True, text=True, check=False)


def test_setup_builds_the_levels_that_the_loader_looks_for() -> None:
    levels = setup_module().kernel_levels
    assert set(levels("x86_64")) == set(X86)
    assert levels("aarch64") == {"aarch64": []}
    assert all("native" not in flag for flags in levels("x86_64").values() for flag in flags)


def test_the_sources_of_both_folders_end_up_in_one_library_for_each_level(project: Path) -> None:
    (project / SOLVER / "kernel" / "shared.hpp").write_text("inline double half(double x) { return x / 2; }\n")
    for part in ("solver", "contact"):
        visible = 'extern "C" __attribute__((visibility("default")))'
        source = f'#include "shared.hpp"\n{visible} double {part}(double x) {{ return half(x); }}\n'
        (project / "contact_curation" / part / "kernel" / "source.cpp").write_text(source)
    done = build(project)
    assert done.returncode == 0, done.stderr
    for level in usable_levels():
        library = ctypes.CDLL(str(choose_kernel(project / SOLVER, [level])))
        for function in (library.solver, library.contact):
            function.restype = ctypes.c_double
            assert function(ctypes.c_double(3.0)) == 1.5


def test_without_sources_there_is_nothing_to_build_and_no_error(project: Path) -> None:
    done = build(project)
    assert done.returncode == 0, done.stderr
    assert not list((project / SOLVER).glob("_kernel*"))


@pytest.mark.parametrize(
    ("source", "compiler", "message"),
    [
        ('extern "C" int one() { return 1; }', "no-such-compiler", "found no C++ compiler no-such-compiler"),
        ('extern "C" int one() { return', "c++", f"_kernel_{usable_levels()[-1].replace('-', '_')} did not compile"),
    ],
)
def test_a_build_that_cannot_work_says_why_in_its_last_line(project: Path, source: str, compiler: str, message: str) -> None:
    (project / SOLVER / "kernel" / "source.cpp").write_text(source)
    done = build(project, CXX=compiler)
    assert done.returncode != 0
    assert message in done.stderr.splitlines()[-1]
