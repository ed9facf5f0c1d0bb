"""A session's ranking from its bag: the pipeline is told what the nodes were told, and so is `rank` for whoever repeats it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from contact_curation.configs import ConfigField, fields_of
from contact_curation.contact.body import Body
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.registry import DEFAULT_MODEL
from contact_curation.contact.parameter_form import Form
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.scoring import ScoringConfig
from contact_curation.motion.calibration import NO_CORRECTION
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.pipeline.ranking import RankConfig
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.scoring import PoolConfig
from contact_curation.pipeline.theta import form_of, thetas_of
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.parameter_files import Parameters
from contact_curation.stages.parameters import as_parameter, with_parameters
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from contact_curation.storage.inputs.records import InputsConfig

NAME = "contact-curation"

RANKING_OPTIONS, SCORING_OPTIONS = ("criterion", "top", "seed", "variant"), ("estimator", "form", "influence_bound")
"""Fields of the ranking and of the scoring that `rank` has options of the same names for."""

POSE_OPTIONS = ("body_frame", "board_frame", "tag_map")
"""Likewise of the pose topics, where they are not empty."""

ELSEWHERE = ("gravity", "threads")
"""Last names of fields that are the body's, or of no consequence for digits."""

OF_THE_RECORDING = "topic"
"""Parameter of pose_ingest that names a live topic; in the recording it is found."""


@dataclass(frozen=True)
class NodeSettings:
    """What the nodes that make a ranking were told, as configs.

    Attributes:
        inputs: of pose_ingest.
        scoring: of fisher_scorer.
        ranking: of the curator.
    """

    inputs: InputsConfig
    scoring: ScoringConfig
    ranking: RankingConfig

    @staticmethod
    def of(parameters: Mapping[str, Parameters]) -> "NodeSettings":
        """From the parameters of the nodes, by node."""
        ingest, scorer, curator = (parameters[node] for node in ("pose_ingest", "fisher_scorer", "curator"))
        poses = {name: value for name, value in ingest.items() if name != OF_THE_RECORDING}
        inputs = InputsConfig(
            poses=with_parameters(PoseTopicConfig(), poses),
            segmenter=with_parameters(SegmenterConfig(), ingest, "segmenter."),
            gates=with_parameters(GateConfig(), ingest, "gates."),
            rig=with_parameters(NO_CORRECTION, ingest, "rig."),
        )
        scoring = with_parameters(ScoringConfig(form=Form.RIGID), scorer)
        return NodeSettings(inputs, scoring, with_parameters(RankingConfig(), curator))


def offline_ranking(
    config: SessionConfig, body: Body, folder: SessionFolder, parameters: Mapping[str, Parameters]
) -> RankConfig:
    """How the pipeline ranks the bag of a session.

    Raises:
        ContactCurationError: the trainer's checkpoint cannot be used.
    """
    settings = NodeSettings.of(parameters)
    paths = [folder.checkpoint] if folder.checkpoint.exists() else []
    wanted = settings.scoring.form.value if "form" in parameters["fisher_scorer"] else None
    thetas = thetas_of(DEFAULT_MODEL, paths, body, wanted)
    pool = PoolConfig(
        reading=ReadingConfig(body, settings.inputs),
        thetas=thetas,
        scoring=replace(settings.scoring, form=form_of(wanted, thetas)),
    )
    said = ", ".join(map(str, paths)) or f"body {body.name}"
    command = tuple(rank_command(config, folder, parameters))
    return RankConfig(pool, settings.ranking, DEFAULT_MODEL, said, command=command)


def rank_command(config: SessionConfig, folder: SessionFolder, parameters: Mapping[str, Parameters]) -> list[str]:
    """The command that gives the same ranking: what the nodes were told, as options.

    Args:
        config: of the session.
        folder: of the session.
        parameters: of its nodes.
    """
    settings, rules = NodeSettings.of(parameters), InputsConfig()
    inputs, scoring, ranking = settings.inputs, settings.scoring, settings.ranking
    words = [NAME, "rank", str(folder.bag), "--out", str(folder.manifest), "--figure", str(folder.ranking_figure)]
    words += ["--body", str(config.body_file)] if config.body_file else []
    words += ["--params", str(folder.checkpoint)] if folder.checkpoint.exists() else []
    words += _options(ranking, RankingConfig(), RANKING_OPTIONS, parameters["curator"])
    words += _options(scoring, ScoringConfig(form=Form.RIGID), SCORING_OPTIONS, parameters["fisher_scorer"])
    poses = {name: getattr(inputs.poses, name) for name in POSE_OPTIONS}
    words += [word for name, value in poses.items() if value for word in (_option(name), str(value))]
    words += _settings("segmenter", inputs.segmenter, rules.segmenter)
    words += _settings("rig", inputs.rig, rules.rig)
    words += _settings("gates", inputs.gates, rules.gates)
    words += _settings("poses", inputs.poses, rules.poses, POSE_OPTIONS)
    words += _settings("loss", scoring.loss, DEFAULT_LOSS)
    words += _settings("ranking", ranking, RankingConfig(), RANKING_OPTIONS)
    return words


def _options(config: Any, default: Any, names: Sequence[str], given: Parameters) -> Iterator[str]:
    """Options of those fields that were given, or are not as they are by default."""
    standard = {field.path: field for field in fields_of(default)}
    for field in fields_of(config):
        if field.path in names and (field.path in given or field != standard[field.path]) and field.default != float("inf"):
            yield from (_option(field.path), _text(field))


def _settings(stage: str, config: Any, default: Any, optional: Sequence[str] = ()) -> Iterator[str]:
    """`--set` for each field that is not as it is by default, but for those that are optional of their own."""
    for field, standard in zip(fields_of(config), fields_of(default)):
        if field != standard and field.path not in optional and field.path.rpartition(".")[2] not in ELSEWHERE:
            yield from ("--set", f"{stage}.{field.path}={_text(field)}")


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _text(field: ConfigField) -> str:
    """A field's value as it would be given."""
    if field.default is None:
        return "none"
    value = as_parameter(field.default)
    return ",".join(map(str, value)) if isinstance(value, list) else str(value)
