"""Options of all verbs that read recordings: inputs, object, topics and frames, held-out tosses, fields of the stages."""

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contact_curation.cli.options.body import add_body_option, body_words
from contact_curation.cli.options.settings import add_fields, add_settings, with_options, with_settings

if TYPE_CHECKING:
    from contact_curation.storage.inputs.inputs import InputsConfig

SHARED_STAGES = ("poses", "segmenter", "rig", "gates")
"""Stages of every verb that learns from recordings or evaluates on them."""

POSES = ("topic", "body_frame", "tag_map", "board_frame")
"""Fields of the stage `poses` that have options of their own."""


def add_held_out_option(parser: argparse._ArgumentGroup, default: str) -> None:
    """Adds `--held-out`; `default` describes its default."""
    parser.add_argument(
        "--held-out",
        metavar="SPEC",
        help="numbers of tosses (400-569, or 3,7-9: of a file by its name, in a recording from 0), a share (0.2) by a digest "
        f"of their ids, a file with an id a line, a manifest (its selected tosses), or none ({default})",
    )


def add_params_option(parser: argparse._ArgumentGroup, described: str) -> None:
    """Adds `--params`, which may be given several times; `described` says what it takes and what it does."""
    parser.add_argument(
        "--params",
        "--checkpoint",
        dest="params",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help=described,
    )


def add_reading_options(parser: argparse.ArgumentParser, stages: tuple[str, ...], *, needed: bool = True) -> None:
    """Adds the options; `stages` are the stages that `--set` may change, `needed` says whether an INPUT is required."""
    parser.add_argument(
        "inputs",
        nargs="+" if needed else "*",
        action=Recordings,
        metavar="INPUT",
        help="MCAP file, rosbag2 folder or its storage file, ROS 1 bag, folder of ContactNets .pt files or one of them; its "
        "address (s3://, gs://, https://); or a pattern such as 'bags/*.mcap' or 's3://lab/*.mcap'",
    )
    add_body_option(parser)
    add_pose_options(parser)
    add_settings(parser, stages)


class Recordings(argparse.Action):
    """Collects recordings; a pattern stands for all paths that match it. `given` are the INPUTs as they were written."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: Any = None) -> None:
        from contact_curation.pipeline.tosses import input_paths

        setattr(namespace, self.dest, list(input_paths(values)))
        if not self.option_strings:
            namespace.given = values


def add_pose_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options for the pose topics."""
    group = parser.add_argument_group("where the poses are (found by themselves in TagSLAM bags)")
    from contact_curation.storage.inputs.pose_source import PoseTopicConfig

    add_fields(group, PoseTopicConfig(), *POSES)


def reading_words(arguments: argparse.Namespace) -> list[str]:
    """The options that were given, as words for another verb that reads the same recordings."""
    given = {name: getattr(arguments, name) for name in POSES}
    options = {f"--{name.replace('_', '-')}": str(value) for name, value in given.items() if value is not None}
    words = [word for option in options.items() for word in option]
    shared = [setting for setting in arguments.settings if setting.partition(".")[0] in SHARED_STAGES]
    return [*body_words(arguments), *words, *(word for setting in shared for word in ("--set", setting))]


def stages_of(arguments: argparse.Namespace, others: Mapping[str, Any]) -> dict[str, Any]:
    """The configs of the stages `poses`, `segmenter`, `rig` and `gates` and of the `others`, with the options applied.

    Raises:
        ContactCurationError: no stage accepts a setting, or the file of `--tag-map` is no tag map.
    """
    from contact_curation.motion.calibration import NO_CORRECTION
    from contact_curation.motion.gate_config import GateConfig
    from contact_curation.motion.segmenter_config import SegmenterConfig
    from contact_curation.storage.inputs.pose_source import PoseTopicConfig

    poses = with_options(PoseTopicConfig(), arguments, *POSES)
    stages = {"poses": poses, "segmenter": SegmenterConfig(), "rig": NO_CORRECTION, "gates": GateConfig(), **others}
    chosen = stages | with_settings({name: stages[name] for name in arguments.stages}, arguments.settings)
    if tag_map := chosen["poses"].tag_map:
        from contact_curation.storage.tag_map_file import read_tag_maps

        read_tag_maps(Path(tag_map))  # a wrong file is then reported once, not for every input
    return chosen


def inputs_of(stages: Mapping[str, Any], *, gated: bool = True) -> "InputsConfig":
    """The configuration of reading from the configs of `stages_of`; without quality checks if `gated` is False."""
    from contact_curation.storage.inputs.inputs import InputsConfig

    gates = replace(stages["gates"], enabled=stages["gates"].enabled and gated)
    return InputsConfig(stages["poses"], stages["segmenter"], gates, stages["rig"])
