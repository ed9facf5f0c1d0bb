"""The options of `design`, and what they ask for."""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

from contact_curation.cli.options.body import add_body_option, chosen_body
from contact_curation.cli.options.reading import SHARED_STAGES, add_pose_options, inputs_of, stages_of
from contact_curation.cli.options.settings import add_settings
from contact_curation.cli.options.types import PathEndingIn, natural_number, positive_integer
from contact_curation.cli.report import add_json_option
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.design.candidates import CandidateConfig
from contact_curation.design.planner import DesignConfig
from contact_curation.pipeline.reading import ReadingConfig

BASELINES = ("paper", "prior")
STAGES = ("design", "forecast", "safety", "noise", "placement", "refinement", "loss", *SHARED_STAGES)


@dataclass(frozen=True, eq=False)
class DesignOptions:
    """What the options ask for.

    Attributes:
        design: how throws are chosen.
        loss: of the information.
        reading: how recordings become tosses.
    """

    design: DesignConfig
    loss: LossConfig
    reading: ReadingConfig


def add_design_options(parser: argparse.ArgumentParser) -> None:
    """Adds all options."""
    _add_theta_options(parser.add_argument_group("what is to be learned"))
    add_body_option(parser)
    group = parser.add_argument_group("what is known")
    group.add_argument(
        "--known", type=Path, nargs="+", default=[], metavar="INPUT", help="recordings of tosses that are kept (default none)"
    )
    group.add_argument("--manifest", type=Path, metavar="FILE", help="of those recordings only the tosses that it kept")
    group.add_argument(
        "--prior",
        type=Path,
        nargs="+",
        default=[],
        metavar="INPUT",
        help="recordings of throws like those to be made (default: the published statistics of ContactNets' releases)",
    )
    add_pose_options(parser)
    group = parser.add_argument_group("throws")
    group.add_argument("--throws", type=positive_integer, default=8, metavar="N", help="how many (default 8)")
    group.add_argument("--seed", type=natural_number, default=0, metavar="N", help="the same gives the same throws (default 0)")
    group.add_argument("--name", default="throw", help="that their ids begin with (default throw)")
    ways = group.add_mutually_exclusive_group()
    ways.add_argument(
        "--baseline", choices=BASELINES, help="paper: a normal in raw coordinates, best by trace; prior: at random"
    )
    ways.add_argument(
        "--warm-up", action="store_true", help="different first impacts instead of information, for an unknown theta"
    )
    group.add_argument("--arm", action="store_true", help="only throws that the simulated arm can make")
    add_settings(parser, STAGES)
    group = parser.add_argument_group("output")
    group.add_argument("--out", type=PathEndingIn(".json"), required=True, metavar="THROWS.json", help="the throws")
    add_json_option(parser)


def _add_theta_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--checkpoint",
        type=PathEndingIn(".safetensors"),
        action="append",
        default=[],
        metavar="C",
        help="theta as `train` wrote it; given several times, gains are averaged over them (default: the object as described)",
    )
    group.add_argument("--params", type=Path, action="append", default=[], metavar="FILE", help="the same, or a JSON file")


def design_config(arguments: argparse.Namespace) -> DesignOptions:
    """The options' configuration.

    Raises:
        ContactCurationError: the body's file cannot be used, or a setting is not accepted.
    """
    candidates = CandidateConfig()
    design = DesignConfig()
    plain = {
        "design": design,
        "forecast": candidates.forecast,
        "safety": candidates.safety,
        "noise": candidates.noise,
        "placement": candidates.placement,
        "refinement": design.refinement,
        "loss": DEFAULT_LOSS,
    }
    stages = stages_of(arguments, plain)
    judged = replace(candidates, **{name: stages[name] for name in ("forecast", "safety", "noise", "placement")})
    return DesignOptions(
        design=replace(stages["design"], candidates=judged, refinement=stages["refinement"]),
        loss=stages["loss"],
        reading=ReadingConfig(chosen_body(arguments), inputs_of(stages)),
    )
