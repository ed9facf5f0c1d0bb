"""`rank INPUT...`: computes the information of each toss, and ranks and selects tosses."""

import argparse
from dataclasses import replace
from pathlib import Path

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.model import add_model_option, model_and_form
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import add_overwrite_option, check_outputs
from contact_curation.cli.options.ranking import check_variant
from contact_curation.cli.options.reading import (
    SHARED_STAGES,
    add_held_out_option,
    add_params_option,
    add_reading_options,
    inputs_of,
    stages_of,
)
from contact_curation.cli.options.settings import add_fields, with_options
from contact_curation.cli.options.types import PathEndingIn, positive_integer
from contact_curation.cli.progress import Progress
from contact_curation.cli.rank.dashboard import add_dashboard_options, dashboard_of
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.models.registry import MODELS
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.files import BLUEPRINT
from contact_curation.information.criteria.orthogonal import VARIANTS
from contact_curation.information.network.config import CPU, GPU_MEMORY_MB, Device, network_config_for
from contact_curation.information.ranker import RankingConfig, criterion_names
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.pipeline.division import held_out_rule
from contact_curation.pipeline.ranking import RankConfig, rank_tosses
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.recordings.index import RecordingIndex
from contact_curation.pipeline.scoring import PoolConfig
from contact_curation.pipeline.theta import form_of, of_other_rigs, thetas_of
from contact_curation.pipeline.workers import Engine
from contact_curation.storage.manifest.file import FORMATS, check_names, provenance_of
from contact_curation.storage.outputs import CSV

STAGES = (*SHARED_STAGES, "loss", "network", "ranking")
BLOCKS = ("all", "physical")
CHOICES = {"criterion": criterion_names(), "variant": VARIANTS}
TOLD = {"criterion": "by what the best tosses are selected"}
RANKING = ("criterion", "variant", "top", "seed")
SCORING = ("estimator", "influence_bound")
ENGINES = ("local", "ray")


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Scores all tosses that pass the quality checks, ranks those that are not held out, and prints the ranking with its "
        "diagnostics. For an input that cannot be read a line is printed to standard error and the others are ranked; the "
        "exit status is 1 only if no input could be ranked."
    )
    add_reading_options(parser, STAGES)
    add_held_out_option(parser.add_argument_group("what is not ranked"), "default none")
    _add_model_options(parser)
    add_fields(parser.add_argument_group("how they are ranked"), RankingConfig(), *RANKING, choices=CHOICES, told=TOLD)
    _add_engine_options(parser)
    _add_output_options(parser)
    add_dashboard_options(parser)
    parser.set_examples(
        "contact-curation rank session.mcap --top 8 --out manifest.parquet",
        "contact-curation rank bags/*.mcap --body brick.yaml --criterion log-det --held-out 0.2 --out manifest.csv",
        "contact-curation rank 's3://lab/2026/*.mcap' --index ranked/index --engine ray --out ranked/manifest.parquet",
    )
    parser.set_defaults(run=run)


def _add_model_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("parameters theta that the information is about")
    add_model_option(group)
    add_params_option(
        group,
        "theta: a .safetensors checkpoint, or of a polytope a JSON file; given several times, the ranking averages over them "
        "(default: the object as described; a network has none)",
    )
    group.add_argument(
        "--block",
        choices=BLOCKS,
        default="all",
        help="parameters that count: all, or of a deep model only those of its polytope (default all)",
    )
    group.add_argument(
        "--form",
        choices=[form.value for form in Form],
        help="how theta is parameterised (default: its own; of the body as described rigid)",
    )
    group.add_argument(
        "--device", default=CPU, metavar="NAME", help="where networks are evaluated: cpu, cuda or cuda:N (default cpu)"
    )
    group.add_argument(
        "--device-memory",
        type=int,
        metavar="MB",
        help="memory for the transitions that are evaluated together; 0 evaluates each toss by itself "
        f"(default 0 on the CPU, {GPU_MEMORY_MB} on a GPU)",
    )
    add_fields(group, ScoringConfig(), "estimator")
    bounds = group.add_mutually_exclusive_group()
    bounds.add_argument(
        "--bound-influence",
        action="store_true",
        help="scale scores down where the loss is above the pool's 98.5 %% quantile; reads in two passes",
    )
    add_fields(bounds, ScoringConfig(), "influence_bound")
    group.add_argument("--no-gate", action="store_true", help="score tosses that the quality checks would reject, too")


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("output")
    group.add_argument(
        "--out", type=PathEndingIn(*FORMATS), metavar="MANIFEST", help="manifest to write: a .parquet, .csv or .json file"
    )
    figures = group.add_mutually_exclusive_group()
    figures.add_argument(
        "--figure", type=PathEndingIn(".png"), metavar="FILE.png", help="figure of the ranking (default: beside the manifest)"
    )
    figures.add_argument("--no-figure", action="store_true", help="draw no figure")
    add_overwrite_option(group)
    add_json_option(parser)


