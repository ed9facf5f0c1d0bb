"""`train INPUT... --out CHECKPOINT`: trains a model on all tosses, on those that a ranking selected, or on the best K."""

import argparse
import shlex
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.model import add_model_option, model_and_form
from contact_curation.cli.options.one_line_parser import OneLineParser
from contact_curation.cli.options.output_paths import check_outputs
from contact_curation.cli.options.ranking import check_variant
from contact_curation.cli.options.reading import (
    SHARED_STAGES,
    add_held_out_option,
    add_reading_options,
    inputs_of,
    reading_words,
    stages_of,
)
from contact_curation.cli.options.settings import add_fields, with_options
from contact_curation.cli.options.types import PathEndingIn, natural_number, number_from_zero, positive_integer, positive_number
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import add_json_option, print_json, warn
from contact_curation.cli.stop_signals import StopSignals
from contact_curation.errors import InvalidValueError, UnreadableInputError, why_unreadable
from contact_curation.files import as_word, write_atomically
from contact_curation.information.criteria.orthogonal import VARIANTS
from contact_curation.information.ranker import RankingConfig, criterion_names
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.evaluation.held_out import HeldOutRule
from contact_curation.pipeline.division import DivisionConfig, LearningTosses, held_out_rule, learning_tosses, selected_ids
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.theta import learned_before, of_start
from contact_curation.pipeline.tosses import read_tosses
from contact_curation.solver.compiled import load_kernel
from contact_curation.storage.export.selected import ranked_recordings
from contact_curation.storage.manifest.file import read_manifest
from contact_curation.version import __version__

if TYPE_CHECKING:
    from contact_curation.cli.train.metrics import TrainingMetrics
    from contact_curation.learning.training.protocols import TrainingConfig
    from contact_curation.learning.training.reranking import RerankingConfig, StalenessConfig
    from contact_curation.pipeline.training import TrainConfig, TrainingRun

STAGES = (*SHARED_STAGES, "training", "ranking", "staleness")
PROTOCOLS = ("auto", "exact", "budgeted", "published")
CHOICES = {"criterion": criterion_names(), "variant": VARIANTS}
TOLD = {"criterion": "by what the best tosses are selected"}
DEFAULT_SHARE = 0.2
"""Share of the tosses that is held out by default."""

CHECKPOINT_SECONDS = 30.0
ONLY_WITH_TOP = ("criterion", "variant", "estimator", "rerank_every", "rerank_when_stale")


def add_options(parser: OneLineParser) -> None:
    """Adds the verb's options to its parser."""
    parser.description = (
        "Trains a model on all tosses that pass the quality checks, on those that `rank` selected, or on the best K, which can "
        "be selected again during training. Some tosses are held out: the model is not trained on them, but their loss is "
        "monitored. Ctrl-C stops after the current gradient step and stores a checkpoint; the same command with --resume "
        "continues from it."
    )
    add_reading_options(parser, STAGES)
    _add_model_options(parser)
    _add_toss_options(parser)
    _add_output_options(parser)
    parser.set_examples(
        "contact-curation train session.mcap --manifest manifest.parquet --out model.safetensors",
        "contact-curation train session.mcap --top 16 --protocol exact --out model.safetensors",
    )
    parser.set_defaults(run=run)


def _add_model_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what is trained, and how")
    add_model_option(group)
    group.add_argument(
        "--params",
        "--checkpoint",
        dest="params",
        type=Path,
        metavar="FILE",
        help="where to start: a checkpoint, or a polytope as JSON (default: the published random initialisation)",
    )
    group.add_argument(
        "--shape-known-to",
        type=positive_number,
        metavar="M",
        help="how exactly the corners of --body, or of --params, are known: their standard deviation [m], such as 0.001 for a "
        "part that was milled; the exact protocol begins there, and needs fewer tosses (default: not known; it begins at the "
        "published random initialisation, off by 0.4 length scales)",
    )
    group.add_argument(
        "--protocol",
        choices=PROTOCOLS,
        default=PROTOCOLS[0],
        help="exact: a polytope's optimum at once; budgeted: a number of steps in batches; published: ContactNets', until the "
        "held-out loss stops falling; auto: exact for a polytope, unless an option asks for steps; else budgeted (default)",
    )
    group.add_argument(
        "--steps",
        type=positive_integer,
        metavar="N",
        help="largest number of gradient steps; exact takes none (default: that of the protocol)",
    )
    group.add_argument("--seed", type=natural_number, default=0, metavar="N", help="random seed of the training (default 0)")


