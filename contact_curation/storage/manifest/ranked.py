"""Makes the manifest of a ranking, of recordings as well as of a live buffer."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from contact_curation.information.curation import SUFFICIENT_EPSILON, Curation
from contact_curation.information.ranking import RankedToss
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import NotScored
from contact_curation.storage.manifest.manifest import Diagnostic, Manifest, ManifestRow
from contact_curation.storage.provenance import RunProvenance, SeenToss


@dataclass(frozen=True, eq=False, slots=True)
class PoolToss:
    """A toss that was read, and its information.

    Attributes:
        seen: id, times, origin and reasons of the toss.
        scores: its information at each theta; empty if it was rejected.
    """

    seen: SeenToss
    scores: tuple[TossInformation | NotScored, ...]

    @property
    def informations(self) -> tuple[TossInformation, ...]:
        """Its information at each theta; empty unless it was scored at every theta."""
        known = tuple(one for one in self.scores if isinstance(one, TossInformation))
        return known if len(known) == len(self.scores) else ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it cannot be ranked, one line each."""
        return self.seen.reasons + tuple(f"not scored: {one.reason}" for one in self.scores if isinstance(one, NotScored))


def ranked_manifest(
    run: RunProvenance, tosses: Sequence[PoolToss], curation: Curation | None, others: Mapping[str, Diagnostic]
) -> Manifest:
    """Makes a manifest of all tosses: the ranked ones, best first, then the others in their order.

    Args:
        run: how the ranking was made.
        tosses: all tosses, each once.
        curation: the ranking and its evidence; None if no toss could be ranked.
        others: further diagnostics by name.
    """
    by_id = {toss.seen.toss_id: toss for toss in tosses}
    entries = curation.ranking.entries if curation else ()
    ranked = [_row(by_id[entry.toss_id], entry) for entry in entries]
    places = {entry.toss_id for entry in entries}
    rows = (*ranked, *(_row(toss, None) for toss in tosses if toss.seen.toss_id not in places))
    return Manifest(run, rows, {**others, **evidence_of(curation)} if curation else {})


def evidence_of(curation: Curation) -> dict[str, Diagnostic]:
    """The diagnostics of a ranking for the manifest."""
    certificate = curation.ranking.certificate
    return {
        "dimension": curation.dimension,
        "epsilon": curation.epsilon,
        "raw_epsilon": curation.raw_epsilon,
        "sufficient_epsilon": SUFFICIENT_EPSILON,
        "sufficient_k": curation.sufficient_k,
        "spectrum": curation.spectrum.tolist(),
        "efficiency": asdict(curation.efficiency),
        "frame_efficiency": asdict(curation.frame_efficiency),
        "optimum_shift": curation.optimum_shift.to_mapping(),
        "certificate": asdict(certificate) if certificate else None,
        "selected_gram": asdict(curation.selected_gram) if curation.selected_gram else None,
        "block_shares": {share.name: share.share for share in curation.block_shares},
        "warnings": list(curation.warnings),
    }


def _row(toss: PoolToss, entry: RankedToss | None) -> ManifestRow:
    """Makes a row with the information at the first theta."""
    seen, origin = toss.seen, toss.seen.origin
    information = next((one for one in toss.scores if isinstance(one, TossInformation)), None)
    return ManifestRow(
        toss_id=seen.toss_id,
        selected=entry.selected if entry else False,
        rejected=bool(seen.reasons),
        reasons=toss.reasons,
        rank=entry.rank if entry else None,
        score=entry.score if entry else None,
        marginal_gain=entry.marginal_gain if entry else None,
        trace=information.trace if information else None,
        mean_loss=information.mean_loss if information else None,
        transitions=information.transitions if information else None,
        not_scored=information.not_scored if information else None,
        frames=seen.frames,
        duration=seen.duration,
        input=origin.input,
        input_sha256=origin.input_sha256,
        topic=origin.topic,
        first_stamp_ns=seen.first_stamp_ns,
        last_stamp_ns=seen.last_stamp_ns,
    )
