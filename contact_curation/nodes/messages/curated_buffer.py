"""CuratedBuffer, from the curator's record."""

from contact_curation_msgs.msg import CuratedBuffer

from contact_curation.nodes.messages.headers import Stamped, header_message
from contact_curation.stages.curation import Buffer


def buffer_message(buffer: Buffer) -> CuratedBuffer:
    """The selected set as it is published, best first."""
    curation, sample = buffer.curation, buffer.candidates[0]
    selected = [entry for entry in curation.ranking.entries if entry.selected]
    return CuratedBuffer(
        format_version=CuratedBuffer.FORMAT_VERSION,
        header=header_message(Stamped(buffer.newest_stamp_ns, buffer.frame_id)),
        body=sample.body,
        revision=buffer.revision,
        criterion=curation.ranking.criterion,
        capacity=buffer.ranking.top,
        model=sample.model,
        parameters_version=sample.parameters_version,
        tosses_seen=buffer.seen,
        toss_ids=[entry.toss_id for entry in selected],
        scores=[float(entry.score) for entry in selected],
        marginal_gains=[float(entry.marginal_gain) for entry in selected],
        log_det=buffer.log_det,
        efficiency_bound=buffer.efficiency_bound,
        epsilon=curation.epsilon,
        block_names=[share.name for share in curation.block_shares],
        block_shares=[share.share for share in curation.block_shares],
    )
