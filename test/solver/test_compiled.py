"""The kernel that is loaded: of the levels that this CPU has, the highest that was built, or the one that is chosen."""

from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.solver.compiled import CHOICE, LEVELS, REMEDY, choose_kernel, cpu_features, load_kernel, usable_levels

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


def test_the_highest_level_that_was_built_is_taken(built: Path) -> None:
    assert choose_kernel(built, list(X86)).name == "_kernel_x86_64_v4.so"
    assert choose_kernel(built, list(X86)[1:]).name == "_kernel_x86_64_v3.so"
    (built / "_kernel_x86_64_v4.so").unlink()
    assert choose_kernel(built, list(X86)).name == "_kernel_x86_64_v3.so"


def test_a_chosen_level_is_taken_or_missed(built: Path) -> None:
    assert choose_kernel(built, list(X86), "x86-64-v2").name == "_kernel_x86_64_v2.so"
    with pytest.raises(InvalidValueError) as refused:
        choose_kernel(built, list(X86)[1:], "x86-64-v4")
    levels = "a level of this CPU (x86-64-v3, x86-64-v2)"
    assert str(refused.value) == f"{CHOICE}: found x86-64-v4, expected {levels} or the path of a library"
    (built / "_kernel_x86_64_v3.so").unlink()
    with pytest.raises(MissingDependencyError) as missed:
        choose_kernel(built, list(X86), "x86-64-v3")
    assert str(missed.value) == f"the compiled kernel (expected {built}/_kernel_x86_64_v3.so) is missing: {REMEDY}"


def test_no_kernel_at_all_is_a_missing_dependency_with_its_remedy(tmp_path: Path) -> None:
    for usable, expected in (([], "CPU features of x86-64-v2 or higher"), (["aarch64"], f"{tmp_path}/_kernel_aarch64.so")):
        with pytest.raises(MissingDependencyError) as missed:
            choose_kernel(tmp_path, usable)
        assert str(missed.value) == f"the compiled kernel (expected {expected}) is missing: {REMEDY}"


def test_the_features_are_those_of_the_first_processor(tmp_path: Path) -> None:
    assert cpu_features(described(tmp_path, {"avx2"})) == {"fpu", "avx2"}
    assert cpu_features(tmp_path / "absent") == set()


def test_the_installed_kernel_loads_once() -> None:
    assert load_kernel() is load_kernel()
