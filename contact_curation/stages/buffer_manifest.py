"""A buffer as a manifest: every toss that was ranked, with its place and the evidence for it."""

from collections.abc import Callable
from typing import Any

from contact_curation.information.record import TossInformation
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.stages.curation import Buffer
from contact_curation.storage.manifest.manifest import Manifest
from contact_curation.storage.manifest.ranked import PoolToss, ranked_manifest
from contact_curation.storage.provenance import RunProvenance, SeenToss, TossProvenance
from contact_curation.version import __version__


def manifest_of(buffer: Buffer, last_stamp_ns: Callable[[str], int], body: dict[str, Any] | None = None) -> Manifest:
    """The manifest of a buffer; tosses came live, so that no recording is named.

    Args:
        buffer: what is selected, and from what.
        last_stamp_ns: gives the stamp of a toss's last frame.
        body: what was tossed, as `Body.to_mapping` gives it; None where that is not known.
    """
    sample, curation = buffer.candidates[0], buffer.curation
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
        body=body,
    )
    others = {"tosses_seen": buffer.seen, "log_det": buffer.log_det, "efficiency_bound": buffer.efficiency_bound}
    tosses = [PoolToss(_seen(one, last_stamp_ns(one.toss_id)), (one,)) for one in buffer.candidates]
    return ranked_manifest(run, tosses, curation, others)


def _seen(information: TossInformation, last_ns: int) -> SeenToss:
    """What is known of a live toss; its frames are the scorer's."""
    first_ns = last_ns - round(information.duration * NANOSECONDS)
    frames = information.transitions + 1
    return SeenToss(information.toss_id, "", (), frames, information.duration, first_ns, last_ns, TossProvenance())
