"""The kernel is built from whatever sources there are, and the variant that this CPU can run is the one that is loaded."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.errors import MissingDependencyError
from contact_curation.solver.compiled import CPU_DESCRIPTION, choose_kernel, cpu_features, load_kernel

REPOSITORY = Path(__file__).resolve().parents[2]
SOLVER = Path("contact_curation", "solver")


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """A folder with both variants, the native one for a CPU with avx2 and fma."""
    for name in ("_kernel_native.so", "_kernel_baseline.so"):
        (tmp_path / name).touch()
    (tmp_path / "_kernel_native.flags").write_text("x86_64 avx2 fma\n")
    return tmp_path


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


def test_the_native_variant_is_chosen_where_every_feature_is_there(built: Path) -> None:
    assert choose_kernel(built, frozenset({"x86_64", "avx2", "fma", "sse2"})).name == "_kernel_native.so"


@pytest.mark.parametrize("features", [{"x86_64", "avx2"}, {"aarch64", "avx2", "fma"}, {"x86_64"}])
def test_the_portable_variant_is_chosen_where_a_feature_is_missing(built: Path, features: set[str]) -> None:
    assert choose_kernel(built, frozenset(features)).name == "_kernel_baseline.so"


@pytest.mark.parametrize("recorded", ["", "x86_64\n"])
def test_a_native_variant_of_unknown_needs_is_not_trusted(built: Path, recorded: str) -> None:
    (built / "_kernel_native.flags").write_text(recorded)
    assert choose_kernel(built, frozenset({"x86_64", "avx2", "fma"})).name == "_kernel_baseline.so"


def test_no_kernel_at_all_is_a_missing_dependency_with_its_remedy(tmp_path: Path) -> None:
    with pytest.raises(MissingDependencyError, match=r"kernel.*make test"):
        choose_kernel(tmp_path, frozenset())


def test_the_features_are_those_of_the_first_processor(tmp_path: Path) -> None:
    (tmp_path / "cpuinfo").write_text("processor\t: 0\nflags\t\t: fpu avx2\n\nprocessor\t: 1\nflags\t\t: fpu\n")
    assert cpu_features(tmp_path / "cpuinfo") - {os.uname().machine} == {"fpu", "avx2"}
    assert cpu_features(tmp_path / "absent") == {os.uname().machine}


def test_the_installed_kernel_loads_once() -> None:
    assert load_kernel() is load_kernel()


def test_the_sources_of_both_folders_end_up_in_one_library_for_this_cpu(project: Path) -> None:
    (project / SOLVER / "kernel" / "shared.hpp").write_text("inline double half(double x) { return x / 2; }\n")
    for part in ("solver", "contact"):
        source = f'#include "shared.hpp"\nextern "C" double {part}(double x) {{ return half(x); }}\n'
        (project / "contact_curation" / part / "kernel" / "source.cpp").write_text(source)
    done = build(project)
    assert done.returncode == 0, done.stderr
    chosen = choose_kernel(project / SOLVER, cpu_features(CPU_DESCRIPTION))
    assert chosen.name == "_kernel_native.so"
    for path in (chosen, project / SOLVER / "_kernel_baseline.so"):
        library = ctypes.CDLL(str(path))
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
        ('extern "C" int one() { return', "c++", "_kernel_native did not compile"),
    ],
)
def test_a_build_that_cannot_work_says_why_in_its_last_line(project: Path, source: str, compiler: str, message: str) -> None:
    (project / SOLVER / "kernel" / "source.cpp").write_text(source)
    done = build(project, CXX=compiler)
    assert done.returncode != 0
    assert message in done.stderr.splitlines()[-1]
