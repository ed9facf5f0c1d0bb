"""Options of all verbs that read recordings: inputs, the object, topics and frames, and any field of the stages."""

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contact_curation.cli.options.body import add_body_option
from contact_curation.cli.options.settings import add_settings, with_settings

if TYPE_CHECKING:
    from contact_curation.storage.inputs.inputs import InputsConfig
    from contact_curation.storage.inputs.pose_source import PoseTopicConfig


SHARED_STAGES = ("poses", "segmenter", "rig", "gates")
"""Of every verb that learns from recordings, or has them judge."""


def add_reading_options(parser: argparse.ArgumentParser, stages: tuple[str, ...], *, needed: bool = True) -> None:
    """Adds the options; `stages` are those whose fields `--set` may change, and `needed` whether there must be an INPUT."""
    parser.add_argument(
        "inputs",
        nargs="+" if needed else "*",
        type=Path,
        metavar="INPUT",
        help="MCAP file, rosbag2 folder or its storage file, ROS 1 bag, folder of ContactNets .pt files or one of them",
    )
    add_body_option(parser)
    add_pose_options(parser)
    add_settings(parser, stages)


def add_pose_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options that say where the poses are."""
    group = parser.add_argument_group("where the poses are (found by themselves in TagSLAM bags)")
    group.add_argument("--topic", default="", help="topic with the object's poses")
    group.add_argument("--body-frame", default="", metavar="FRAME", help="the object's frame (default body_NAME)")
    group.add_argument("--tag-map", default="", metavar="FILE", help="tags of object and board, to read detections with (YAML)")
    group.add_argument("--board-frame", metavar="FRAME", help="the board's frame, z up (default body_surface)")


def reading_words(arguments: argparse.Namespace) -> list[str]:
    """The options that were given, for another verb that reads the same recordings."""
    options = {
        "body": arguments.body,
        "topic": arguments.topic,
        "body-frame": arguments.body_frame,
        "tag-map": arguments.tag_map,
    }
    words = [word for name, value in options.items() if value for word in (f"--{name}", str(value))]
    words += [] if arguments.board_frame is None else ["--board-frame", arguments.board_frame]
    shared = [setting for setting in arguments.settings if setting.partition(".")[0] in SHARED_STAGES]
    return [*words, *(word for setting in shared for word in ("--set", setting))]


def stages_of(arguments: argparse.Namespace, others: Mapping[str, Any]) -> dict[str, Any]:
    """The stages `poses`, `segmenter`, `rig` and `gates` and the `others`, as the options want them.

    Raises:
        ContactCurationError: a setting that no stage accepts, or `--tag-map` names no map of tags.
    """
    from contact_curation.motion.calibration import NO_CORRECTION
    from contact_curation.motion.gates import GateConfig
    from contact_curation.motion.segmenter_config import SegmenterConfig

    stages = {
        "poses": _poses_of(arguments),
        "segmenter": SegmenterConfig(),
        "rig": NO_CORRECTION,
        "gates": GateConfig(),
        **others,
    }
    chosen = with_settings(stages, arguments.settings)
    if tag_map := chosen["poses"].tag_map:
        from contact_curation.storage.tag_map_file import read_tag_maps

        read_tag_maps(Path(tag_map))  # so that a file that is none is said once, and not of every input
    return chosen


def inputs_of(stages: Mapping[str, Any], *, gated: bool = True) -> "InputsConfig":
    """How `stages_of` has recordings read; without gates where they are not wanted."""
    from contact_curation.storage.inputs.inputs import InputsConfig

    gates = replace(stages["gates"], enabled=stages["gates"].enabled and gated)
    return InputsConfig(stages["poses"], stages["segmenter"], gates, stages["rig"])


def _poses_of(arguments: argparse.Namespace) -> "PoseTopicConfig":
    from contact_curation.storage.inputs.pose_source import PoseTopicConfig

    poses = PoseTopicConfig(topic=arguments.topic, body_frame=arguments.body_frame, tag_map=arguments.tag_map)
    return poses if arguments.board_frame is None else replace(poses, board_frame=arguments.board_frame)
