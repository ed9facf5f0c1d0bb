"""A wheel of an interface package: the Python module in site-packages, the libraries in lib, the definitions in share.

That is where the ros-* wheels put theirs, and where rclpy and the type support dispatch look.
"""

import shutil
from pathlib import Path
from typing import Any

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

from pip_build.interface_package import InterfacePackage, read_interface_package


def setup_interface_package(folder: Path, distribution: str) -> None:
    """Call setuptools' `setup` for the interface package in `folder`, as a distribution of the given name."""
    package = read_interface_package(folder)
    setup(
        name=distribution,
        version=package.version,
        description=package.description,
        license=package.license,
        python_requires=">=3.12",
        packages=[],
        # One nominal extension makes setuptools build a platform wheel; the command below builds the real ones.
        ext_modules=[Extension(f"{package.name}.{package.name}_s__rosidl_typesupport_c", sources=[])],
        cmdclass={"build_ext": _command(package)},
    )


def _command(package: InterfacePackage) -> type[build_ext]:
    class BuildInterfaces(build_ext):
        """Generates, compiles and lays out an interface package."""

        def run(self) -> None:
            # Imported here: metadata can be asked for where the generators are not installed.
            from pip_build.compilation import compile_all
            from pip_build.generation import generate

            build = Path(self.build_temp).resolve() / package.name
            modules = Path(self.build_lib).resolve()
            for stale in (build, modules / package.name):  # a definition that is gone must leave nothing behind
                shutil.rmtree(stale, ignore_errors=True)
            generated = generate(package, build)
            for source in generated.sources("rosidl_generator_py", ".py"):
                target = modules / source.relative_to(generated.roots["rosidl_generator_py"])
                self.mkpath(str(target.parent))
                self.copy_file(str(source), str(target))
            compile_all(generated, build / "lib", modules)
            self.distribution.data_files = _data_files(package, build, generated.shared)

    return BuildInterfaces


def _data_files(package: InterfacePackage, build: Path, shared: tuple[tuple[str, Path], ...]) -> list[tuple[str, list[str]]]:
    """Libraries, definitions and the markers of the ament resource index, by their place below the prefix."""
    index = build / "index"
    (index / "packages").mkdir(parents=True, exist_ok=True)
    (index / "rosidl_interfaces").mkdir(parents=True, exist_ok=True)
    (index / "packages" / package.name).write_text("")
    listed = sorted(f"{kind}/{path.name}" for kind, path in shared if path.suffix != ".json")
    (index / "rosidl_interfaces" / package.name).write_text("\n".join(listed))
    share = f"share/{package.name}"
    files: list[tuple[str, Any]] = [
        ("lib", [str(path) for path in sorted((build / "lib").glob("*.so"))]),
        (share, [str(package.folder / "package.xml")]),
        ("share/ament_index/resource_index/packages", [str(index / "packages" / package.name)]),
        ("share/ament_index/resource_index/rosidl_interfaces", [str(index / "rosidl_interfaces" / package.name)]),
    ]
    for kind in sorted({kind for kind, _ in shared}):
        files.append((f"{share}/{kind}", [str(path) for of_kind, path in shared if of_kind == kind]))
    return files
