"""A buffer as a manifest: every toss that was ranked, with its place and the evidence for it."""

from collections.abc import Callable
from dataclasses import asdict

from contact_curation import __version__
from contact_curation.information.ranking import RankedToss
from contact_curation.information.record import TossInformation
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.stages.curation import Buffer
from contact_curation.storage.manifest.manifest import Diagnostic, Manifest, ManifestRow
from contact_curation.storage.provenance import RunProvenance


def manifest_of(buffer: Buffer, last_stamp_ns: Callable[[str], int]) -> Manifest:
    """The manifest of a buffer; tosses came live, so that no recording is named.

    Args:
        buffer: what is selected, and from what.
        last_stamp_ns: gives the stamp of a toss's last frame.
    """
    sample, curation = buffer.candidates[0], buffer.curation
    by_id = {information.toss_id: information for information in buffer.candidates}
    run = RunProvenance(
        criterion=curation.ranking.criterion,
        estimator=sample.estimator,
        influence_bound=sample.influence_bound,
        model=sample.model,
        parameters="from the scorer",
        parameters_version=sample.parameters_version,
        seed=buffer.ranking.seed,
        package_version=__version__,
        command=(),
        inputs=(),
    )
    diagnostics: dict[str, Diagnostic] = {
        "tosses_seen": buffer.seen,
        "log_det": buffer.log_det,
        "efficiency_bound": buffer.efficiency_bound,
        "epsilon": curation.epsilon,
        "sufficient_k": curation.sufficient_k,
        "answer": asdict(curation.answer),
        "block_shares": {share.name: share.share for share in curation.block_shares},
        "warnings": list(curation.warnings),
    }
    rows = [_row(by_id[entry.toss_id], entry, last_stamp_ns(entry.toss_id)) for entry in curation.ranking.entries]
    return Manifest(run, tuple(rows), diagnostics)


def _row(information: TossInformation, entry: RankedToss, last_ns: int) -> ManifestRow:
    return ManifestRow(
        toss_id=entry.toss_id,
        kept=entry.kept,
        gated=False,
        reasons=(),
        rank=entry.rank,
        score=entry.score,
        marginal_gain=entry.marginal_gain,
        trace=information.trace,
        mean_loss=information.mean_loss,
        transitions=information.transitions,
        not_scored=information.not_scored,
        frames=information.transitions + 1,
        duration=information.duration,
        input="",
        input_sha256="",
        topic="",
        first_stamp_ns=last_ns - round(information.duration * NANOSECONDS),
        last_stamp_ns=last_ns,
    )
