"""Held-out recordings of a node, by a tracker that is as noisy as it is told."""

from pathlib import Path

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import evaluation_tosses
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.inputs.pose_messages import ODOMETRY
from test.motion.streams import board_in_map, in_map, noisy, stream
from test.storage.pose_recordings import LOG_OFFSET_NS, recorded, transforms
from test.storage.written_bags import Sent, write_ours


def test_a_noisy_trackers_recordings_are_held_out_once_they_are_told_to_be(tmp_path: Path) -> None:
    scattered = in_map(noisy([*stream(), *stream(start_ns=9_000_000_000)], 8.0))
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()]))
    bag = write_ours(tmp_path / "a.mcap", [board, *recorded("/tagslam/odom/body_cube", ODOMETRY, scattered)])
    as_the_rig = InputsConfig(segmenter=SegmenterConfig(tracker_noise=1.0))
    with pytest.raises(InvalidValueError, match=r"parameter evaluate_on: found .* say segmenter.tracker_noise="):
        evaluation_tosses("parameter evaluate_on", [bag], ReadingConfig(CONTACTNETS_CUBE, as_the_rig))
    told = InputsConfig(segmenter=SegmenterConfig(tracker_noise=8.0))
    assert len(evaluation_tosses("parameter evaluate_on", [bag], ReadingConfig(CONTACTNETS_CUBE, told))) == 2
