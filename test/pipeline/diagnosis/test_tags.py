"""Detections that do not fit their tag map: `check` names the setting, or the line of the map, that is wrong."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import multiply
from contact_curation.geometry.tag_rig import TagRig
from contact_curation.geometry.tags import HALF_TURN_ABOUT_X, Tag, TagMap
from contact_curation.motion.tags.pose import DetectedTag
from contact_curation.pipeline.diagnosis import Diagnosis, diagnose
from contact_curation.pipeline.reading import ReadingConfig, inputs_config
from contact_curation.storage.tag_map_file import tag_rig_yaml
from test.storage.tag_recordings import write_detections
from test.tag_scene import RIG
from test.tagged_tosses import TaggedImage, tagged_tosses


def checked(folder: Path, images: Sequence[TaggedImage], rig: TagRig = RIG, corner_order: str = "apriltag") -> Diagnosis:
    """Of a bag of detections, read with a map."""
    bag = write_detections(folder / "tagged.mcap", images)
    (folder / "map.yaml").write_text(tag_rig_yaml(rig))
    given = {"poses.tag_map": str(folder / "map.yaml"), "poses.tags.corner_order": corner_order}
    return diagnose([bag], ReadingConfig(CONTACTNETS_CUBE, inputs_config(given)))


def images_with(change: Callable[[DetectedTag], DetectedTag]) -> list[TaggedImage]:
    return [one._replace(tags=[change(tag) for tag in one.tags]) for one in tagged_tosses(1)]


def rig_with(change: Callable[[Tag], Tag]) -> TagRig:
    """The body's tags are described otherwise than they are."""
    return TagRig(TagMap(RIG.body.frame, tuple(change(tag) for tag in RIG.body.tags)), RIG.board)


@pytest.mark.slow
def test_the_order_of_corners_is_named_as_a_setting_and_to_be_checked_again(tmp_path: Path) -> None:
    clockwise = images_with(lambda one: one._replace(corners=one.corners[[3, 2, 1, 0]] - 0.5))
    found = checked(tmp_path, clockwise)
    assert not found.ok
    assert found.verdict.startswith("corners of tags ")
    assert found.settings == "--set poses.tags.corner_order=opencv"
    assert found.next.startswith("contact-curation check ")
    assert "--board-frame" not in found.next
    assert "corners" not in checked(tmp_path, clockwise, corner_order="opencv").verdict


@pytest.mark.slow
def test_axes_of_the_other_convention_are_named(tmp_path: Path) -> None:
    def turned(tag: Tag) -> Tag:
        return replace(tag, pose=Pose(tag.pose.position, multiply(tag.pose.orientation_wxyz, HALF_TURN_ABOUT_X)))

    board = RIG.board and TagMap(RIG.board.frame, tuple(map(turned, RIG.board.tags)))
    found = checked(tmp_path, tagged_tosses(1), TagRig(rig_with(turned).body, board))
    assert found.verdict.endswith("change `axes` in the tag map")


@pytest.mark.slow
def test_edges_that_are_too_long_are_named_with_their_ratio(tmp_path: Path) -> None:
    found = checked(tmp_path, tagged_tosses(1), rig_with(lambda tag: replace(tag, edge=1.25 * tag.edge)))
    assert "with edges of body_cube times 0.8: correct `edge`" in found.verdict
    assert found.settings == ""


@pytest.mark.slow
def test_a_tag_that_is_elsewhere_is_named(tmp_path: Path) -> None:
    seen = [tag.tag_id for one in tagged_tosses(1) for tag in one.tags if tag.tag_id in RIG.body.ids]
    often = max(set(seen), key=seen.count)
    by = np.array([0.003, 0.003, 0.003])

    def moved(tag: Tag) -> Tag:
        return replace(tag, pose=replace(tag.pose, position=tag.pose.position + by)) if tag.tag_id == often else tag

    found = checked(tmp_path, tagged_tosses(1), rig_with(moved))
    assert any(f"without tag {often} of body_cube: it is not where" in line for line in (found.verdict, *found.reasons))


@pytest.mark.slow
def test_a_tag_that_is_hidden_in_part_in_a_few_images_is_not_said_to_be_elsewhere(tmp_path: Path) -> None:
    assert RIG.board is not None
    images, hidden = list(tagged_tosses(1)), RIG.board.tags[0].tag_id
    by = np.array([[3.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 3.0]])
    for place in range(20, 30):
        tags = images[place].tags
        moved = [one._replace(corners=one.corners + by) for one in tags if one.tag_id == hidden]
        images[place] = images[place]._replace(tags=[*(one for one in tags if one.tag_id != hidden), *moved])
    found = checked(tmp_path, images)
    assert not any("it is not where" in line for line in (found.verdict, *found.reasons))


@pytest.mark.slow
def test_corners_with_more_noise_than_expected_give_its_size(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    found = checked(tmp_path, images_with(lambda one: one._replace(corners=one.corners + 0.4 * rng.standard_normal((4, 2)))))
    setting = found.settings.removeprefix("--set poses.tags.noise.deviation=")
    assert 0.25 < float(setting) < 0.5
    assert "if the tag map is right to a millimetre, corners are noisy" in found.verdict


@pytest.mark.slow
def test_of_a_right_map_nothing_is_said(tmp_path: Path) -> None:
    found = checked(tmp_path, tagged_tosses(1))
    assert not any("corners of tags" in line for line in (found.verdict, *found.reasons))


def test_other_tags_in_the_image_are_listed(tmp_path: Path) -> None:
    found = checked(tmp_path, images_with(lambda one: one._replace(tag_id=one.tag_id + 200)))
    assert "in the image: 36h11 20" in found.verdict


def test_why_no_image_has_a_camera_is_said_once(tmp_path: Path) -> None:
    bag = write_detections(tmp_path / "tagged.mcap", tagged_tosses(1), calibrated=False)
    (tmp_path / "map.yaml").write_text(tag_rig_yaml(RIG))
    found = diagnose([bag], ReadingConfig(CONTACTNETS_CUBE, inputs_config({"poses.tag_map": str(tmp_path / "map.yaml")})))
    assert ["is the camera calibrated?" in line for line in (found.verdict, *found.reasons)].count(True) == 1


def test_without_a_map_the_next_command_names_one(tmp_path: Path) -> None:
    bag = write_detections(tmp_path / "tagged.mcap", tagged_tosses(1))
    found = diagnose([bag], ReadingConfig(CONTACTNETS_CUBE, inputs_config({})))
    assert "detections of tags are read with a tag map" in found.verdict
    assert found.next == f"contact-curation check {bag} --tag-map my_tags.yaml"
