"""Evaluates models on tosses: rollouts from the first measured state, and the uncertainty of a polytope's parameters."""

import os
from collections.abc import Sequence
from dataclasses import replace

import torch

from contact_curation.configs import whole_number
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.contact.parameter_form import is_physical
from contact_curation.errors import InvalidValueError
from contact_curation.information.impacts import as_described
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
from contact_curation.learning.evaluation.held_out import HeldOutRule, NumberedToss, split
from contact_curation.learning.evaluation.misfit import sliding_of
from contact_curation.learning.uncertainty.bounce import Bounce, bounce_of
from contact_curation.learning.uncertainty.more_throws import MoreThrows, more_throws
from contact_curation.learning.uncertainty.parameters import Known, KnownConfig, known
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import transitions_of
from contact_curation.pipeline.division import DivisionConfig, HeldOut, held_out_rule, learning_tosses
from contact_curation.pipeline.evaluated import Evaluation, JudgingTosses
from contact_curation.pipeline.learned_model import LearnedModel
from contact_curation.pipeline.theta import of_other_rigs
from contact_curation.pipeline.tosses import Tosses
from contact_curation.pipeline.workers import Progress, silent

EVERYTHING = ""


def evaluation_config(**changes: object) -> EvaluationConfig:
    """How models are evaluated, on all processors."""
    return EvaluationConfig(threads=os.cpu_count() or 1, **changes)  # type: ignore[arg-type]


def evaluate_models(
    models: Sequence[LearnedModel],
    tosses: JudgingTosses,
    config: EvaluationConfig,
    known_config: KnownConfig | None = None,
    progress: Progress = silent,
    more: int | None = None,
) -> Evaluation:
    """Rolls models out along the evaluation tosses.

    Args:
        models: one, or two that are compared.
        tosses: as `judging_tosses` divides them.
        config: of the rollouts, and the loss that is reported.
        known_config: of what is known of a polytope's parameters, by the loss that the first model's training minimised; by
            that of `config` where its file does not say.
        progress: hears how far it is.
        more: number of further throws whose effect is predicted; None for as many as the first model was fitted to.

    Raises:
        InvalidValueError: tosses of another body, or `more` is no whole number of at least 1.
    """
    if more is not None:
        whole_number("more", more, 1)
    torch.set_num_threads(1)  # threads that share busy cores wait for each other, and sums would depend on them
    evaluations = []
    with progress("rolling out", "models", len(models)) as bar:
        for one in models:
            evaluations.append(evaluate_model(one.model, tosses.judged_by, config))
            bar.advance()
    rigid = {
        f"{one.name}, friction at the vertices of the gaps": evaluate_model(
            one.model.with_shared_vertices(), tosses.judged_by, config
        )
        for one in models
        if one.model.has_own_friction_vertices
    }
    minimised = replace(models[0].loss or config.loss, threads=config.loss.threads)
    known_config = replace(known_config or KnownConfig(), loss=minimised).with_shape(models[0].shape)
    what_is_known, why_not = _known(models[0], tosses, known_config)
    bounce = _bounce(models[0], tosses, known_config)
    change = _more(models[0], tosses, replace(config, loss=minimised), more)
    return Evaluation(
        tuple(models), tuple(evaluations), rigid, tosses, what_is_known, why_not, bounce, change, config.bootstrap
    )


def judging_tosses(
    tosses: Tosses,
    spec: HeldOut | None,
    models: Sequence[LearnedModel],
    name: str = "--held-out",
    loss: LossConfig = DEFAULT_LOSS,
) -> JudgingTosses:
    """Divides tosses into those that models are evaluated on and those that they were trained on.

    Args:
        tosses: at least one.
        spec: what is held out; None for what the first model's training held out, or all; all, too, where it is `none`.
        models: at least one; what the first learned from is what it was fitted to.
        name: of the option or parameter with `spec`, for messages.
        loss: that will be reported.

    Raises:
        ContactCurationError: there is no toss to judge by.
    """
    rule = HeldOutRule() if spec is None else held_out_rule(spec, name)
    read = learning_tosses(tosses, DivisionConfig(rule, said=spec is not None, with_duplicates=True))
    judged_by, others, chosen = read.held_out, read.training, f"{name} {spec}"
    if spec is None:
        judged_by, others, chosen = _as_trained(models[0], read.training, name)
    elif not judged_by:  # `none`: nobody tells some apart
        judged_by, others, chosen = read.training, (), EVERYTHING
    learned, last = models[0].learned_from, models[0].fitted_to
    seen = [toss for toss in others if not learned or toss.toss_id in learned]
    fitted = tuple(toss for toss in seen if not last or toss.toss_id in last)
    parts = split([NumberedToss(toss, 0) for toss in (*judged_by, *seen)], HeldOutRule(ids=_ids(judged_by)))
    duplicates = frozenset(duplicate.held_out for duplicate in parts.duplicates)
    rigs = of_other_rigs(models, tosses.config.inputs.rig)
    return JudgingTosses(
        judged_by=judged_by,
        fitted=fitted,
        chosen=chosen,
        accepted=len(tosses),
        rejected=tosses.reasons,
        duplicates=duplicates,
        warnings=(*read.warnings, *_seen_before(judged_by, models), *rigs, *_of_other_losses(models, loss)),
    )


