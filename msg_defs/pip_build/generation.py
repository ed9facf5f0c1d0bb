"""From definitions to sources: the stages that ament_cmake's rosidl_generate_interfaces runs, called in the same order.

.msg/.srv/.action -> .idl -> type description (JSON, with the RIHS01 type hash) -> C, type supports and Python. The hash is a
function of the type description alone, so that a colcon build of the same definitions announces the same types. The generators
are called through their Python functions: the `rosidl` command stops at entry points that the wheels register twice.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rosidl_generator_c
import rosidl_generator_py
import rosidl_generator_type_description
import rosidl_typesupport_c
import rosidl_typesupport_fastrtps_c
import rosidl_typesupport_introspection_c
from rosidl_adapter import convert_to_idl

from pip_build.interface_package import InterfacePackage

TYPE_SUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")
"""What the dispatching rosidl_typesupport_c chooses from at run time."""
ALL_TYPE_SUPPORTS = ("rosidl_typesupport_c", *TYPE_SUPPORTS)

_GENERATORS: dict[str, Callable[[str], Any]] = {
    "rosidl_generator_c": rosidl_generator_c.generate_c,
    "rosidl_typesupport_fastrtps_c": rosidl_typesupport_fastrtps_c.generate_typesupport_fastrtps_c,
    "rosidl_typesupport_introspection_c": rosidl_typesupport_introspection_c.generate_c,
    "rosidl_typesupport_c": lambda arguments: rosidl_typesupport_c.generate_c(arguments, list(TYPE_SUPPORTS)),
    "rosidl_generator_py": lambda arguments: rosidl_generator_py.generate_py(arguments, list(ALL_TYPE_SUPPORTS)),
}


@dataclass(frozen=True)
class GeneratedSources:
    """Where each generator wrote; every folder holds one folder named after the package.

    Attributes:
        package: what was generated.
        roots: output folder per generator, such as `roots["rosidl_generator_c"]`.
        shared: files for share/PACKAGE, as (kind, path): definitions, .idl and type descriptions.
    """

    package: InterfacePackage
    roots: dict[str, Path]
    shared: tuple[tuple[str, Path], ...]

    def sources(self, generator: str, suffix: str) -> list[Path]:
        """All files of a generator that end in `suffix`, sorted."""
        return sorted((self.roots[generator] / self.package.name).rglob(f"*{suffix}"))


def generate(package: InterfacePackage, build: Path) -> GeneratedSources:
    """Write all sources of `package` below `build`."""
    idl_tuples = _translate(package, build / "idl" / package.name)
    descriptions = describe(package, build)
    description_tuples = [f"{entry.rsplit(':', 1)[1]}:{_description_of(entry, descriptions)}" for entry in idl_tuples]
    roots = {name: build / name for name in _GENERATORS}
    for name, run in _GENERATORS.items():
        output = roots[name] / package.name
        _write_visibility_header(package.name, name, output)
        run(
            _arguments(
                package,
                idl_tuples,
                output,
                template_dir=str(_templates(name)),
                type_description_tuples=description_tuples,
                ros_interface_files=[str(package.folder / path) for path in package.definitions],
            )
        )
    (roots["rosidl_generator_py"] / package.name / "__init__.py").write_text("")
    originals = [(path.parts[0], package.folder / path) for path in package.definitions]
    idls = [(path.parts[0], build / "idl" / package.name / path.with_suffix(".idl")) for path in package.definitions]
    described = [(path.parent.name, path) for path in descriptions]
    return GeneratedSources(package, roots, tuple(originals + idls + described))


def describe(package: InterfacePackage, build: Path) -> list[Path]:
    """Write and list the type descriptions: JSON files that hold each type's fields and its RIHS01 hash."""
    idl_tuples = _translate(package, build / "idl" / package.name)
    output = build / "rosidl_generator_type_description" / package.name
    include_paths = [f"{name}:{Path(sys.prefix) / 'share' / name}" for name in package.depends]
    arguments = _arguments(package, idl_tuples, output, include_paths=include_paths)
    return [Path(path) for path in rosidl_generator_type_description.generate_type_hash(arguments)]


def _translate(package: InterfacePackage, output: Path) -> list[str]:
    """Write each definition as .idl; gives the generators' "folder:relative path" tuples."""
    for path in package.definitions:
        convert_to_idl(package.folder, package.name, path, output)
    return [f"{output}:{path.with_suffix('.idl').as_posix()}" for path in package.definitions]


def _description_of(idl_tuple: str, descriptions: list[Path]) -> Path:
    relative = Path(idl_tuple.rsplit(":", 1)[1])
    return next(path for path in descriptions if (path.parent.name, path.stem) == (relative.parent.name, relative.stem))


def _arguments(package: InterfacePackage, idl_tuples: list[str], output: Path, **more: object) -> str:
    """Write a generator's arguments file; gives its path."""
    output.mkdir(parents=True, exist_ok=True)
    content = {"package_name": package.name, "output_dir": str(output), "idl_tuples": idl_tuples, "target_dependencies": []}
    path = output / "arguments.json"
    path.write_text(json.dumps(content | more, indent=2))
    return str(path)


def _templates(generator: str) -> Path:
    return Path(sys.prefix) / "share" / generator / "resource"


def _write_visibility_header(package: str, generator: str, output: Path) -> None:
    """Fill in the header of export macros that the generated headers include; not every generator has one."""
    for template in _templates(generator).glob("*__visibility_control.h.in"):
        content = template.read_text().replace("@PROJECT_NAME@", package).replace("@PROJECT_NAME_UPPER@", package.upper())
        (output / "msg").mkdir(parents=True, exist_ok=True)
        (output / "msg" / template.name.removesuffix(".in")).write_text(content)
