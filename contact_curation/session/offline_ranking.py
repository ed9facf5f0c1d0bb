"""The `rank` command that gives a session's own final ranking from its bag: the nodes' parameters as the verb's options."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.information.ranker import DEFAULT_CRITERION, STREAMED_CRITERION, RankingConfig
from contact_curation.motion.calibration import NO_CORRECTION
from contact_curation.motion.gates import GateConfig
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.session.node_settings import SessionFolder
from contact_curation.session.parameter_files import Parameters
from contact_curation.storage.inputs.pose_source import PoseTopicConfig

OPTIONS = {"criterion": "--criterion", "top": "--top", "seed": "--seed", "variant": "--variant"}
"""Of the curator."""

SCORING = {"estimator": "--estimator", "form": "--form"}
"""Of the scorer."""

FROM_THE_BODY = ("gravity",)
POSES = ("body_frame", "board_frame", "tag_map")
"""Of pose_ingest, with options of the same names."""


def ranking_figure_of(folder: SessionFolder) -> Path:
    """Where the command draws its figure."""
    return folder.figures / "ranking.png"


def rank_command(folder: SessionFolder, parameters: Mapping[str, Parameters], body_file: Path | None) -> list[str]:
    """The words of the command.

    Args:
        folder: of the session.
        parameters: of its nodes.
        body_file: describes the body; None for ContactNets' cube.
    """
    ingest, scorer = parameters["pose_ingest"], parameters["fisher_scorer"]
    curator = _with_its_criterion(parameters["curator"])
    words = ["contact-curation", "rank", str(folder.bag), "--out", str(folder.manifest)]
    words += ["--figure", str(ranking_figure_of(folder))]
    words += ["--body", str(body_file)] if body_file else []
    words += ["--params", str(folder.checkpoint)] if folder.checkpoint.exists() else []
    for values, options in ((curator, OPTIONS), (scorer, SCORING)):
        words += [word for name, option in options.items() if name in values for word in (option, str(values[name]))]
    if scorer.get("influence_bound", float("inf")) != float("inf"):
        words += ["--influence-bound", str(scorer["influence_bound"])]
    words += [word for name in POSES if ingest.get(name) for word in (f"--{name.replace('_', '-')}", str(ingest[name]))]
    words += _settings("segmenter", ingest, SegmenterConfig(), "segmenter.")
    words += _settings("rig", ingest, NO_CORRECTION, "rig.")
    words += _settings("gates", ingest, GateConfig(), "gates.")
    words += _settings("poses", ingest, PoseTopicConfig(), "")
    words += _settings("loss", scorer, DEFAULT_LOSS, "loss.")
    words += _settings("ranking", curator, RankingConfig(), "")
    return words


def _with_its_criterion(curator: Parameters) -> Parameters:
    """The curator's parameters; where it let tosses go another criterion stood in for the default one."""
    whole = curator.get("selection", "exact") == "exact"
    stood_in = not whole and curator.get("criterion", DEFAULT_CRITERION) == DEFAULT_CRITERION
    return {**curator, "criterion": STREAMED_CRITERION} if stood_in else curator


def _settings(stage: str, values: Parameters, defaults: Any, prefix: str) -> Iterator[str]:
    """`--set` for each parameter that is not as it is by default; threads and gravity are no matter of taste."""
    for path, default in _leaves(defaults):
        name = f"{prefix}{path}"
        given_elsewhere = (*FROM_THE_BODY, "threads", *(OPTIONS if stage == "ranking" else ()), *POSES, "topic")
        if name not in values or path in given_elsewhere:
            continue
        value = values[name]
        if default is None and not value:
            value = "none"
        text = ",".join(str(each) for each in value) if isinstance(value, list) else str(value)
        if text != _text(default):
            yield from ("--set", f"{stage}.{path}={text}")


def _leaves(config: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every field that is no configuration itself, by its path."""
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            yield from _leaves(value, f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", value


def _text(default: Any) -> str:
    """A default as it would be given."""
    if default is None:
        return "none"
    return ",".join(str(each) for each in default) if isinstance(default, tuple) else str(default)
