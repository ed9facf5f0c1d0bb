"""Images of tags, from the code table of the AprilTag library itself, and tags as textured squares in a MuJoCo world."""

from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import MissingDependencyError
from contact_curation.geometry import quaternions
from contact_curation.geometry.tags import BLACK_CELLS, CELLS, FAMILY, Tag, TagMap


class TagLibrary(NamedTuple):
    """A detector of the library and the table of the family it looks for.

    Attributes:
        detector: `pupil_apriltags.Detector`.
        family: the library's structure with codes and places of bits.
    """

    detector: Any
    family: Any


def tag_library(**options: Any) -> TagLibrary:
    """A detector for the family 36h11.

    The wrapper (1.0.4) frees a detector's families before the detector, which then reads them and sometimes crashes
    (pupil-labs/apriltags, issues 34 and 46). So the family is removed from the wrapper's list and never freed.

    Args:
        options: options of the wrapper's Detector.

    Raises:
        MissingDependencyError: the library is not installed.
    """
    try:
        from pupil_apriltags import Detector  # type: ignore[import-untyped]
    except ImportError as error:
        raise MissingDependencyError("the AprilTag library", "pip install pupil-apriltags") from error
    detector = Detector(FAMILY, **options)
    return TagLibrary(detector, detector.tag_families.pop(FAMILY))


Image = NDArray[np.uint8]

LIFT = 2e-5
"""How far a tag stands off its face [m], so that the face does not shine through."""

TEXELS_PER_CELL = 32
WHITE, BLACK = 255, 0

PRINT_WHITE, PRINT_BLACK = 230, 20
"""Grey values of paper and ink. Noise at 0 or 255 would be clipped on one side, which would displace the edges."""

CORNER_SIGNS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
TEXTURE_PLACES = np.array([[0, 1], [1, 1], [1, 0], [0, 0]])
"""Texture coordinates of the same corners: v goes down, from the first row."""


def tag_image(tag_id: int) -> Image:
    """The image (10, 10) of a tag, one pixel per cell, first row at the top, with its white border."""
    code, columns, rows = _code_table(tag_id)
    cells = np.full((CELLS, CELLS), WHITE, dtype=np.uint8)
    black = cells[1:-1, 1:-1]
    black[:] = BLACK
    bits = len(columns)
    for place, (column, row) in enumerate(zip(columns, rows)):
        black[row, column] = WHITE if code >> (bits - 1 - place) & 1 else BLACK
    return cells


def add_tags(spec: mujoco.MjSpec, tags: TagMap, body: str = "") -> None:
    """Adds tags to a world as visible squares without collisions.

    Args:
        spec: specification of the world.
        tags: tags in the frame of the body or of the world.
        body: name of the body; empty for the world.
    """
    holder = spec.body(body) if body else spec.worldbody
    for tag in tags.tags:
        _add_tag(spec, holder, tag)


def _add_tag(spec: mujoco.MjSpec, holder: Any, tag: Tag) -> None:
    name = f"tag {tag.tag_id}"
    printed = np.where(tag_image(tag.tag_id) == WHITE, PRINT_WHITE, PRINT_BLACK).astype(np.uint8)
    texels = np.kron(printed, np.ones((TEXELS_PER_CELL, TEXELS_PER_CELL), dtype=np.uint8))
    size = len(texels)
    spec.add_texture(
        name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=size, height=size, nchannel=3, data=np.repeat(texels, 3)
    )
    material = spec.add_material(name=name)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    half = 0.5 * tag.edge * CELLS / BLACK_CELLS
    square = np.column_stack([half * CORNER_SIGNS, np.zeros(4)])
    spec.add_mesh(
        name=name,
        uservert=square.ravel(),
        userface=[0, 1, 2, 0, 2, 3],
        usertexcoord=TEXTURE_PLACES.astype(float).ravel(),
        userfacetexcoord=[0, 1, 2, 0, 2, 3],
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    lifted = tag.pose.position + quaternions.rotate(tag.pose.orientation_wxyz, [0.0, 0.0, LIFT])
    holder.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        material=name,
        pos=lifted,
        quat=tag.pose.orientation_wxyz,
        contype=0,
        conaffinity=0,
        mass=0.0,
    )


def _code_table(tag_id: int) -> tuple[int, list[int], list[int]]:
    """A tag's code, and columns and rows of its bits in the black square, highest bit first."""
    family = _family()
    return int(family.codes[tag_id]), list(family.bit_x[: family.nbits]), list(family.bit_y[: family.nbits])


@cache
def _family() -> Any:
    """The library's code table of the family; reading it takes a while, so it is cached."""
    return tag_library().family.contents
