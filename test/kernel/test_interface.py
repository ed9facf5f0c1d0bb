"""What Python and the kernel say to each other is compared, and a library of another version ends in one line."""

import ctypes
import subprocess
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import pytest

from contact_curation.contact import time_step
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.compiled import descent, evaluation
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.errors import InvalidValueError, MissingDependencyError
from contact_curation.solver import compiled, compiled_solver
from contact_curation.solver.compiled import CHOICE, Kernel, KernelStructure, load_kernel, usable_levels
from test.kernel.golden import golden_calls

MODULES = (compiled_solver, evaluation, descent, time_step)


@pytest.fixture
def fresh() -> Iterator[None]:
    load_kernel.cache_clear()
    yield
    load_kernel.cache_clear()


def structures() -> list[type[KernelStructure]]:
    found = [value for module in MODULES for value in vars(module).values() if isinstance(value, type)]
    return [kind for kind in found if issubclass(kind, KernelStructure) and kind is not KernelStructure]


def described() -> list[str]:
    interface = ctypes.CDLL(str(load_kernel().path)).contact_curation_interface
    interface.restype = ctypes.c_char_p
    return list(interface().decode().splitlines())


def test_every_structure_and_field_has_the_compilers_sizes_and_offsets() -> None:
    ours = {line for kind in structures() for line in compiled._described(kind)}
    assert ours == {line for line in described() if not line.startswith("function ")}
    assert len({kind.KERNEL_NAME for kind in structures()}) == 10


def test_every_function_that_the_kernel_describes_is_called_in_the_golden_case() -> None:
    names = {line.split()[1] for line in described() if line.startswith("function ")}
    assert {call.function for call in golden_calls()} == names


@pytest.mark.parametrize(
    "made",
    [
        lambda geometry: evaluation.CompiledModel(geometry, CONTACTNETS_CUBE, DEFAULT_LOSS),
        lambda geometry: time_step.CompiledWorld(geometry, CONTACTNETS_CUBE, time_step.DEFAULT_LIMITS),
    ],
)
def test_a_structure_keeps_alive_what_it_points_to(made: Callable[[ContactGeometry], Any]) -> None:
    geometry = ContactGeometry.of_body(CONTACTNETS_CUBE)
    known, structure = weakref.ref(geometry), made(geometry)
    del geometry
    kept = known()
    assert kept is not None
    assert structure.tangents == kept.tangents.ctypes.data


class Wrong(KernelStructure):
    """`AdamWConfig` with its fields exchanged."""

    KERNEL_NAME: ClassVar[str] = "AdamWConfig"
    _fields_ = (("decay", ctypes.c_double), ("rate", ctypes.c_double))


class Holder(KernelStructure):
    """`Network` with such a field."""

    KERNEL_NAME: ClassVar[str] = "Network"
    _fields_ = (("layers", Wrong * 2),)


@pytest.mark.parametrize(
    ("name", "arguments", "told"),
    [
        ("contact_curation_solve_cones", [ctypes.POINTER(Wrong)], "no field AdamWConfig.decay at 0 of 8 bytes"),
        ("contact_curation_solve_cones", [ctypes.POINTER(Holder)], "no structure Network of 1 fields in 32 bytes"),
        ("contact_curation_solve_cones", [ctypes.c_int64], "no function contact_curation_solve_cones int32 of int64"),
        ("contact_curation_of_the_future", [ctypes.c_void_p], "no function contact_curation_of_the_future int32 of address"),
    ],
)
def test_another_versions_function_or_structure_ends_in_one_line(name: str, arguments: list[type], told: str) -> None:
    with pytest.raises(MissingDependencyError) as caught:
        load_kernel().function(name, ctypes.c_int, *arguments)
    assert told in str(caught.value)
    assert "make test" in str(caught.value)


def test_a_kernel_from_before_the_comparison_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "old.cpp").write_text('extern "C" int contact_curation_solve_cones(void *) { return 0; }\n')
    subprocess.run(["c++", "-shared", "-fPIC", "old.cpp", "-o", "old.so"], cwd=tmp_path, check=True)
    with pytest.raises(MissingDependencyError, match=r"old.so.*contact_curation_interface.*make test"):
        Kernel(tmp_path / "old.so")


@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize("level", usable_levels())
def test_the_environment_chooses_a_level(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CHOICE, level)
    assert load_kernel().path.name == f"_kernel_{level.replace('-', '_')}.so"


@pytest.mark.usefixtures("fresh")
def test_the_environment_chooses_a_library_by_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    path = load_kernel().path
    load_kernel.cache_clear()
    monkeypatch.setenv(CHOICE, str(path))
    assert load_kernel().path == path
    load_kernel.cache_clear()
    monkeypatch.setenv(CHOICE, "/nowhere/kernel.so")
    with pytest.raises(MissingDependencyError, match=r"a usable kernel \(kernel.so"):
        load_kernel()


@pytest.mark.usefixtures("fresh")
@pytest.mark.parametrize("level", ["x86-64-v9", "native"])
def test_a_level_that_this_cpu_has_not_is_refused_with_those_it_has(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CHOICE, level)
    with pytest.raises(
        InvalidValueError, match=f"{CHOICE}: found {level}, expected a level of this CPU .*{usable_levels()[-1]}"
    ):
        load_kernel()
