"""The kernel is built from whatever sources there are, for each level of this machine; the highest of the CPU is loaded."""

import ctypes
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.solver.compiled import LEVELS, choose_kernel, cpu_features, load_kernel, usable_levels
from test.kernel.builds import setup_module

REPOSITORY = Path(__file__).resolve().parents[2]
SOLVER = Path("contact_curation", "solver")
X86 = LEVELS["x86_64"]


@pytest.fixture
def built(tmp_path: Path) -> Path:
    """A folder with all of x86's levels."""
    for level in X86:
        (tmp_path / f"_kernel_{level.replace('-', '_')}.so").touch()
    return tmp_path


def described(folder: Path, features: set[str]) -> Path:
    """What Linux says of a CPU with these features, and of a lesser second one."""
    path = folder / "cpuinfo"
    path.write_text(f"processor\t: 0\nflags\t\t: fpu {' '.join(sorted(features))}\n\nprocessor\t: 1\nflags\t\t: fpu\n")
    return path


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


def test_a_cpu_has_the_levels_whose_every_feature_it_has(tmp_path: Path) -> None:
    everything = X86["x86-64-v4"]
    assert usable_levels("x86_64", described(tmp_path, everything)) == ["x86-64-v4", "x86-64-v3", "x86-64-v2"]
    for feature in everything:
        usable = usable_levels("x86_64", described(tmp_path, everything - {feature}))
        assert usable == [level for level, needed in X86.items() if feature not in needed]
    assert usable_levels("x86_64", tmp_path / "absent") == []


def test_each_level_has_the_features_of_the_one_below_and_more() -> None:
    fourth, third, second = X86.values()
    assert fourth > third > second


def test_a_machine_of_another_kind_has_one_level_of_its_name(tmp_path: Path) -> None:
    assert usable_levels("aarch64", tmp_path / "absent") == ["aarch64"]


def test_setup_builds_the_levels_that_the_loader_looks_for() -> None:
    levels = setup_module().kernel_levels
    assert set(levels("x86_64")) == set(X86)
    assert levels("aarch64") == {"aarch64": []}
    assert all("native" not in flag for flags in levels("x86_64").values() for flag in flags)


def test_the_highest_level_that_was_built_is_taken(built: Path) -> None:
    assert choose_kernel(built, list(X86)).name == "_kernel_x86_64_v4.so"
    assert choose_kernel(built, list(X86)[1:]).name == "_kernel_x86_64_v3.so"
    (built / "_kernel_x86_64_v4.so").unlink()
    assert choose_kernel(built, list(X86)).name == "_kernel_x86_64_v3.so"


def test_a_chosen_level_is_taken_or_missed(built: Path) -> None:
    assert choose_kernel(built, list(X86), "x86-64-v2").name == "_kernel_x86_64_v2.so"
    with pytest.raises(InvalidValueError, match=r"found x86-64-v4, expected a level of this CPU \(x86-64-v2\)"):
        choose_kernel(built, ["x86-64-v2"], "x86-64-v4")
    (built / "_kernel_x86_64_v3.so").unlink()
    with pytest.raises(MissingDependencyError, match=r"_kernel_x86_64_v3\.so.*make test"):
        choose_kernel(built, list(X86), "x86-64-v3")


@pytest.mark.parametrize("usable", [[], ["x86-64-v2"]])
def test_no_kernel_at_all_is_a_missing_dependency_with_its_remedy(tmp_path: Path, usable: list[str]) -> None:
    with pytest.raises(MissingDependencyError, match=r"kernel.*x86.64.v2.*make test"):
        choose_kernel(tmp_path, usable)


def test_the_features_are_those_of_the_first_processor(tmp_path: Path) -> None:
    assert cpu_features(described(tmp_path, {"avx2"})) == {"fpu", "avx2"}
    assert cpu_features(tmp_path / "absent") == set()


def test_the_installed_kernel_loads_once() -> None:
    assert load_kernel() is load_kernel()


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