def _add_engine_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("where many recordings are read and scored")
    group.add_argument(
        "--jobs",
        type=positive_integer,
        metavar="N",
        help="number of inputs that are read at the same time (default: one per processor, as far as starting processes pays)",
    )
    group.add_argument(
        "--engine",
        choices=ENGINES,
        default="local",
        help="processes of this machine, or workers of a Ray cluster (default local)",
    )
    group.add_argument(
        "--address", default="", metavar="ADDRESS", help="of the Ray cluster (default: RAY_ADDRESS, else one on this machine)"
    )
    group.add_argument(
        "--index",
        type=Path,
        metavar="DIR",
        help="folder that keeps what was read and scored, made when it is missing: a second ranking reads and scores only what "
        "changed, and one that was interrupted goes on",
    )


def run(arguments: argparse.Namespace) -> int:
    """Reads, scores and ranks the tosses, writes the outputs, and prints the ranking.

    Raises:
        ContactCurationError: nothing could be ranked, or an output cannot be written.
    """
    figure = _figure(arguments)
    check_outputs(overwrite=arguments.overwrite, out=arguments.out, figure=figure, rrd=arguments.rrd)
    if arguments.rrd:
        check_outputs(overwrite=arguments.overwrite, rrd=arguments.rrd.with_suffix(BLUEPRINT))
    if arguments.out and arguments.out.suffix == CSV:
        check_outputs(overwrite=arguments.overwrite, out=provenance_of(arguments.out))
    if arguments.out:
        check_names((*arguments.command, *map(str, arguments.inputs)))
    config = rank_config(arguments)
    dashboard = dashboard_of(arguments, config)
    try:
        ranked = rank_tosses(arguments.inputs, config, Progress, dashboard.show if dashboard else None)
        if arguments.out and ranked.manifest.rows:
            ranked.save(arguments.out, overwrite=True)  # was checked before the work
        ranked.evidence()  # raises an error if nothing was ranked
        warn(ranked.warnings)
        if figure:
            ranked.save_figure(figure, overwrite=True)
        written = {"out": arguments.out, "figure": figure}
        if arguments.json:
            print_json({**ranked.document(), **{name: str(path) if path else None for name, path in written.items()}})
        else:
            print(ranked)
            for name, path in (("manifest", arguments.out), ("figure", figure)):
                if path:
                    print(f"{name}: {path}")
        if dashboard:
            dashboard.end()
    finally:
        if dashboard:
            dashboard.drop()
    return 0


def rank_config(arguments: argparse.Namespace) -> RankConfig:
    """The configuration that the options describe.

    Raises:
        ContactCurationError: a file that an option names cannot be used, or a setting is not accepted.
    """
    device = Device(arguments.device, arguments.device_memory)
    model, form = model_and_form(arguments.model, None if arguments.form is None else Form(arguments.form))
    body = chosen_body(arguments, models=arguments.params)
    held_out = HeldOutRule() if arguments.held_out is None else held_out_rule(arguments.held_out)
    ranking = with_options(RankingConfig(), arguments, *RANKING)
    network = network_config_for(model)
    stages = stages_of(arguments, {"loss": DEFAULT_LOSS, "network": network, "ranking": ranking})
    check_variant(arguments.variant, stages["ranking"])
    thetas = thetas_of(model, arguments.params, body, form)
    if form is not None and not MODELS[model].is_geometry:
        raise InvalidValueError("--form", form, f"none with model {model}: its checkpoint says which")
    scoring = ScoringConfig(form=form_of(form, thetas), loss=stages["loss"])
    pool = PoolConfig(
        reading=ReadingConfig(body, inputs_of(stages, gated=not arguments.no_gate)),
        thetas=thetas,
        scoring=with_options(scoring, arguments, *SCORING),
        bound_influence=arguments.bound_influence,
        network=replace(stages["network"], physical_only=arguments.block == "physical"),
        device=device,
    )
    pool.scorers(pool.fixed_bounds, jobs=1)  # refuses a theta that does not fit its form before anything is read
    parameters = ", ".join(map(str, arguments.params)) or f"body {body.name}"
    config = RankConfig(pool, stages["ranking"], model, parameters, held_out, arguments.jobs, arguments.command)
    return replace(
        config,
        engine=_engine(arguments),
        index=None if arguments.index is None else RecordingIndex(arguments.index),
        warnings=of_other_rigs(arguments.params, pool.reading.inputs.rig),
    )


def _engine(arguments: argparse.Namespace) -> Engine | None:
    """The engine that schedules the recordings; None for processes on this machine."""
    if arguments.engine == "local":
        if arguments.address:
            raise InvalidValueError("--address", arguments.address, "none without --engine ray")
        return None
    if arguments.jobs is not None:
        raise InvalidValueError("--jobs", arguments.jobs, "none with --engine ray, which knows its cluster's processors")
    from contact_curation.pipeline.recordings.ray_engine import RayEngine

    return RayEngine(arguments.address)


def _figure(arguments: argparse.Namespace) -> Path | None:
    """The path of the figure: that of the option, or beside the manifest; None for no figure."""
    if arguments.no_figure or arguments.figure or arguments.out is None:
        return None if arguments.no_figure else arguments.figure
    return Path(arguments.out).with_suffix(".png")
