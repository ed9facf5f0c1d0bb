"""Every toss of every recording once: its place in the pool, and its row in the manifest."""

from collections.abc import Sequence
from dataclasses import dataclass

from contact_curation.information.ranking import RankedToss, Ranking
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored
from contact_curation.pipeline.pool_scoring import ScoredInput
from contact_curation.pipeline.reading import SeenToss
from contact_curation.storage.inputs.known_tosses import KnownTosses
from contact_curation.storage.manifest.manifest import ManifestRow


@dataclass(frozen=True, eq=False, slots=True)
class PoolToss:
    """A toss of the pool.

    Attributes:
        seen: what was seen of it.
        scores: what it teaches, once per theta; empty when it was gated.
    """

    seen: SeenToss
    scores: tuple[TossInformation | NotScored, ...]

    @property
    def informations(self) -> tuple[TossInformation, ...]:
        """One per theta; empty unless it was scored at every theta."""
        known = tuple(one for one in self.scores if isinstance(one, TossInformation))
        return known if len(known) == len(self.scores) else ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it cannot be ranked."""
        return self.seen.reasons + tuple(f"not scored: {one.reason}" for one in self.scores if isinstance(one, NotScored))


@dataclass(frozen=True, eq=False)
class TossPool:
    """Every toss once.

    Attributes:
        tosses: in the order of the recordings.
        left_out: what came once more, one line each.
    """

    tosses: tuple[PoolToss, ...]
    left_out: tuple[str, ...]

    @property
    def rankable(self) -> tuple[PoolToss, ...]:
        """Those that were scored."""
        return tuple(toss for toss in self.tosses if toss.scores and not toss.reasons)


def pool_of_inputs(inputs: Sequence[ScoredInput]) -> TossPool:
    """The pool of some recordings; a toss that is in several of them belongs to the first that has it whole."""
    known = KnownTosses()
    tosses: dict[str, PoolToss] = {}
    left_out: list[str] = []
    for one in inputs:
        for seen in one.reading.seen:
            standing = known.see(seen.toss_id, seen.digest, one.reading.path, whole=not seen.reasons)
            if standing.left_out:
                left_out.append(f"{standing.left_out.where}: {standing.left_out.why}")
            if standing.taken:
                tosses.pop(seen.toss_id, None)
                tosses[seen.toss_id] = PoolToss(seen, one.scores.get(seen.toss_id, ()))
    return TossPool(tuple(tosses.values()), tuple(left_out))


def manifest_rows(pool: TossPool, ranking: Ranking | None) -> tuple[ManifestRow, ...]:
    """All tosses: the ranked ones, best first, then the others in the order of the recordings."""
    by_id = {toss.seen.toss_id: toss for toss in pool.tosses}
    entries = ranking.entries if ranking else ()
    ranked = [_row(by_id[entry.toss_id], entry) for entry in entries]
    places = {entry.toss_id for entry in entries}
    return (*ranked, *(_row(toss, None) for toss in pool.tosses if toss.seen.toss_id not in places))


def _row(toss: PoolToss, entry: RankedToss | None) -> ManifestRow:
    """A row; what is said of the information is said at the first theta."""
    information = next((one for one in toss.scores if isinstance(one, TossInformation)), None)
    return ManifestRow(
        toss_id=toss.seen.toss_id,
        kept=entry.selected if entry else False,
        gated=bool(toss.seen.reasons),
        reasons=toss.reasons,
        rank=entry.rank if entry else None,
        score=entry.score if entry else None,
        marginal_gain=entry.marginal_gain if entry else None,
        trace=information.trace if information else None,
        mean_loss=information.mean_loss if information else None,
        transitions=information.transitions if information else None,
        not_scored=information.not_scored if information else None,
        frames=toss.seen.frames,
        duration=toss.seen.duration,
        input=toss.seen.origin.input,
        input_sha256=toss.seen.origin.input_sha256,
        topic=toss.seen.origin.topic,
        first_stamp_ns=toss.seen.first_stamp_ns,
        last_stamp_ns=toss.seen.last_stamp_ns,
    )
