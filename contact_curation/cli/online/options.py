"""The options of `online`, and what they ask for."""

import argparse
from pathlib import Path

from contact_curation.cli.options.reading import add_body_option
from contact_curation.cli.options.types import natural_number, number_from_zero, positive_integer
from contact_curation.cli.report import add_json_option
from contact_curation.information.ranker import DEFAULT_CRITERION, criterion_names
from contact_curation.session.config import CAMERAS, SessionConfig


def add_online_options(parser: argparse.ArgumentParser) -> None:
    """Adds all options."""
    parser.add_argument("--throws", type=positive_integer, metavar="N", help="end after so many throws (default: go on)")
    parser.add_argument(
        "--camera", choices=CAMERAS, default=CAMERAS[0], help="tracked poses, or images with tags (default poses)"
    )
    parser.add_argument("--dashboard", action="store_true", help="serve the dashboard to a browser; its address is printed")
    parser.add_argument("--stay", action="store_true", help="serve it until Ctrl-C, also when the throws are over")
    parser.add_argument("--record", type=Path, metavar="DIR", help="keep the session in this folder: bag, model, report, logs")
    add_body_option(parser, "--body-file")  # the nodes' name for it
    parser.add_argument("--top", type=positive_integer, metavar="K", help="how many tosses are selected (default 32)")
    parser.add_argument("--criterion", choices=criterion_names(), help=f"by what --top selects (default {DEFAULT_CRITERION})")
    parser.add_argument("--seed", type=natural_number, metavar="N", help="of all that is random (default 0)")
    parser.add_argument(
        "--rate", type=number_from_zero, metavar="R", help="simulated seconds a second; 0: as fast as possible (default 1)"
    )
    parser.add_argument(
        "--held-out",
        type=Path,
        nargs="+",
        action="extend",
        default=[],
        metavar="INPUT",
        help="recordings that are never trained on, to evaluate the model on (default none)",
    )
    parser.add_argument(
        "--params-file",
        type=Path,
        metavar="YAML",
        help="parameters of the nodes, a file like contact_curation/config/nodes.yaml",
    )
    add_json_option(parser)


def session_config(arguments: argparse.Namespace) -> SessionConfig:
    """The options' configuration."""
    return SessionConfig(
        throws=arguments.throws or 0,
        camera=arguments.camera,
        dashboard=arguments.dashboard or arguments.stay,
        stay=arguments.stay,
        record=arguments.record,
        body_file=arguments.body,
        top=arguments.top,
        criterion=arguments.criterion,
        seed=arguments.seed,
        rate=arguments.rate,
        held_out=tuple(arguments.held_out),
        params_file=arguments.params_file,
    )
