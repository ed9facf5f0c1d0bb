"""The options of `online`: the fields of a session's config."""

import argparse
from dataclasses import replace

from contact_curation.cli.options.body import add_body_option
from contact_curation.cli.options.settings import add_fields, with_options
from contact_curation.cli.report import add_json_option
from contact_curation.information.ranker import criterion_names
from contact_curation.session.config import CAMERAS, SessionConfig

OPTIONS = (
    "throws", "camera", "dashboard", "stay", "record", "top", "criterion", "seed", "rate", "held_out", "params_file"
)  # fmt: skip
CHOICES = {"camera": CAMERAS, "criterion": criterion_names()}
SHOWN = {"record": "DIR", "held_out": "INPUT", "params_file": "YAML", "top": "K"}


def add_online_options(parser: argparse.ArgumentParser) -> None:
    """Adds all options."""
    add_fields(parser, SessionConfig(), *OPTIONS, choices=CHOICES, shown=SHOWN)
    add_body_option(parser, "--body-file", details=False)  # the nodes' name for it
    add_json_option(parser)


def session_config(arguments: argparse.Namespace) -> SessionConfig:
    """The options' configuration."""
    config: SessionConfig = with_options(SessionConfig(body_file=arguments.body), arguments, *OPTIONS)
    return replace(config, dashboard=config.dashboard or config.stay)
