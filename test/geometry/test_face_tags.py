"""Tags on the faces of any convex body: on the face, within it, as large as can be; and the shipped map is the cube's."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.face_tags import faces_of, tags_on_faces
from contact_curation.geometry.polytopes import Polytope, box
from contact_curation.geometry.tag_rig import TagRig, rig_of
from contact_curation.geometry.tags import BLACK_CELLS, CELLS, CORNERS, Tag, TagMap

CUBE = box([0.0524] * 3)
OCTAHEDRON = Polytope(0.06 * np.vstack([np.eye(3), -np.eye(3)]))
WEDGE = Polytope(np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.06, 0], [0, 0, 0.08], [0.1, 0, 0.08], [0, 0.06, 0.08]]) - 0.03)


@pytest.mark.parametrize(("polytope", "faces"), [(CUBE, 6), (OCTAHEDRON, 8), (WEDGE, 5), (box([0.05, 0.03, 0.02]), 6)])
def test_every_face_is_found_once_with_its_normal_outwards(polytope: Polytope, faces: int) -> None:
    found = faces_of(polytope)
    assert len(found) == faces
    for face in found:
        heights = polytope.vertices @ face.normal - face.offset
        assert np.linalg.norm(face.normal) == pytest.approx(1.0)
        assert heights.max() == pytest.approx(0.0, abs=1e-12)
        assert np.count_nonzero(heights > -1e-9) >= 3


@pytest.mark.parametrize("polytope", [CUBE, OCTAHEDRON, WEDGE], ids=["cube", "octahedron", "wedge"])
def test_a_tag_lies_on_its_face_with_its_rim_and_looks_outwards(polytope: Polytope) -> None:
    faces = faces_of(polytope)
    tags = tags_on_faces(polytope, "body")
    assert len(tags.tags) == len(faces)
    for tag in tags.tags:
        outward = quaternions.rotate(tag.pose.orientation_wxyz, [0.0, 0.0, 1.0])
        face = max(faces, key=lambda one: float(one.normal @ outward))
        np.testing.assert_allclose(outward, face.normal, atol=1e-9)
        rim = tag.pose.position + quaternions.rotate(tag.pose.orientation_wxyz, tag.edge * CELLS / BLACK_CELLS * CORNERS)
        np.testing.assert_allclose(rim @ face.normal, face.offset, atol=1e-9)
        assert all((rim @ other.normal <= other.offset + 1e-9).all() for other in faces)


def test_the_tag_of_a_square_face_fills_it_but_for_the_share_left_free() -> None:
    edges = [tag.edge for tag in tags_on_faces(CUBE, "body", share=0.95).tags]
    assert edges == [0.0796] * 6  # 0.95 * 0.8 * 0.1048, to a tenth of a millimetre


def test_the_largest_square_in_an_equilateral_triangle_is_known() -> None:
    side = 0.06 * np.sqrt(2.0)
    expected = side * np.sqrt(3.0) / (2.0 + np.sqrt(3.0)) * BLACK_CELLS / CELLS
    edges = [tag.edge for tag in tags_on_faces(OCTAHEDRON, "body", share=1.0).tags]
    np.testing.assert_allclose(edges, expected, atol=1.01e-4)


def test_small_faces_get_no_tag_and_a_body_of_small_faces_is_refused() -> None:
    flat = box([0.05, 0.05, 0.004])
    assert len(tags_on_faces(flat, "body").tags) == 2
    with pytest.raises(InvalidValueError, match="room for a tag"):
        tags_on_faces(box([0.004] * 3), "body")


def test_a_rig_has_tags_on_body_and_board_and_no_id_twice() -> None:
    rig = rig_of(CUBE, "body_cube", "body_surface")
    assert rig.board is not None
    assert (rig.body.frame, rig.board.frame) == ("body_cube", "body_surface")
    assert not set(rig.body.ids) & set(rig.board.ids)
    with pytest.raises(InvalidValueError, match="more than once"):
        TagRig(rig.body, TagMap("other", (Tag(0, rig.board.tags[0].pose, 0.1),)))
