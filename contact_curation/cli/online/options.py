"""The options of `online`: the fields of a session's config."""

import argparse
from dataclasses import replace

from contact_curation.cli.options.body import add_body_option
from contact_curation.cli.options.settings import add_fields, with_options
from contact_curation.cli.report import add_json_option
from contact_curation.information.ranker import criterion_names
from contact_curation.session.config import CAMERAS, SessionConfig

OPTIONS = (
    "throws", "camera", "dashboard", "stay", "record", "resume", "top", "criterion", "seed", "rate", "evaluate_on",
    "params_file"
)  # fmt: skip
CHOICES = {"camera": CAMERAS, "criterion": criterion_names()}
ALSO = {"record": ("--out",), "evaluate_on": ("--held-out",)}
"""Further names of options: those that outputs have in other verbs, and former names."""

SHOWN = {"record": "DIR", "evaluate_on": "INPUT", "params_file": "YAML", "top": "K"}


def add_online_options(parser: argparse.ArgumentParser) -> None:
    """Adds all options."""
    add_fields(parser, SessionConfig(), *OPTIONS, choices=CHOICES, shown=SHOWN, also=ALSO)
    add_body_option(parser, "--body-file", details=False)  # the name of the nodes' former parameter
    add_json_option(parser)


def session_config(arguments: argparse.Namespace) -> SessionConfig:
    """The configuration that the options describe."""
    config: SessionConfig = with_options(SessionConfig(body_file=arguments.body), arguments, *OPTIONS)
    return replace(config, dashboard=config.dashboard or config.stay)
