"""Tag maps: ours and TagSLAM's say the same, round trips, and files that are no map."""

from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import UnreadableInputError
from contact_curation.geometry.face_tags import tags_on_faces
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.tag_rig import TagRig, rig_of
from contact_curation.geometry.tags import TagMap
from contact_curation.storage.tag_map_file import read_tag_maps, read_tag_rig, tag_rig_yaml

SHIPPED = Path(__file__).resolve().parents[2] / "contact_curation" / "config" / "cube_tags.yaml"

TAGSLAM = """
body_defaults: {position_noise: 0.05, rotation_noise: 0.01}
default_body: surface
bodies:
  - surface:
      is_static: true
      type: board
      board:
        {tag_start_id: 12, tag_size: 0.12, tag_bits: 6, tag_spacing: 0.25, tag_rows: 2, tag_columns: 3,
         pose: {position: {x: 0.0735, y: 0.01, z: 0}, rotation: {x: 0, y: 0, z: 0}}}
  - cube:
      is_static: false
      type: simple
      default_tag_size: 0.08
      tags:
        - id: 0
          pose: {position: {x: 0, y: 0, z: 0.0524}, rotation: {x: 0, y: 0, z: 0}, position_noise: {x: 1, y: 1, z: 1}}
        - id: 1
          size: 0.07
          pose: {position: {x: 0.0524, y: 0, z: 0}, rotation: {x: 0, y: 1.5707963267948966, z: 0}}
        - id: 2
  - rig: {is_static: false, type: simple}
"""

SOME_TAG = "{id: 1, size: 0.1, pose: {position: {x: 0, y: 0, z: 0}, rotation: {x: 0, y: 0, z: 0}}}"


def write(folder: Path, text: str) -> Path:
    path = folder / "tags.yaml"
    path.write_text(text)
    return path


def assert_same(one: TagMap, other: TagMap) -> None:
    assert (one.frame, one.ids) == (other.frame, other.ids)
    for tag_id in one.ids:
        assert one.tag(tag_id).edge == other.tag(tag_id).edge
        np.testing.assert_allclose(one.tag(tag_id).corners, other.tag(tag_id).corners, atol=1e-15)


@pytest.mark.parametrize(
    "polytope", [CONTACTNETS_CUBE.polytope, Polytope(0.06 * np.vstack([np.eye(3), -np.eye(3)]))], ids=["cube", "octahedron"]
)
def test_a_rig_comes_back_as_it_was_written(tmp_path: Path, polytope: Polytope) -> None:
    rig = rig_of(polytope, "body_thing", "body_surface")
    read = read_tag_rig(write(tmp_path, tag_rig_yaml(rig)), "body_thing", "body_surface")
    assert read.board is not None
    assert rig.board is not None
    assert_same(read.body, rig.body)
    assert_same(read.board, rig.board)


def test_a_rig_without_a_board_comes_back_without_one(tmp_path: Path) -> None:
    rig = TagRig(tags_on_faces(CONTACTNETS_CUBE.polytope, "body_cube"))
    assert read_tag_rig(write(tmp_path, tag_rig_yaml(rig)), "body_cube", "body_surface").board is None


def test_the_shipped_map_is_that_of_the_simulated_cube() -> None:
    read = read_tag_rig(SHIPPED, "body_cube", "body_surface")
    assert tag_rig_yaml(read) == tag_rig_yaml(rig_of(CONTACTNETS_CUBE.polytope, "body_cube", "body_surface"))


def test_tagslams_file_gives_bodies_and_boards(tmp_path: Path) -> None:
    surface, cube = read_tag_maps(write(tmp_path, TAGSLAM))
    assert (surface.frame, surface.ids) == ("body_surface", (12, 13, 14, 15, 16, 17))
    np.testing.assert_allclose(surface.tag(12).pose.position, [-0.0735, -0.01, 0.0])
    np.testing.assert_allclose(surface.tag(17).pose.position, [0.3 - 0.0735, 0.15 - 0.01, 0.0])
    assert (cube.frame, cube.ids) == ("body_cube", (0, 1))  # the pose of tag 2 is for TagSLAM to find
    assert (cube.tag(0).edge, cube.tag(1).edge) == (0.08, 0.07)
    expected = [[0.0524, -0.035, 0.035], [0.0524, -0.035, -0.035], [0.0524, 0.035, -0.035], [0.0524, 0.035, 0.035]]
    np.testing.assert_allclose(cube.tag(1).corners, expected, atol=1e-12)