def _as_trained(model: LearnedModel, tosses: tuple[Toss, ...], name: str) -> tuple[tuple[Toss, ...], tuple[Toss, ...], str]:
    """Those that a training held out, or did not learn from, the others, and words for it; all where there are none."""
    if not model.held_out:
        new = tuple(toss for toss in tosses if toss.toss_id not in model.learned_from)
        if len(new) in (0, len(tosses)):
            return tosses, (), EVERYTHING
        seen = tuple(toss for toss in tosses if toss.toss_id in model.learned_from)
        return new, seen, f"{model.name} did not learn from them"
    judged_by = tuple(toss for toss in tosses if toss.toss_id in model.held_out)
    if not judged_by:
        found = f"none of the {len(model.held_out)} that {model.name} names"
        raise InvalidValueError("held-out tosses in the inputs", found, f"at least one, or {name} to choose others")
    return judged_by, tuple(toss for toss in tosses if toss.toss_id not in model.held_out), f"held out by {model.name}"


def _seen_before(judged_by: Sequence[Toss], models: Sequence[LearnedModel]) -> list[str]:
    counts = [(model.name, len(_ids(judged_by) & model.learned_from)) for model in models]
    return [
        f"{name}: it learned from {count} of the {len(judged_by)} tosses it is evaluated on" for name, count in counts if count
    ]


def _ids(tosses: Sequence[Toss]) -> frozenset[str]:
    return frozenset(toss.toss_id for toss in tosses)


def _of_other_losses(models: Sequence[LearnedModel], loss: LossConfig) -> list[str]:
    """Lines on models whose trainings minimised another loss than the one that is reported, or that have different ones."""
    lines, rigid = [], [geometry is not None and geometry.is_rigid for geometry in (one.model.geometry() for one in models)]
    if loss.balanced and len(set(rigid)) > 1:
        lines.append("losses of the two models cannot be compared: only one is of the form rigid, whose loss is balanced")
    for one, is_rigid in zip(models, rigid, strict=True):
        names = one.loss.differences(loss, one.body, is_rigid) if one.loss else ()
        if one.loss and names:
            told = ", ".join(f"loss.{name}={str(getattr(one.loss, name)).lower()}" for name in names)
            lines.append(f"{one.name}: its training minimised another loss ({told}) than is reported here")
    return lines


def _bounce(judged: LearnedModel, tosses: JudgingTosses, config: KnownConfig) -> Bounce | None:
    """The restitution of the tosses to whose optimum a model was fitted without one."""
    if not judged.at_optimum or not tosses.fitted:
        return None
    return bounce_of(judged.model, transitions_of(tosses.fitted, judged.body.length_scale), config.loss)


def _more(judged: LearnedModel, tosses: JudgingTosses, config: EvaluationConfig, throws: int | None) -> MoreThrows | None:
    """The change by more throws like those to whose optimum a model was fitted."""
    fitted = tosses.fitted or tuple(toss for toss in tosses.judged_by if toss.toss_id in judged.fitted_to)
    if not judged.at_optimum or not fitted or judged.shape_known_to is not None:
        return None
    data = as_described(transitions_of(fitted, judged.body.length_scale), judged.model.geometry(), judged.body)
    return more_throws(judged.model, data, tosses.judged_by, config, throws)


def _known(judged: LearnedModel, tosses: JudgingTosses, config: KnownConfig) -> tuple[Known | None, str]:
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
    slid = sliding_of((*tosses.fitted, *tosses.judged_by), model.body)
    return known(model, transitions_of(tosses.fitted, scale), transitions_of(tosses.judged_by, scale), config, slid), ""
