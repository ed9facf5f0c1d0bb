"""Reads tag maps (which tags are where) from YAML files in our form, or in the form of TagSLAM's tagslam.yaml.

Ours (config/cube_tags.yaml):

    family: tag36h11
    axes: out                  # of the tags' frames: out of the tag, or into it
    frames:
      body_cube:
        - {id: 0, edge: 0.08, position: [0, 0, 0.0524], orientation_wxyz: [1, 0, 0, 0]}

TagSLAM's file has `bodies`, a list of names with `tags` (id, size, pose with position and a rotation vector), or with a `board`
of rows and columns; the names of fields are those of its documentation. A body's frame is `body_<name>`, as TagSLAM publishes
it. Tags without a pose, which TagSLAM estimates itself, are left out.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.contact.body_values import check_keys
from contact_curation.errors import ContactCurationError, InvalidValueError, UnreadableInputError
from contact_curation.files import read_yaml
from contact_curation.geometry import quaternions
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import IDENTITY, Array
from contact_curation.geometry.tag_rig import TagRig
from contact_curation.geometry.tags import FAMILY, Tag, TagAxes, TagMap, check_no_id_twice, in_our_axes

LARGEST_FILE = 2**17
"""Largest accepted file [bytes]: parsing YAML takes about 20 microseconds per byte; a whole family of tags has about 60 kB."""

MOST_TAGS = 587
"""Number of tags in the family."""

BITS_OF_FAMILY = 6
"""The family by its bits along an edge, as TagSLAM names it."""


def read_tag_maps(path: Path) -> tuple[TagMap, ...]:
    """Reads the maps in a file, one for each frame with tags.

    Raises:
        UnreadableInputError: the file does not exist, or is no tag map, or has a frame or an id twice; the message says what is
            wrong.
    """
    content = read_yaml(path, LARGEST_FILE, "a map of tags")
    if not isinstance(content, Mapping) or not {"frames", "bodies"} & set(content):
        raise UnreadableInputError(path, "found neither `frames` nor TagSLAM's `bodies`, expected a map of tags")
    try:
        maps = tuple(_maps(content) if "frames" in content else _tagslam_maps(content))
        frames = sorted(one.frame for one in maps)
        if len(set(frames)) < len(frames):
            raise InvalidValueError("frames with tags", frames, "each once")
        check_no_id_twice((tag for one in maps for tag in one.tags), " and ".join(frames))
        return maps
    except ContactCurationError as error:
        raise UnreadableInputError(path, str(error)) from error
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        raise UnreadableInputError(path, f"found a field missing or of the wrong form ({error!r}), expected a map") from error


def read_tag_rig(path: Path, body_frame: str, board_frame: str) -> TagRig:
    """Reads the tags of a body and, if there are any, of the board.

    Raises:
        UnreadableInputError: as in `read_tag_maps`, or the body has no tags.
    """
    maps = {one.frame: one for one in read_tag_maps(path)}
    if body_frame not in maps:
        raise UnreadableInputError(path, f"found tags of {sorted(maps)}, expected some of {body_frame}")
    return TagRig(maps[body_frame], maps.get(board_frame))


def tag_rig_yaml(rig: TagRig) -> str:
    """Writes a rig as YAML in our form; reading it gives the same rig, bit for bit."""
    lines = [f"family: {FAMILY}", f"axes: {TagAxes.OUT.value}", "frames:"]
    for tags in (rig.body, *([rig.board] if rig.board else [])):
        lines.append(f"  {tags.frame}:")
        lines += [f"    - {_line(tag)}" for tag in tags.tags]
    return "\n".join(lines) + "\n"


def _line(tag: Tag) -> str:
    position, turn = (_listed(numbers) for numbers in (tag.pose.position, tag.pose.orientation_wxyz))
    return f"{{id: {tag.tag_id}, edge: {float(tag.edge)!r}, position: {position}, orientation_wxyz: {turn}}}"


def _listed(numbers: Array) -> str:
    return "[" + ", ".join(repr(float(number) + 0.0) for number in numbers) + "]"


def _maps(content: Mapping[str, Any]) -> Iterator[TagMap]:
    check_keys(content, ("family", "axes", "frames"))
    if content.get("family", FAMILY) != FAMILY:
        raise InvalidValueError("family", content["family"], FAMILY)
    try:
        axes = TagAxes(content.get("axes", TagAxes.OUT.value))
    except ValueError as error:
        raise InvalidValueError("axes", content["axes"], "out or into") from error
    for frame, tags in content["frames"].items():
        yield TagMap(str(frame), tuple(_tag(one, axes) for one in tags))


def _tag(entry: Mapping[str, Any], axes: TagAxes) -> Tag:
    check_keys(entry, ("id", "edge", "position", "orientation_wxyz"))
    position = np.array(entry["position"], dtype=float)
    pose = Pose(position, np.array(entry.get("orientation_wxyz", IDENTITY), dtype=float))
    return Tag(entry["id"], in_our_axes(pose, axes), float(entry["edge"]))


def _tagslam_maps(content: Mapping[str, Any]) -> Iterator[TagMap]:
    for named in content["bodies"]:
        for name, body in named.items():
            if isinstance(body, Mapping):
                tags = _board_tags(body["board"]) if body.get("type") == "board" else list(_simple_tags(body))
                if tags:
                    yield TagMap(f"body_{name}", tuple(tags))


def _simple_tags(body: Mapping[str, Any]) -> Iterator[Tag]:
    for entry in body.get("tags") or ():
        _check_bits(entry.get("bits", BITS_OF_FAMILY))
        if "pose" in entry:
            yield Tag(entry["id"], _tagslam_pose(entry["pose"]), float(entry.get("size", body.get("default_tag_size", 0.0))))


def _board_tags(board: Mapping[str, Any]) -> list[Tag]:
    """The tags of a board, row by row; TagSLAM's `pose` of a board is that of its body."""
    _check_bits(board.get("tag_bits", BITS_OF_FAMILY))
    edge, columns = float(board["tag_size"]), int(board["tag_columns"])
    back = _tagslam_pose(board["pose"]).inverse() if "pose" in board else Pose.identity()
    step = edge * (1.0 + float(board["tag_spacing"]))
    rows = int(board["tag_rows"])
    if not (0 < rows <= MOST_TAGS and 0 < columns <= MOST_TAGS and rows * columns <= MOST_TAGS):
        raise InvalidValueError("tags of a board", f"{rows} rows of {columns}", f"at most {MOST_TAGS} tags, as {FAMILY} has")
    return [
        Tag(
            int(board["tag_start_id"]) + number,
            back.compose(Pose(np.array([step * (number % columns), step * (number // columns), 0.0]), IDENTITY)),
            edge,
        )
        for number in range(rows * columns)
    ]


def _tagslam_pose(pose: Mapping[str, Any]) -> Pose:
    position, rotation = ([float(pose[part][axis]) for axis in "xyz"] for part in ("position", "rotation"))
    return Pose(np.array(position), quaternions.exp(np.array(rotation)))


def _check_bits(bits: object) -> None:
    if bits != BITS_OF_FAMILY:
        raise InvalidValueError("bits of a tag", bits, f"{BITS_OF_FAMILY}, as of {FAMILY}")