def test_frames_that_look_into_the_tags_are_turned(tmp_path: Path) -> None:
    text = "axes: {}\nframes:\n  body_cube:\n    - {{id: 3, edge: 0.1, position: [0, 0, 0.05], orientation_wxyz: {}}}\n"
    (out,) = read_tag_maps(write(tmp_path, text.format("out", [1, 0, 0, 0])))
    (into,) = read_tag_maps(write(tmp_path, text.format("into", [0, 1, 0, 0])))
    assert_same(out, into)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("[1, 2]", "neither `frames` nor"),
        ("a: 1", "neither `frames` nor"),
        ("frames: [", "no YAML"),
        ("frames: {body_cube: []}", "at least one"),
        ("frames: {body_cube: 3}", "wrong form"),
        ("frames: {body_cube: [{id: 1, edge: 0.1}]}", "position"),
        ("frames: {body_cube: [{id: 600, edge: 0.1, position: [0, 0, 0]}]}", "from 0 to 586"),
        (f"frames: {{body_cube: [{{id: 1, edge: 1{'0' * 400}, position: [0, 0, 0]}}]}}", "wrong form"),
        ("frames: {body_cube: [{id: 1, edge: .inf, position: [0, 0, 0]}]}", "edge of tag 1"),
        ("frames: {body_cube: [{id: 1, edge: -1, position: [0, 0, 0]}]}", "edge of tag 1"),
        ("frames: {body_cube: [{id: 1, edge: 0.1, position: [0, 0]}]}", r"\(3,\)"),
        ("family: tag25h9\nframes: {}", "tag36h11"),
        ("axes: sideways\nframes: {}", "out or into"),
        ("axis: into\nframes: {}", r"unknown key 'axis': did you mean 'axes'\?"),
        ("frames: {body_cube: [{id: 1, edge: 0.1, position: [0, 0, 0], orientation: [0, 1, 0, 0]}]}", "key 'orientation'"),
        ("bodies: [{cube: {tags: [TAG]}}, {cube: {tags: []}}, {cube: {tags: [TAG]}}]", "expected each once"),
        ("bodies: [{cube: {tags: [TAG]}}, {wedge: {tags: [TAG]}}]", r"and body_wedge: found ids \[1\] more than once"),
        ("bodies: 4", "wrong form"),
        ("bodies: [{cube: {type: simple, tags: [{id: 1, size: 0.1, bits: 5, pose: {}}]}}]", "bits of a tag"),
        ("bodies: [{cube: {type: simple, tags: [{id: 1, pose: {position: {x: 0}}}]}}]", "wrong form"),
    ],
)
def test_what_is_no_map_is_one_line(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(UnreadableInputError, match=why) as caught:
        read_tag_maps(write(tmp_path, text.replace("TAG", SOME_TAG)))
    assert "\n" not in str(caught.value)
    assert "tags.yaml" in str(caught.value)


def test_a_map_without_the_body_or_with_an_id_on_both_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInputError, match="expected some of body_wedge"):
        read_tag_rig(SHIPPED, "body_wedge", "body_surface")
    tag = "[{id: 1, edge: 0.1, position: [0, 0, 0]}]"
    path = write(tmp_path, f"frames: {{body_cube: {tag}, body_surface: {tag}}}")
    with pytest.raises(UnreadableInputError, match="more than once"):
        read_tag_rig(path, "body_cube", "body_surface")
    with pytest.raises(UnreadableInputError, match="cannot be read"):
        read_tag_maps(tmp_path / "missing.yaml")
