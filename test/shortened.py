"""A recording without the long rests between its motions, which say nothing and take most of the time to read."""

from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.motion.toss import NANOSECONDS, Rejected, Toss
from contact_curation.storage.inputs.inputs import open_inputs

BEFORE, AFTER = 0.05, 0.32
"""What stays around a motion [s]: the frames that its velocities come from, and those in which it is seen to be over."""


def write_shortened(recording: Path, poses: str, path: Path) -> Path:
    """Writes an MCAP file again, with the messages of topic `poses` around its motions and all others."""
    motions = [one.toss if isinstance(one, Rejected) else one for one in open_inputs([recording], CONTACTNETS_CUBE)]
    tosses = [motion for motion in motions if isinstance(motion, Toss)]
    spans = [(one.stamps_ns[0] - BEFORE * NANOSECONDS, one.stamps_ns[-1] + AFTER * NANOSECONDS) for one in tosses]
    with recording.open("rb") as source, path.open("wb") as target:
        reader, writer = make_reader(source), Writer(target)
        summary = reader.get_summary()
        assert summary
        writer.start(profile=reader.get_header().profile)
        schemas = {key: writer.register_schema(one.name, one.encoding, one.data) for key, one in summary.schemas.items()}
        channels = {
            key: writer.register_channel(one.topic, one.message_encoding, schemas[one.schema_id], one.metadata)
            for key, one in summary.channels.items()
        }
        for _, channel, message in reader.iter_messages():
            if channel.topic != poses or any(first <= message.log_time <= last for first, last in spans):
                writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence)
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        writer.finish()  # type: ignore[no-untyped-call]
    return path
