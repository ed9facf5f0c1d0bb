"""Bags with detections of tags become tosses; lost tags reject the toss they are lost in, and nothing is put in their place."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.inputs.inputs import InputsConfig, Problem, open_inputs
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from test.storage.tag_recordings import write_detections
from test.storage.test_tag_map_file import SHIPPED
from test.tagged_tosses import TaggedImage, tagged_tosses, without_tags

WITH_MAP = InputsConfig(poses=PoseTopicConfig(tag_map=str(SHIPPED)))


@pytest.fixture(scope="module")
def images() -> tuple[TaggedImage, ...]:
    return tagged_tosses(2)


def opened(path: Path, config: InputsConfig = WITH_MAP) -> list[Toss | Rejected | Problem]:
    return list(open_inputs([path], CONTACTNETS_CUBE, config))


def test_a_bag_of_detections_gives_the_tosses_with_the_poses_of_the_tags(
    tmp_path: Path, images: tuple[TaggedImage, ...]
) -> None:
    found = [one for one in opened(write_detections(tmp_path / "a.mcap", images)) if isinstance(one, Toss)]
    assert len(found) == 2
    true = {one.stamp_ns: one.true for one in images}
    for toss in found:
        poses = [true[stamp_ns] for stamp_ns in toss.stamps_ns.tolist()]
        np.testing.assert_allclose(toss.positions, [pose.position for pose in poses], atol=1e-3)
        turns = quaternions.angle_between(toss.orientations_wxyz, np.array([pose.orientation_wxyz for pose in poses]))
        assert np.degrees(turns.max()) < 0.5


@pytest.mark.slow
def test_a_camera_info_that_comes_late_makes_no_difference(tmp_path: Path, images: tuple[TaggedImage, ...]) -> None:
    early = opened(write_detections(tmp_path / "a.mcap", images))
    late = opened(write_detections(tmp_path / "b.mcap", images, info_after=40))
    assert [one.digest() for one in early if isinstance(one, Toss)] == [one.digest() for one in late if isinstance(one, Toss)]


def test_a_toss_in_which_the_tags_are_lost_is_rejected_and_the_other_is_whole(
    tmp_path: Path, images: tuple[TaggedImage, ...]
) -> None:
    items = opened(write_detections(tmp_path / "a.mcap", without_tags(images, 30, 34)))
    rejected = [one for one in items if isinstance(one, Rejected)]
    assert len(rejected) == 1
    assert rejected[0].reasons[0].startswith("gap: found")
    assert len([one for one in items if isinstance(one, Toss)]) == 1
    assert any("found 0, expected 1 or more" in str(one) for one in items if isinstance(one, Problem))


def test_without_a_tag_map_a_bag_of_detections_is_a_line_that_says_what_is_in_it(
    tmp_path: Path, images: tuple[TaggedImage, ...]
) -> None:
    (problem,) = opened(write_detections(tmp_path / "a.mcap", images[:5]), replace(WITH_MAP, poses=PoseTopicConfig()))
    assert isinstance(problem, Problem)
    assert "AprilTagDetectionArray" in problem.what
    assert "are read with a tag map" in problem.what


def test_a_tag_map_that_cannot_be_read_is_a_line(tmp_path: Path, images: tuple[TaggedImage, ...]) -> None:
    missing = replace(WITH_MAP, poses=PoseTopicConfig(tag_map=str(tmp_path / "none.yaml")))
    (problem,) = opened(write_detections(tmp_path / "a.mcap", images[:5]), missing)
    assert "cannot be read" in str(problem)
