"""What the options of `train` ask for."""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.held_out import held_out_rule
from contact_curation.cli.options.reading import inputs_of, stages_of
from contact_curation.cli.train.options import DEFAULT_SHARE
from contact_curation.contact.body import Body
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.kind import ModelKind
from contact_curation.contact.models.model import Model
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.information.ranker import DEFAULT_CRITERION, RankingConfig
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.learning.training.plan import TrainingPlan
from contact_curation.learning.training.protocols import TrainingConfig, budgeted, exact, published
from contact_curation.learning.training.reranking import CanaryConfig, RerankingConfig
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.training_tosses import LearningTosses, TossesConfig
from contact_curation.storage.manifest.file import read_manifest
from contact_curation.storage.parameters_file import Parameters, is_checkpoint, read_theta

PROTOCOLS = {"budgeted": budgeted, "published": published}
"""Those that every model has."""

ONLY_WITH_TOP = ("criterion", "variant", "estimator", "rerank_every", "canary")


@dataclass(frozen=True, eq=False)
class TrainConfig:
    """What the options ask for.

    Attributes:
        kind: of the model.
        body: the object.
        tosses: which are read, and what for.
        protocol: of the training.
        selection: the best of them; None for all.
        scoring: how tosses are scored for it.
        start: to begin with; None for the published initialisation.
        seed: of everything random.
    """

    kind: ModelKind
    body: Body
    tosses: TossesConfig
    protocol: TrainingConfig
    selection: RerankingConfig | None
    scoring: ScoringConfig
    start: Model | Parameters | None
    seed: int

    def plan(self, tosses: LearningTosses) -> TrainingPlan:
        """The plan of a training on these tosses."""
        start = self.start
        if isinstance(start, Parameters):
            start = _polytope(start, self.protocol.form, tosses)
        return TrainingPlan(
            kind=self.kind,
            body=self.body,
            protocol=self.protocol,
            tosses=tosses.training,
            held_out=tosses.held_out,
            seed=self.seed,
            start=start,
            selection=self.selection,
            scoring=self.scoring,
        )


def train_config(arguments: argparse.Namespace) -> TrainConfig:
    """The options' configuration.

    Raises:
        ContactCurationError: a file that an option names cannot be used, or a value is not accepted.
    """
    kind, body = ModelKind(arguments.model), chosen_body(arguments)
    _check_exact(arguments)
    protocol = exact() if arguments.protocol == "exact" else PROTOCOLS[arguments.protocol](kind)
    ranking = RankingConfig(arguments.criterion or DEFAULT_CRITERION, arguments.top or 1, arguments.seed, certificate_steps=0)
    ranking = replace(ranking, variant=arguments.variant or ranking.variant)
    defaults = {"training": protocol, "ranking": ranking, "canary": CanaryConfig()}
    stages = stages_of(arguments, defaults)
    protocol = stages["training"] if arguments.steps is None else replace(stages["training"], steps=arguments.steps)
    selection = _selection(arguments, stages["ranking"], stages["canary"])
    scoring = ScoringConfig(estimator=Estimator(arguments.estimator or Estimator.GAUSS_NEWTON), loss=protocol.loss)
    return TrainConfig(
        kind=kind,
        body=body,
        tosses=TossesConfig(
            reading=ReadingConfig(body, inputs_of(stages, gated=not arguments.no_gate)),
            rule=HeldOutRule(share=DEFAULT_SHARE) if arguments.held_out is None else held_out_rule(arguments.held_out),
            said=arguments.held_out is not None,
            manifest=arguments.manifest,
            kept=_kept_ids(arguments.manifest),
            with_twins=arguments.keep_twins,
        ),
        protocol=protocol,
        selection=selection,
        scoring=scoring,
        start=_start(arguments.params, kind, body),
        seed=arguments.seed,
    )


def _check_exact(arguments: argparse.Namespace) -> None:
    """Raises InvalidValueError where an option is of no use to an exact training."""
    if arguments.protocol != "exact":
        return
    useless = {
        "--steps": (arguments.steps is not None, "which takes none"),
        "--rerank-every": (arguments.rerank_every is not None, "which selects again at each optimum"),
        "--canary": (arguments.canary, "which selects again at each optimum"),
    }
    for name, (given, why) in useless.items():
        if given:
            raise InvalidValueError(name, f"--protocol exact, {why}", "--protocol budgeted or published")


def _selection(arguments: argparse.Namespace, ranking: RankingConfig, canary: CanaryConfig) -> RerankingConfig | None:
    if arguments.top is None:
        given = next((name for name in ONLY_WITH_TOP if getattr(arguments, name)), None)
        if given:
            raise InvalidValueError(f"--{given.replace('_', '-')}", "no --top", "--top K, which it belongs to")
        return None
    return RerankingConfig(ranking, arguments.rerank_every, canary if arguments.canary else None)


def _kept_ids(manifest: Path | None) -> tuple[str, ...] | None:
    if manifest is None:
        return None
    kept = tuple(row.toss_id for row in read_manifest(manifest).selected)
    if not kept:
        raise InvalidValueError(f"kept tosses of {manifest}", "none", "at least one")
    return kept


def _start(path: Path | None, kind: ModelKind, body: Body) -> Model | Parameters | None:
    if path is None:
        return None
    if not is_checkpoint(path) and kind is not ModelKind.POLYTOPE:
        raise InvalidValueError("--params", f"{path}, a polytope", f"a checkpoint of a {kind.value} model")
    theta = read_theta(path, body)
    if isinstance(theta, Model) and theta.kind is not kind:
        raise InvalidValueError(f"model of {path}", theta.kind.value, f"{kind.value}, as --model says")
    return theta


def _polytope(start: Parameters, form: Form, tosses: LearningTosses) -> PolytopeModel:
    """The same ground about a pivot amid the data, where the physical form's tilt and height keep apart."""
    geometry = start.geometry
    if form is Form.PHYSICAL:
        middle = np.concatenate([toss.positions for toss in tosses.training]).mean(axis=0) / start.body.length_scale
        pivot = np.array([*middle[:2], 0.0])
        geometry = _about(geometry, pivot)
    return PolytopeModel(geometry, start.body, form)


def _about(geometry: ContactGeometry, pivot: Array) -> ContactGeometry:
    return replace(geometry, pivot=pivot, height=geometry.height + float(geometry.normal @ (geometry.pivot - pivot)))
