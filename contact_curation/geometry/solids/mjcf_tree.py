"""What shortens an MJCF file is written out: included files, and what is replicated (MuJoCo's XML reference).

What remains are bodies, geoms, and frames, which `placed` follows. Nothing is rounded, and MuJoCo is not needed.
"""

from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from contact_curation.errors import UnreadableInputError
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.solids.xml_file import number, numbers, read_xml, referenced

MOST_FILES, MOST_ELEMENTS = 64, 20_000
"""That a description may include, and that it may have once all is written out."""

Pose = tuple[Array, Array]
"""Rotation (3, 3) and translation (3,)."""


class Placed(NamedTuple):
    """An element of a body.

    Attributes:
        element: a geom or a body.
        childclass: class of its defaults, where it names none.
        pose: of the frames around it, in the body above.
    """

    element: Element
    childclass: str
    pose: Pose


def with_included(path: Path, root: Element) -> None:
    """Puts the elements of included files in the places of `<include>`; names are relative to the main file.

    Raises:
        UnreadableInputError: a file cannot be read, is included twice, or there are too many.
    """
    seen = {path.resolve()}
    _include(path, root, seen)


def _include(main: Path, above: Element, seen: set[Path]) -> None:
    for place in range(len(above) - 1, -1, -1):
        child = above[place]
        if child.tag != "include":
            _include(main, child, seen)
            continue
        file = referenced(main, child.get("file", ""))
        if file.resolve() in seen or len(seen) > MOST_FILES:
            found = f"{child.get('file')!r} once more" if file.resolve() in seen else f"over {MOST_FILES} files"
            raise UnreadableInputError(main, f"<include>: found {found}, expected each file once, and at most {MOST_FILES}")
        seen.add(file.resolve())
        inside = read_xml(file)
        _include(main, inside, seen)
        above[place : place + 1] = list(inside)


def with_replicas(path: Path, above: Element, turn: Callable[[Element], Array]) -> None:
    """Puts frames in the places of `<replicate>`, one for each copy.

    Copy k is turned by k times the angles of `euler`; its place is that of copy k - 1, moved by `offset` in that copy's frame.

    Args:
        path: of the file, for messages.
        above: whose elements are looked at.
        turn: gives the rotation (3, 3) of an element's attributes.

    Raises:
        UnreadableInputError: an attribute is none, or there are too many elements.
    """
    _replicate(path, above, turn, [MOST_ELEMENTS])


def _replicate(path: Path, above: Element, turn: Callable[[Element], Array], left: list[int]) -> None:
    for place in range(len(above) - 1, -1, -1):
        child = above[place]
        _replicate(path, child, turn, left)
        if child.tag != "replicate":
            continue
        count = number(path, child, "count")
        left[0] -= int(min(max(count, 0.0), MOST_ELEMENTS)) * sum(1 for _ in child.iter())
        if count != round(count) or count < 1.0 or left[0] < 0:
            expected = f"a whole number from 1, and at most {MOST_ELEMENTS} elements in all"
            raise UnreadableInputError(path, f"count of <replicate>: found {child.get('count')}, expected {expected}")
        angles, offset = (numbers(path, child, name, 3, (0.0, 0.0, 0.0)) for name in ("euler", "offset"))
        above[place : place + 1] = list(_copies(child, int(count), angles, offset, turn))


def _copies(element: Element, count: int, angles: Array, offset: Array, turn: Callable[[Element], Array]) -> Iterator[Element]:
    moved = np.zeros(3)
    for index in range(count):
        frame = Element("frame", {"pos": _text(moved), "euler": _text(index * angles)})
        moved = moved + turn(frame) @ offset
        frame.extend(deepcopy(list(element)))
        suffix = f"{element.get('sep', '')}{str(index).zfill(len(str(count - 1)))}"
        for named in frame.iter():
            if "name" in named.attrib:
                named.set("name", named.get("name", "") + suffix)
        yield frame


def _text(values: Array) -> str:
    """Numbers without loss."""
    return " ".join(repr(float(value)) for value in values)


def placed(above: Element, tag: str, childclass: str, pose_of: Callable[[Element], Pose]) -> Iterator[Placed]:
    """The elements of a body, or of the world, by their tag, also those inside frames.

    Args:
        above: the body.
        tag: geom or body.
        childclass: of the body.
        pose_of: gives the pose that an element's attributes say.
    """
    yield from _placed(above, tag, childclass, pose_of, (np.eye(3), np.zeros(3)))


def _placed(above: Element, tag: str, childclass: str, pose_of: Callable[[Element], Pose], pose: Pose) -> Iterator[Placed]:
    for child in above:
        if child.tag == tag:
            yield Placed(child, childclass, pose)
        elif child.tag == "frame":
            rotation, translation = pose_of(child)
            inside = pose[0] @ rotation, pose[1] + pose[0] @ translation
            yield from _placed(child, tag, child.get("childclass", childclass), pose_of, inside)
