"""The run of `evaluate`: reads models and tosses, rolls out, compares, draws, reports."""

import argparse
import os
from collections.abc import Sequence
from dataclasses import replace

import torch

from contact_curation.cli.evaluate.models import JudgedModel, judged_model
from contact_curation.cli.evaluate.picture import picture_of
from contact_curation.cli.evaluate.report import EvaluationReport, json_report, print_report
from contact_curation.cli.evaluate.tosses import JudgingTosses, judging_tosses
from contact_curation.cli.options.body import chosen_body
from contact_curation.cli.options.output_paths import check_outputs
from contact_curation.cli.options.reading import inputs_of, stages_of
from contact_curation.cli.options.rig_settings import settings_of
from contact_curation.cli.progress import Progress
from contact_curation.cli.report import print_json, warn
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.parameter_form import is_physical
from contact_curation.contact.time_step import DEFAULT_LIMITS
from contact_curation.dashboard.figures.motion import save_motion_figure
from contact_curation.learning.evaluation.bootstrap import BootstrapConfig
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
from contact_curation.learning.uncertainty.parameters import Known, KnownConfig, known
from contact_curation.motion.transitions import transitions_of
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.solver.compiled import load_kernel


def run_evaluation(arguments: argparse.Namespace) -> int:
    """What `evaluate` does; see there."""
    torch.set_num_threads(1)  # threads that share busy cores wait for each other, and sums would depend on them
    load_kernel()  # nothing else rolls out: better said before tosses are read
    check_outputs(figure=arguments.figure)
    body = chosen_body(arguments)
    defaults = {"loss": DEFAULT_LOSS, "sweeps": DEFAULT_LIMITS, "bootstrap": BootstrapConfig(), "known": KnownConfig()}
    stages = stages_of(arguments, defaults)
    reading = ReadingConfig(body, inputs_of(stages, gated=not arguments.no_gate))
    seed = stages["bootstrap"].seed if arguments.seed is None else arguments.seed
    bootstrap = replace(stages["bootstrap"], seed=seed)
    config = EvaluationConfig(stages["loss"], stages["sweeps"], bootstrap, threads=os.cpu_count() or 1)
    models = [judged_model(path, body) for path in (arguments.model, arguments.against) if path]
    with Progress("reading", "tosses") as progress:
        tosses = judging_tosses(arguments.inputs, arguments.held_out, models, reading, progress.advance)
    warn((*tosses.warnings, *_of_other_rigs(models, settings_of(stages["rig"]))))
    with Progress("rolling out", "models", len(models)) as progress:
        evaluations = []
        for one in models:
            evaluations.append(evaluate_model(one.model, tosses.judged_by, config))
            progress.advance()
    rigid = {
        f"{one.path}, friction at the vertices of the gaps": evaluate_model(
            one.model.with_shared_vertices(), tosses.judged_by, config
        )
        for one in models
        if one.model.has_own_friction_vertices
    }
    what_is_known, why_not = _known(models[0], tosses, replace(stages["known"], loss=stages["loss"]))
    report = EvaluationReport(
        tuple(models), tuple(evaluations), rigid, tosses, what_is_known, why_not, bootstrap, arguments.figure
    )
    if report.figure:
        save_motion_figure(picture_of(report), report.figure)
    if arguments.json:
        print_json(json_report(report))
    else:
        print_report(report)
    return 0


def _of_other_rigs(models: Sequence[JudgedModel], settings: str) -> list[str]:
    """Lines on models whose tosses were put right otherwise than those that judge."""
    words = {"": "as recorded"}
    return [
        f"{one.path}: it learned from tosses {words.get(one.rig, f'put right by {one.rig}')}, "
        f"and is judged by tosses {words.get(settings, f'put right by {settings}')}"
        for one in models
        if one.rig is not None and one.rig != settings
    ]


def _known(judged: JudgedModel, tosses: JudgingTosses, config: KnownConfig) -> tuple[Known | None, str]:
    """What is known, or why that cannot be said."""
    model = judged.model
    geometry = model.geometry()
    if geometry is None:
        return None, f"what is known is told of a polytope's parameters; a network of {model.kind} has none with units"
    if not is_physical(geometry):
        return None, "what is known is told of the physical form; this polytope's normal and tangents have a scale of their own"
    if not tosses.fitted:
        return None, "what is known needs the tosses that it was fitted to among the inputs, beside those that judge it"
    scale = model.body.length_scale
    return known(model, transitions_of(tosses.fitted, scale), transitions_of(tosses.judged_by, scale), config), ""
