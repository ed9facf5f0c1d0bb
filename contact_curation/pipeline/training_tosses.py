"""From recordings to what is learned from and what is held out; whatever is left out is a line."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from contact_curation.cli.report import nothing_found
from contact_curation.errors import InvalidValueError
from contact_curation.learning.evaluation.held_out import HeldOutRule, NumberedToss, Twin, split
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.numbered_pool import NumberedPool, check_something_is_held_out, listed, unknown_ids
from contact_curation.pipeline.reading import InputReader, ReadingConfig
from contact_curation.pipeline.workers import Advance, counted_on


@dataclass(frozen=True, eq=False)
class TossesConfig:
    """Which tosses are read, and what for.

    Attributes:
        reading: how recordings become tosses.
        rule: what is held out.
        said: whether the user said so; else what a manifest kept is not held out.
        manifest: where `kept` comes from.
        kept: ids of what may be learned from; None for all.
        with_twins: learn from motions that are held out under another id.
    """

    reading: ReadingConfig
    rule: HeldOutRule
    said: bool
    manifest: Path | None = None
    kept: tuple[str, ...] | None = None
    with_twins: bool = False


@dataclass(frozen=True, eq=False)
class LearningTosses:
    """What a training gets; both sides in the order of their ids.

    Attributes:
        training: to learn from.
        held_out: never to learn from.
        twins: left out of the training since they are held out under another id.
        kept_back: how many tosses failed a gate, by reason.
        warnings: what is wrong with the inputs, one line each.
    """

    training: tuple[Toss, ...]
    held_out: tuple[Toss, ...]
    twins: tuple[Twin, ...]
    kept_back: Counter[str]
    warnings: tuple[str, ...]


def learning_tosses(paths: Sequence[Path], config: TossesConfig, advance: Advance) -> LearningTosses:
    """Reads recordings, and divides what is in them.

    Args:
        paths: at least one.
        config: how.
        advance: told how many tosses more were read.

    Raises:
        InvalidValueError: there is nothing to learn from, or nothing of what was to be held out.
    """
    pool = NumberedPool()
    for path in paths:
        reader = InputReader(path, config.reading)
        found = {toss.toss_id: toss for toss in counted_on(reader.tosses(), advance)}
        pool.add(found, reader.reading())
    if not pool.tosses:
        raise nothing_found(paths, pool.warnings, f"no toss to learn from{_because(pool.reasons)}", "at least one")
    return _divided(pool, config)


def _divided(pool: NumberedPool, config: TossesConfig) -> LearningTosses:
    tosses = pool.tosses
    kept = None if config.kept is None else frozenset(config.kept)
    exempt = frozenset() if config.said or kept is None else kept
    held_out = [one for one in tosses if one.toss.toss_id not in exempt and config.rule.holds_out(one)]
    if config.said:
        check_something_is_held_out(config.rule, len(held_out), len(tosses))
    others = [one for one in tosses if kept is None or one.toss.toss_id in kept]
    if not others:
        raise InvalidValueError(
            f"kept tosses of {config.manifest}", f"none in the inputs: no {listed(config.kept or ())}", "some"
        )
    ids = frozenset(one.toss.toss_id for one in held_out)
    parts = split([*held_out, *(one for one in others if one.toss.toss_id not in ids)], HeldOutRule(ids=ids), config.with_twins)
    lines = (*pool.warnings, *_missing(tosses, ids, config))
    if not parts.training:
        why = f"none of {len(tosses)}: {len(held_out)} are held out, {len(parts.twins)} are twins of those"
        raise InvalidValueError("tosses to learn from", why, "at least one")
    return LearningTosses(parts.training, parts.held_out, parts.twins, pool.reasons, lines)


def _missing(tosses: Sequence[NumberedToss], held_out: frozenset[str], config: TossesConfig) -> list[str]:
    """Lines about ids that were named and are not there, or not to be learned from."""
    there = {one.toss.toss_id for one in tosses}
    lines = unknown_ids(config.rule, tosses)
    kept = config.kept or ()
    absent = [toss_id for toss_id in kept if toss_id not in there]
    if absent:
        lines.append(f"{config.manifest}: {len(absent)} of {len(kept)} kept tosses are not in the inputs: {listed(absent)}")
    withheld = [toss_id for toss_id in kept if toss_id in held_out]
    if withheld:
        lines.append(f"{config.manifest}: {len(withheld)} of {len(kept)} kept tosses are held out: {listed(withheld)}")
    return lines


def _because(kept_back: Counter[str]) -> str:
    reasons = "; ".join(f"{count} {name}" for name, count in kept_back.most_common())
    return f" ({reasons})" if reasons else ""
