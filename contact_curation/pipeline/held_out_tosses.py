"""Which tosses `rank --held-out` keeps out of the pool, known before the first is scored.

A training toss can be the twin of a held-out one that comes in a later recording, and a bound on losses is a quantile of the
pool's own; so the recordings are read once for the division, and again for scoring.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from contact_curation.learning.evaluation.held_out import HeldOutRule, split
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.numbered_pool import NumberedPool, check_something_is_held_out, unknown_ids
from contact_curation.pipeline.reading import InputReader, Reading, ReadingConfig
from contact_curation.pipeline.workers import Advance, each

HELD_OUT = "held out"
TWIN = "twin of a held-out toss"


@dataclass(frozen=True)
class HeldOutTosses:
    """What is kept out of a pool.

    Attributes:
        reasons: by toss id, in one line.
        warnings: about what a rule names and nobody has, one line each.
    """

    reasons: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()


def held_out_tosses(
    paths: Sequence[Path], config: ReadingConfig, rule: HeldOutRule, jobs: int, advance: Advance
) -> HeldOutTosses:
    """Reads recordings, and says which of their tosses are held out, and which are the same motion under another id.

    Args:
        paths: at least one.
        config: how recordings become tosses.
        rule: what is held out.
        jobs: how many processes.
        advance: told how many tosses more were read.

    Raises:
        InvalidValueError: the rule holds out none of the tosses.
    """
    if rule == HeldOutRule():
        return HeldOutTosses()
    pool = NumberedPool()
    for found, reading in each(partial(_read, config), paths, jobs, advance):
        pool.add(found, reading)
    parts = split(pool.tosses, rule)
    if pool.tosses:
        check_something_is_held_out(rule, len(parts.held_out), len(pool.tosses))
    reasons = {toss.toss_id: HELD_OUT for toss in parts.held_out}
    reasons |= {twin.left_out: f"{TWIN}: {twin.held_out}" for twin in parts.twins}
    return HeldOutTosses(reasons, tuple(unknown_ids(rule, pool.tosses)))


def _read(config: ReadingConfig, path: Path, advance: Advance) -> tuple[dict[str, Toss], Reading]:
    reader = InputReader(path, config)
    found: dict[str, Toss] = {}
    for toss in reader.tosses():
        found[toss.toss_id] = toss
        advance(1)
    return found, reader.reading()
