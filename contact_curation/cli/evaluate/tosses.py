"""Which tosses a model is judged by, and which it was fitted to."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from contact_curation.cli.evaluate.models import JudgedModel
from contact_curation.cli.options.held_out import held_out_rule
from contact_curation.errors import InvalidValueError
from contact_curation.learning.evaluation.held_out import HeldOutRule, NumberedToss, split
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.training_tosses import TossesConfig, learning_tosses
from contact_curation.pipeline.workers import Advance

EVERYTHING = "all there are"


@dataclass(frozen=True, eq=False)
class JudgingTosses:
    """What a model is judged by.

    Attributes:
        judged_by: at least one.
        fitted: what it was fitted to, as far as it is known; none where all tosses judge.
        chosen: in words, why just these.
        twins: ids of those that judge and are in `fitted`, too, under another id.
        warnings: what is wrong, one line each.
    """

    judged_by: tuple[Toss, ...]
    fitted: tuple[Toss, ...]
    chosen: str
    twins: frozenset[str]
    warnings: tuple[str, ...]


def judging_tosses(
    paths: Sequence[Path], spec: str | None, models: Sequence[JudgedModel], reading: ReadingConfig, advance: Advance
) -> JudgingTosses:
    """Reads recordings, and divides what is in them.

    Args:
        paths: at least one.
        spec: `--held-out`; None for what the first model's training held out, or all; all, too, where it is `none`.
        models: at least one; what the first learned from is what it was fitted to.
        reading: how recordings become tosses.
        advance: told how many tosses more were read.

    Raises:
        ContactCurationError: there is no toss to judge by.
    """
    rule = HeldOutRule() if spec is None else held_out_rule(spec)
    read = learning_tosses(paths, TossesConfig(reading, rule, said=spec is not None, with_twins=True), advance)
    judged_by, others, chosen = read.held_out, read.training, f"--held-out {spec}"
    if spec is None:
        judged_by, others, chosen = _as_trained(models[0], read.training)
    elif not judged_by:  # `none`: nobody tells some apart
        judged_by, others, chosen = read.training, (), EVERYTHING
    learned, last = models[0].learned_from, models[0].fitted_to
    seen = [toss for toss in others if not learned or toss.toss_id in learned]
    fitted = tuple(toss for toss in seen if not last or toss.toss_id in last)
    parts = split([NumberedToss(toss, 0) for toss in (*judged_by, *seen)], HeldOutRule(ids=_ids(judged_by)))
    twins = frozenset(twin.held_out for twin in parts.twins)
    return JudgingTosses(judged_by, fitted, chosen, twins, (*read.warnings, *_seen_before(judged_by, models)))


def _as_trained(model: JudgedModel, tosses: tuple[Toss, ...]) -> tuple[tuple[Toss, ...], tuple[Toss, ...], str]:
    """Those that a training held out, the others, and words for it; all where it held out none."""
    if not model.held_out:
        return tosses, (), EVERYTHING
    judged_by = tuple(toss for toss in tosses if toss.toss_id in model.held_out)
    if not judged_by:
        found = f"none of the {len(model.held_out)} that {model.path} names"
        raise InvalidValueError("held-out tosses in the inputs", found, "at least one, or --held-out to choose others")
    return judged_by, tuple(toss for toss in tosses if toss.toss_id not in model.held_out), f"held out by {model.path}"


def _seen_before(judged_by: Sequence[Toss], models: Sequence[JudgedModel]) -> list[str]:
    counts = [(model.path, len(_ids(judged_by) & model.learned_from)) for model in models]
    return [
        f"{path}: it learned from {count} of the {len(judged_by)} tosses it is judged by" for path, count in counts if count
    ]


def _ids(tosses: Sequence[Toss]) -> frozenset[str]:
    return frozenset(toss.toss_id for toss in tosses)
