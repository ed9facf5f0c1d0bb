"""XML robot descriptions: read within bounds, numbers and files in their attributes."""

import re
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, XMLParser

import numpy as np

from contact_curation.errors import UnreadableInputError
from contact_curation.files import read_bounded
from contact_curation.geometry.quaternions import Array

LARGEST_XML = 1 << 22
"""Bytes of a robot description."""

PACKAGE = re.compile(r"(?:package|model)://([^/]+)/(.+)")
XACRO = "http://www.ros.org/wiki/xacro"


def read_xml(path: Path, root: str = "") -> Element:
    """The root element of an XML file.

    Args:
        path: path of the file.
        root: the name that it must have; empty for any.

    Raises:
        UnreadableInputError: there is no such file, it is no XML, a xacro, or another kind of document.
    """
    data = read_bounded(path, LARGEST_XML, f"a <{root or 'part of a description'}>", devices=False)
    if path.suffix == ".xacro" or XACRO.encode() in data:
        raise UnreadableInputError(path, f"is a xacro: expand it first with `xacro {path} > {path.name.split('.')[0]}.urdf`")
    try:
        element = ElementTree.fromstring(data, XMLParser(target=_Builder()))
    except _DoctypeError as error:
        raise UnreadableInputError(path, "found a document type, expected XML without one") from error
    except (ElementTree.ParseError, ValueError, LookupError, RecursionError) as error:
        raise UnreadableInputError(path, f"is no XML ({error})") from error
    if root and element.tag != root:
        raise UnreadableInputError(path, f"found a <{element.tag[:40]}>, expected a <{root}>")
    return element


class _DoctypeError(Exception):
    """A document has a type, whose entities can stand for any amount of text."""


class _Builder(ElementTree.TreeBuilder):
    """Refuses document types in whatever encoding."""

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        """Called by the parser."""
        raise _DoctypeError


def numbers(path: Path, element: Element, name: str, count: int, default: tuple[float, ...] | None = None) -> Array:
    """(count,) numbers of an attribute.

    Raises:
        UnreadableInputError: it is not there and has no default, or holds something else.
    """
    text = element.get(name)
    if text is None and default is not None:
        return np.array(default)
    try:
        found = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        found = np.full(1, np.nan)
    if found.shape != (count,) or not np.isfinite(found).all():
        what = "nothing" if text is None else repr(text[:60])
        expected = "a number" if count == 1 else f"{count} numbers"
        raise UnreadableInputError(path, f"{name} of <{element.tag}>: found {what}, expected {expected}")
    return found


def number(path: Path, element: Element, name: str, default: float | None = None) -> float:
    """One number of an attribute; arguments and errors as of `numbers`."""
    return float(numbers(path, element, name, 1, None if default is None else (default,))[0])


def positive(path: Path, element: Element, name: str, count: int) -> Array:
    """Positive numbers (count,) of an attribute; arguments as of `numbers`.

    Raises:
        UnreadableInputError: the attribute holds no such numbers.
    """
    found = numbers(path, element, name, count)
    if found.min() <= 0.0:
        raise UnreadableInputError(path, f"{name} of <{element.tag}>: found {element.get(name)!r}, expected positive numbers")
    return found


def referenced(path: Path, name: str, folder: str = "") -> Path:
    """The file that a description names: relative to its own folder, or in a ROS package that lies above it.

    Raises:
        UnreadableInputError: the package is not above the description, or the name is of another kind.
    """
    name = name.removeprefix("file://")
    package = PACKAGE.fullmatch(name)
    if package:
        for above in path.absolute().parents:
            for root in (above, above / package[1]):
                if root.name == package[1] and (root / package[2]).is_file():
                    return root / package[2]
        raise UnreadableInputError(
            path, f"{name}: found no folder {package[1]} with that file above it; name the mesh by a relative path instead"
        )
    if "://" in name:
        raise UnreadableInputError(path, f"found {name}, expected a path, relative to the file, or package://NAME/PATH")
    return path.parent / folder / name