def _add_toss_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("which tosses it learns from (default: all)")
    chosen = group.add_mutually_exclusive_group()
    chosen.add_argument(
        "--manifest", type=Path, metavar="FILE", help="learn from the tosses that this manifest of `rank` selected"
    )
    chosen.add_argument(
        "--top", type=positive_integer, metavar="K", help="learn from the best K tosses by the model's own ranking"
    )
    add_fields(group, RankingConfig(), *CHOICES, choices=CHOICES, told=TOLD)
    add_fields(group, ScoringConfig(), "estimator")
    again = group.add_mutually_exclusive_group()
    again.add_argument("--rerank-every", type=positive_integer, metavar="N", help="select the best K again every N epochs")
    again.add_argument(
        "--rerank-when-stale",
        action="store_true",
        help="select them again when the ranks of a fixed sample of tosses have changed (staleness.*)",
    )
    add_held_out_option(group, f"default {DEFAULT_SHARE}; with --manifest of the tosses that were not selected")
    group.add_argument(
        "--keep-duplicates", action="store_true", help="learn from motions, too, that are held out under another id"
    )
    group.add_argument("--no-gate", action="store_true", help="learn from tosses that the quality checks would reject, too")


def _add_output_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("output")
    group.add_argument(
        "--out",
        type=PathEndingIn(".safetensors"),
        required=True,
        metavar="CHECKPOINT",
        help="checkpoint to write: a .safetensors file",
    )
    exists = group.add_mutually_exclusive_group()
    exists.add_argument("--resume", action="store_true", help="continue from the checkpoint, if there is one")
    exists.add_argument("--overwrite", action="store_true", help="start over and replace the checkpoint")
    group.add_argument(
        "--checkpoint-every",
        type=number_from_zero,
        default=CHECKPOINT_SECONDS,
        metavar="SECONDS",
        help=f"(default {CHECKPOINT_SECONDS:g}); the result does not depend on it",
    )
    group.add_argument(
        "--metrics", type=PathEndingIn(".jsonl"), metavar="FILE.jsonl", help="a line of JSON for each evaluation and selection "
        "(default: beside the checkpoint)"
    )  # fmt: skip
    add_json_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reads the tosses, trains a model, writes the checkpoint, and prints a summary.

    Raises:
        ContactCurationError: there is no toss to train on, the checkpoint is of another training, or a loss is not finite.
        KeyboardInterrupt: the training was stopped; the checkpoint is written.
    """
    import torch  # takes over a second, so --help does not import it

    from contact_curation.cli.train.metrics import TrainingMetrics
    from contact_curation.cli.train.report import TrainReport, json_report, print_report

    torch.set_num_threads(1)  # threads wait for each other on busy cores, and the order of sums would depend on their number
    began = time.monotonic()
    _check_out(arguments)
    load_kernel()  # an error should come before tosses are read
    config, reading = _configs(arguments)
    meant = ranked_recordings(read_manifest(arguments.manifest).rows) if arguments.manifest else {}
    with Progress("reading", "tosses") as bar:
        read = read_tosses(arguments.inputs, reading, advance=bar.advance, meant=meant)
    tosses = learning_tosses(read, config.division)
    tosses = replace(tosses, warnings=(*of_start(arguments.params, config.rig, tosses.held_out), *tosses.warnings))
    warn(tosses.warnings)
    running = _begun_or_resumed(arguments, config, tosses)
    metrics_path = _metrics_path(arguments)
    write_atomically(
        arguments.out, running.checkpoint()
    )  # so that a place that cannot be written is known before hours of work
    with TrainingMetrics(metrics_path, running.curated, _start_line(arguments, config, tosses, running)) as metrics:
        _train(running, arguments, metrics)
    if running.running:
        _say_how_to_resume(arguments, running)
        raise KeyboardInterrupt
    running.check(arguments.out)
    report = TrainReport(
        run=running,
        bounce=running.bounce(),
        sticking=running.sticking(),
        doubts=running.doubts(),
        more_throws=running.more_throws(),
        tosses=tosses,
        seconds=time.monotonic() - began,
        checkpoint=arguments.out,
        metrics=metrics_path,
        next_command=_next_command(arguments),
    )
    if arguments.json:
        print_json(json_report(report))
    else:
        print_report(report)
    return 0


def _configs(arguments: argparse.Namespace) -> "tuple[TrainConfig, ReadingConfig]":
    """The configuration of the training, and of reading its tosses.

    Raises:
        ContactCurationError: a file that an option names cannot be used, or a value is not accepted.
    """
    from contact_curation.learning.training.reranking import StalenessConfig
    from contact_curation.pipeline.training import PROTOCOLS as PROTOCOL_OF
    from contact_curation.pipeline.training import TrainConfig, protocol_named, start_of

    kind, form = model_and_form(arguments.model)
    by_steps = arguments.steps is not None or arguments.rerank_every is not None or arguments.rerank_when_stale
    arguments.protocol = protocol_named(arguments.protocol, kind, form, by_steps)
    resumed = arguments.out if arguments.resume and arguments.out.exists() else None
    body = chosen_body(arguments, models=[arguments.params, resumed], manifest=arguments.manifest)
    _check_exact(arguments)
    ranking = RankingConfig(top=arguments.top or 1, seed=arguments.seed, certificate_steps=0)
    ranking = with_options(ranking, arguments, *CHOICES)
    training = PROTOCOL_OF[arguments.protocol](kind)
    training = training if form is None else replace(training, form=form)
    defaults = {"training": training, "ranking": ranking, "staleness": StalenessConfig()}
    stages = stages_of(arguments, defaults)
    protocol: TrainingConfig = stages["training"]
    protocol = protocol if arguments.steps is None else replace(protocol, steps=arguments.steps)
    if arguments.shape_known_to is not None:
        protocol = replace(protocol, shape_known_to=arguments.shape_known_to)
    reading = ReadingConfig(body, inputs_of(stages, gated=not arguments.no_gate))
    division = DivisionConfig(
        rule=HeldOutRule(share=DEFAULT_SHARE) if arguments.held_out is None else held_out_rule(arguments.held_out),
        said=arguments.held_out is not None,
        manifest=arguments.manifest,
        selected=selected_ids(arguments.manifest) if arguments.manifest else None,
        with_duplicates=arguments.keep_duplicates,
    )
    config = TrainConfig(
        kind=kind,
        body=body,
        protocol=protocol,
        division=division,
        selection=_selection(arguments, stages["ranking"], stages["staleness"]),
        scoring=with_options(ScoringConfig(loss=protocol.loss), arguments, "estimator"),
        start=start_of(arguments.params, kind, body),
        seed=arguments.seed,
        rig=reading.inputs.rig,
        learned_before=learned_before(arguments.params),
    )
    return config, reading


def _check_exact(arguments: argparse.Namespace) -> None:
    """Refuses options that have no meaning for an exact training.

    Raises:
        InvalidValueError: such an option was given.
    """
    if arguments.protocol != "exact":
        return
    useless = {
        "--steps": (arguments.steps is not None, "which takes none"),
        "--rerank-every": (arguments.rerank_every is not None, "which selects again at each optimum"),
        "--rerank-when-stale": (arguments.rerank_when_stale, "which selects again at each optimum"),
    }
    for name, (given, why) in useless.items():
        if given:
            raise InvalidValueError(name, f"--protocol exact, {why}", "--protocol budgeted or published")


def _selection(arguments: argparse.Namespace, ranking: RankingConfig, staleness: "StalenessConfig") -> "RerankingConfig | None":
    from contact_curation.learning.training.reranking import RerankingConfig

    if arguments.top is None:
        options = [f"--{name.replace('_', '-')}" for name in ONLY_WITH_TOP if getattr(arguments, name)]
        options += [f"--set {setting}" for setting in arguments.settings if setting.startswith(("ranking.", "staleness."))]
        if options:
            raise InvalidValueError(options[0], "no --top", "--top K, which it belongs to")
        return None
    check_variant(arguments.variant, ranking)
    stale = [setting for setting in arguments.settings if setting.startswith("staleness.")]
    if stale and not arguments.rerank_when_stale:
        raise InvalidValueError(f"--set {stale[0]}", "no --rerank-when-stale", "--rerank-when-stale, which it belongs to")
    return RerankingConfig(ranking, arguments.rerank_every, staleness if arguments.rerank_when_stale else None)


def _check_out(arguments: argparse.Namespace) -> None:
    overwrite = arguments.resume or arguments.overwrite
    check_outputs(overwrite=overwrite, remedy="--resume to go on with it, or --overwrite to start over", out=arguments.out)
    check_outputs(overwrite=overwrite, metrics=_metrics_path(arguments))


def _metrics_path(arguments: argparse.Namespace) -> Path:
    given: Path | None = arguments.metrics
    return given or arguments.out.with_suffix(".jsonl")


def _begun_or_resumed(arguments: argparse.Namespace, config: "TrainConfig", tosses: LearningTosses) -> "TrainingRun":
    from contact_curation.pipeline.training import TrainingRun

    if arguments.resume and arguments.out.exists():
        resumed = TrainingRun.resumed(config, tosses, _content(arguments.out), arguments.out)
        _say(f"going on after {resumed.progress.gradient_steps} gradient steps of {arguments.out}")
        return resumed
    if arguments.resume:
        _say(f"found no {arguments.out} to go on with: starting over")
    return TrainingRun.begun(config, tosses)


def _train(running: "TrainingRun", arguments: argparse.Namespace, metrics: "TrainingMetrics") -> None:
    """Trains to the end, or until the training is stopped."""
    next_write = time.monotonic() + arguments.checkpoint_every
    protocol, done = running.plan.protocol, running.progress.gradient_steps
    steps = None if protocol.exact else protocol.steps  # an optimum takes as many as it takes
    with StopSignals() as stop, Progress("training", "steps", steps, done) as bar:
        while running.running and not stop.wanted:
            note = running.advance()
            metrics.follow()
            bar.advance(1, note)
            if time.monotonic() >= next_write:
                write_atomically(arguments.out, running.checkpoint())
                next_write = time.monotonic() + arguments.checkpoint_every
        write_atomically(arguments.out, running.checkpoint())
        if not running.running:
            metrics.end(running.progress)


def _start_line(
    arguments: argparse.Namespace, config: "TrainConfig", tosses: LearningTosses, running: "TrainingRun"
) -> dict[str, Any]:
    return {
        "gradient_steps": 0,
        "model": config.kind,
        "protocol": arguments.protocol,
        "seed": config.seed,
        "tosses": len(tosses.training),
        "held_out": len(tosses.held_out),
        "duplicates_left_out": len(tosses.duplicates),
        "held_out_loss": running.loss_before,
        "package_version": __version__,
    }


def _say_how_to_resume(arguments: argparse.Namespace, running: "TrainingRun") -> None:
    command, verb, *others = (word for word in arguments.command if word not in ("--overwrite", "--resume"))
    _say(f"stopped after {running.progress.gradient_steps} gradient steps; {arguments.out} holds them; to go on:")
    _say(f"  {shlex.join([command, verb, '--resume', *others])}")


def _next_command(arguments: argparse.Namespace) -> str:
    words = ["contact-curation", "evaluate", *map(as_word, (arguments.out, *arguments.given)), *reading_words(arguments)]
    return shlex.join([*words, *(["--no-gate"] if arguments.no_gate else [])])


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise UnreadableInputError(path, f"cannot be read: {why_unreadable(path, error)}") from error
