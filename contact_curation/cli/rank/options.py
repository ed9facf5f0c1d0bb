"""The options of `rank`, and what they ask for."""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.held_out import add_held_out_option, held_out_rule
from contact_curation.cli.options.reading import SHARED_STAGES, add_reading_options, inputs_of, stages_of
from contact_curation.cli.options.theta import form_of, thetas_of
from contact_curation.cli.options.types import PathEndingIn, natural_number, positive_integer, positive_number
from contact_curation.cli.report import add_json_option
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.registry import DEFAULT_MODEL, MODELS
from contact_curation.contact.parameter_form import Form
from contact_curation.information.criteria.orthogonal import VARIANTS
from contact_curation.information.network.config import network_config_for
from contact_curation.information.network.score_folder import ScoreFolder
from contact_curation.information.ranker import DEFAULT_CRITERION, RankingConfig, criterion_named, criterion_names
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.pipeline.held_out_tosses import HeldOutTosses
from contact_curation.pipeline.pool_scoring import PoolConfig
from contact_curation.pipeline.reading import ReadingConfig

STAGES = (*SHARED_STAGES, "loss", "network", "ranking")
BLOCKS = ("all", "physical")
FORMATS = (".parquet", ".csv", ".json")


def add_rank_options(parser: argparse.ArgumentParser) -> None:
    """Adds all options."""
    add_reading_options(parser, STAGES)
    add_held_out_option(parser.add_argument_group("what is neither scored nor ranked"), "default none")
    _add_model_options(parser)
    _add_ranking_options(parser)
    _add_output_options(parser)


def _add_model_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what the tosses teach about")
    group.add_argument("--model", choices=list(MODELS), default=DEFAULT_MODEL, help="the model (default polytope)")
    group.add_argument(
        "--params",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="theta: a .safetensors checkpoint, or of a polytope a JSON file; given several times, the ranking averages over "
        "them (default: the object as described; a network has none)",
    )
    group.add_argument(
        "--block",
        choices=BLOCKS,
        default="all",
        help="of theta: all of it, or of a deep model only the parameters of its polytope (default all)",
    )
    group.add_argument(
        "--form",
        choices=[form.value for form in Form],
        help="how theta is parameterised (default: physical where theta allows it, else contactnets)",
    )
    group.add_argument(
        "--estimator",
        choices=[estimator.value for estimator in Estimator],
        default=Estimator.GAUSS_NEWTON.value,
        help="of the Fisher matrix (default gauss-newton)",
    )
    bounds = group.add_mutually_exclusive_group()
    bounds.add_argument(
        "--bound-influence",
        action="store_true",
        help="scale scores down where the loss is above the pool's 98.5 %% quantile; reads in two passes",
    )
    bounds.add_argument(
        "--influence-bound", type=positive_number, default=np.inf, metavar="LOSS", help="the same with a bound of your own"
    )
    group.add_argument("--no-gate", action="store_true", help="score what the gates would keep back, too")


def _add_ranking_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("how they are ranked")
    group.add_argument(
        "--criterion",
        choices=criterion_names(),
        default=DEFAULT_CRITERION,
        help=f"by what --top chooses (default {DEFAULT_CRITERION})",
    )
    group.add_argument("--variant", choices=VARIANTS, default="pivoted", help="of criterion orthogonal (default pivoted)")
    group.add_argument("--top", type=positive_integer, default=32, metavar="K", help="how many are kept (default 32)")
    group.add_argument("--seed", type=natural_number, default=0, metavar="N", help="of criterion random (default 0)")


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("output")
    group.add_argument("--out", type=PathEndingIn(*FORMATS), metavar="MANIFEST", help="a .parquet, .csv or .json file")
    figures = group.add_mutually_exclusive_group()
    figures.add_argument("--figure", type=PathEndingIn(".png"), metavar="FILE.png", help="(default: beside the manifest)")
    figures.add_argument("--no-figure", action="store_true", help="draw none")
    group.add_argument(
        "--jobs", type=positive_integer, metavar="N", help="read so many inputs at once (default: one per processor)"
    )
    add_json_option(parser)


@dataclass(frozen=True, eq=False)
class RankConfig:
    """What the options ask for.

    Attributes:
        pool: how recordings become scored tosses.
        ranking: how these are ranked.
        parameters: where theta comes from, for the manifest.
        held_out: what is neither scored nor ranked.
    """

    pool: PoolConfig
    ranking: RankingConfig
    parameters: str
    held_out: HeldOutRule

    def without(self, held_out: HeldOutTosses) -> "RankConfig":
        """The same; tosses that are held out are kept back."""
        reading = replace(self.pool.reading, held_out=held_out.reasons)
        return replace(self, pool=replace(self.pool, reading=reading))

    def with_exact_scores_in(self, folder: Path) -> "RankConfig":
        """The same; where the criterion asks for networks' scores themselves they go to a folder, whole."""
        wanted = criterion_named(self.ranking.criterion).reads_exact_scores(self.ranking)
        if not (wanted and self.pool.of_weights):
            return self
        return replace(self, pool=replace(self.pool, score_folder=ScoreFolder(folder)))


def rank_config(arguments: argparse.Namespace) -> RankConfig:
    """The options' configuration.

    Raises:
        ContactCurationError: a file that an option names cannot be used, or a setting is not accepted.
    """
    body = chosen_body(arguments)
    held_out = HeldOutRule() if arguments.held_out is None else held_out_rule(arguments.held_out)
    ranking = RankingConfig(arguments.criterion, arguments.top, arguments.seed, variant=arguments.variant)
    network = network_config_for(arguments.model)
    stages = stages_of(arguments, {"loss": DEFAULT_LOSS, "network": network, "ranking": ranking})
    thetas = thetas_of(arguments, body)
    pool = PoolConfig(
        reading=ReadingConfig(body, inputs_of(stages, gated=not arguments.no_gate)),
        thetas=thetas,
        scoring=ScoringConfig(
            estimator=Estimator(arguments.estimator),
            influence_bound=arguments.influence_bound,
            form=form_of(arguments.form, thetas),
            loss=stages["loss"],
        ),
        bound_influence=arguments.bound_influence,
        network=replace(stages["network"], physical_only=arguments.block == "physical"),
    )
    pool.scorers(pool.fixed_bounds, jobs=1)  # so that a theta that does not fit its form is refused before anything is read
    return RankConfig(pool, stages["ranking"], ", ".join(map(str, arguments.params)) or f"body {body.name}", held_out)
