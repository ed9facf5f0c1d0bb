"""Finds and loads the compiled kernel: the library built for the highest level that this CPU has.

Levels are named sets of CPU features, x86-64-v2 to x86-64-v4; machines of another kind have one level of the machine's own
name. All levels give the same bytes. CONTACT_CURATION_KERNEL names another level than the highest, or a library's path.

Before the first call of a function, its arguments and the sizes and offsets of its structures are compared with those of the
library (contact/kernel/interface.cpp). A library of another version is refused with one line.
"""

import ctypes
import functools
import os
import platform
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

from contact_curation.errors import InvalidValueError, MissingDependencyError

KERNEL_FOLDER = Path(__file__).resolve().parent
CPU_DESCRIPTION = Path("/proc/cpuinfo")
REMEDY = "build it with `make test` in a clone, or `pip install .` (both need a C++ compiler)"

CHOICE = "CONTACT_CURATION_KERNEL"
"""The environment variable that chooses a level, or a library by its path."""

_V2 = {"cx16", "lahf_lm", "popcnt", "pni", "ssse3", "sse4_1", "sse4_2"}
_V3 = _V2 | {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "xsave"}
_V4 = _V3 | {"avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl"}
LEVELS = {"x86_64": {"x86-64-v4": _V4, "x86-64-v3": _V3, "x86-64-v2": _V2}}
"""Features of each level as Linux calls them, by machine, highest first (x86-64 psABI, "Micro-Architecture Levels")."""


class KernelStructure(ctypes.Structure):
    """A structure that the kernel reads; fields have the names, order and types of the C++ structure `KERNEL_NAME`."""

    KERNEL_NAME: ClassVar[str]


class Kernel:
    """A loaded library; its functions run without the GIL.

    Args:
        path: path of the library.

    Raises:
        MissingDependencyError: the library does not load, or lacks the description of its interface.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._library = ctypes.CDLL(str(path))
            interface = self._library.contact_curation_interface
        except (OSError, AttributeError) as error:
            raise MissingDependencyError(f"a usable kernel ({path.name}: {error})", REMEDY) from error
        interface.restype = ctypes.c_char_p
        self._known = frozenset(interface().decode().splitlines())
        self._functions: dict[tuple[object, ...], Callable[..., Any]] = {}

    def function(self, name: str, result: type | None, *arguments: type) -> Callable[..., Any]:
        """One of the kernel's functions; addresses of structures are `ctypes.POINTER(...)` of a `KernelStructure`.

        Raises:
            MissingDependencyError: the library has another function or structure of that name.
        """
        key = name, result, *arguments
        if key not in self._functions:
            structures = [kind for argument in arguments for kind in _structures(argument)]
            expected = [
                _described_function(name, result, arguments),
                *(line for kind in structures for line in _described(kind)),
            ]
            unknown = next((line for line in expected if line not in self._known), None)
            if unknown is not None:
                raise MissingDependencyError(f"a kernel of this version ({self.path.name} has no {unknown})", REMEDY)
            self._functions[key] = ctypes.CFUNCTYPE(result, *arguments)((name, self._library))
        return self._functions[key]


def _structures(kind: Any) -> Iterator[type[KernelStructure]]:
    """The kernel structures that an argument or a field is, points to or contains."""
    inner = getattr(kind, "_type_", None)
    if isinstance(inner, type):
        yield from _structures(inner)
    elif isinstance(kind, type) and issubclass(kind, KernelStructure):
        yield kind
        for _, field, *_ in kind._fields_:
            yield from _structures(field)


def _described(kind: type[KernelStructure]) -> Iterator[str]:
    """Describes a structure in the format of kernel/interface.cpp."""
    yield f"structure {kind.KERNEL_NAME} of {len(kind._fields_)} fields in {ctypes.sizeof(kind)} bytes"
    for name, *_ in kind._fields_:
        place = getattr(kind, name)
        yield f"field {kind.KERNEL_NAME}.{name} at {place.offset} of {place.size} bytes"


def _described_function(name: str, result: type | None, arguments: tuple[type, ...]) -> str:
    """Describes a function's result and arguments in the format of kernel/interface.cpp."""
    return f"function {name} {_type_name(result)} of {' '.join(map(_type_name, arguments))}"


def _type_name(kind: Any) -> str:
    if kind is None:
        return "nothing"
    return (
        "address" if kind is ctypes.c_void_p or not issubclass(kind, ctypes._SimpleCData) else f"int{8 * ctypes.sizeof(kind)}"
    )


@functools.cache
def load_kernel() -> Kernel:
    """Load the kernel once per process.

    Raises:
        InvalidValueError: CONTACT_CURATION_KERNEL is neither a level of this CPU nor the path of a library.
        MissingDependencyError: no library was built for a level of this CPU, or it does not load.
    """
    chosen = os.environ.get(CHOICE, "")
    return Kernel(Path(chosen) if "/" in chosen else choose_kernel(KERNEL_FOLDER, usable_levels(), chosen))


def choose_kernel(folder: Path, usable: list[str], chosen: str = "") -> Path:
    """The library in `folder` for the first of the `usable` levels that was built, or for the `chosen` one.

    Raises:
        InvalidValueError: `chosen` is not one of the usable levels.
        MissingDependencyError: the library was not built.
    """
    if chosen and chosen not in usable:
        raise InvalidValueError(CHOICE, chosen, f"a level of this CPU ({', '.join(usable)}) or the path of a library")
    paths = [folder / f"_kernel_{level.replace('-', '_')}.so" for level in ([chosen] if chosen else usable)]
    found = next((path for path in paths if path.exists()), None)
    if found is None:
        expected = paths[0] if paths else "CPU features of x86-64-v2 or higher"
        raise MissingDependencyError(f"the compiled kernel (expected {expected})", REMEDY)
    return found


def usable_levels(machine: str | None = None, description: Path = CPU_DESCRIPTION) -> list[str]:
    """The levels that this CPU has, highest first.

    Args:
        machine: kind of machine, for example x86_64; by default that of this machine.
        description: file in which Linux describes the CPUs.
    """
    machine = machine or platform.machine()
    if machine not in LEVELS:
        return [machine]
    features = cpu_features(description)
    return [level for level, needed in LEVELS[machine].items() if needed <= features]


def cpu_features(description: Path) -> frozenset[str]:
    """The features of the first CPU that Linux lists in `description`; none without such a file."""
    if not description.exists():
        return frozenset()
    with description.open(encoding="utf-8") as lines:
        found = next((line for line in lines if line.startswith("flags")), ":")
    return frozenset(found.split(":", 1)[1].split())


@functools.cache
def processor_count() -> int:
    """Number of threads that can run at once; cached, because the system call takes a tenth of a training step."""
    return os.cpu_count() or 1
