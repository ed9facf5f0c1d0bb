"""The tags of a rig: those of the body and those of the board, and a layout for a body that has none yet."""

from dataclasses import dataclass

import numpy as np

from contact_curation.geometry.face_tags import tags_on_faces
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import IDENTITY
from contact_curation.geometry.tags import Tag, TagMap, check_no_id_twice

FIRST_BOARD_ID = 100
BOARD_EDGE = 0.12
BOARD_PLACES = ((-0.25, -0.3), (0.25, -0.3), (-0.4, 0.05), (0.4, 0.05), (-0.45, 0.4), (0.0, 0.45), (0.45, 0.4))
"""Round the middle of the board [m], where tosses end."""


@dataclass(frozen=True, eq=False)
class TagRig:
    """Which tags are where.

    Attributes:
        body: on the body.
        board: on the board; None where something else tells where the camera is.
    """

    body: TagMap
    board: TagMap | None = None

    def __post_init__(self) -> None:
        check_no_id_twice(self.body.tags + (() if self.board is None else self.board.tags), "the rig")


def rig_of(polytope: Polytope, body_frame: str, board_frame: str) -> TagRig:
    """A rig for any body: a tag on each of its large faces, and seven on the board."""
    places = [Pose(np.array([x, y, 0.0]), IDENTITY) for x, y in BOARD_PLACES]
    board = tuple(Tag(FIRST_BOARD_ID + number, place, BOARD_EDGE) for number, place in enumerate(places))
    return TagRig(tags_on_faces(polytope, body_frame), TagMap(board_frame, board))
