"""What a ROS interface package defines, read from its package.xml and its msg, srv and action folders."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

IMPLIED_BY_KIND = {"srv": ("service_msgs",), "action": ("action_msgs", "service_msgs", "unique_identifier_msgs")}
"""Packages whose types the generators add to every service and action."""


@dataclass(frozen=True)
class InterfacePackage:
    """A package of .msg, .srv and .action files.

    Attributes:
        folder: absolute path of the folder that holds package.xml.
        name: the ROS name, which is the name of the Python module too.
        version: as package.xml gives it.
        description: one line.
        license: an SPDX name.
        depends: interface packages that the definitions use, the implied ones included.
        definitions: paths relative to `folder`, such as msg/Toss.msg, sorted.
    """

    folder: Path
    name: str
    version: str
    description: str
    license: str
    depends: tuple[str, ...]
    definitions: tuple[Path, ...]


def read_interface_package(folder: Path) -> InterfacePackage:
    """Read the package in `folder`.

    Raises:
        ValueError: package.xml lacks a name, version, description or license, or there is no definition.
    """
    folder = folder.resolve()
    root = ElementTree.parse(folder / "package.xml").getroot()
    definitions = tuple(
        sorted(path.relative_to(folder) for kind in ("msg", "srv", "action") for path in folder.glob(f"{kind}/*.{kind}"))
    )
    if not definitions:
        raise ValueError(f"{folder}: found no definition, expected files such as msg/NAME.msg")
    implied = {package for path in definitions for package in IMPLIED_BY_KIND.get(path.parts[0], ())}
    declared = {element.text.strip() for element in root.iter("depend") if element.text}
    return InterfacePackage(
        folder=folder,
        name=_text(root, "name"),
        version=_text(root, "version"),
        description=_text(root, "description"),
        license=_text(root, "license"),
        depends=tuple(sorted(declared | implied)),
        definitions=definitions,
    )


def _text(root: ElementTree.Element, tag: str) -> str:
    found = root.findtext(tag)
    if not found or not found.strip():
        raise ValueError(f"package.xml: found no <{tag}>, expected one")
    return " ".join(found.split())
