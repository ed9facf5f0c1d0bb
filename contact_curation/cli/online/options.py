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
"""Names that these options have, too: an output like those of other verbs, and the one that it had before."""

SHOWN = {"record": "DIR", "evaluate_on": "INPUT", "params_file": "YAML", "top": "K"}


def add_online_options(parser: argparse.ArgumentParser) -> None:
    """Adds all options."""
    add_fields(parser, SessionConfig(), *OPTIONS, choices=CHOICES, shown=SHOWN, also=ALSO)
    add_body_option(parser, "--body-file", details=False)  # the nodes' name for it
    add_json_option(parser)


def session_config(arguments: argparse.Namespace) -> SessionConfig:
    """The options' configuration."""
    config: SessionConfig = with_options(SessionConfig(body_file=arguments.body), arguments, *OPTIONS)
    return replace(config, dashboard=config.dashboard or config.stay)
