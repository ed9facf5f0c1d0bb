"""From stored messages to decoded or raw ones; those that cannot be converted are left out, counted and said."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator

from contact_curation.storage.bags.decoding import DECODE_ERRORS, Definition, TypeDecoder, decoder_for
from contact_curation.storage.bags.errors import DamagedBagError, Losses, UndecodableTypeError
from contact_curation.storage.bags.limits import BagLimits
from contact_curation.storage.bags.records import BagMessage, Channel, RawMessage, StoredMessage
from contact_curation.storage.bags.unpacking import ZSTD_MAGIC, unpack_message

CONVERT_ERRORS = (*DECODE_ERRORS, DamagedBagError, UndecodableTypeError)


class MessageConverter:
    """Converts the messages of one bag, making decoders when they are first needed."""

    def __init__(self, limits: BagLimits, losses: Losses) -> None:
        self._limits = limits
        self._losses = losses
        self._decoders: dict[Definition, TypeDecoder | UndecodableTypeError] = {}

    def decoded(self, stored: Iterable[StoredMessage]) -> Iterator[BagMessage]:
        """Message objects."""
        decoders: dict[Channel, Callable[[bytes], object]] = {}
        failures = _Failures(self._losses)
        for log_time, _, channel, data in stored:  # runs once per message
            try:
                decode = decoders.get(channel)
                if decode is None:
                    decode = decoders[channel] = self._decoder(channel).decode
                message = decode(self._checked(channel, data))
            except CONVERT_ERRORS as error:
                failures.add(channel, error)
                continue
            yield BagMessage(channel.topic, channel.type, log_time, message)

    def raw(self, stored: Iterable[StoredMessage]) -> Iterator[RawMessage]:
        """CDR bytes with their schema; CDR passes as it is, whether or not it can be decoded."""
        failures = _Failures(self._losses)
        for log_time, publish_time, channel, data in stored:
            try:
                checked = self._checked(channel, data)
                if channel.encoding == "cdr":
                    cdr, described = checked, (channel.schema, channel.schema_encoding, channel.type_hash)
                else:
                    decoder = self._decoder(channel)
                    cdr, described = decoder.to_cdr(checked), (decoder.schema, decoder.schema_encoding, decoder.type_hash)
            except CONVERT_ERRORS as error:
                failures.add(channel, error)
                continue
            yield RawMessage(channel.topic, channel.type, log_time, cdr, publish_time, *described)

    def _checked(self, channel: Channel, data: bytes) -> bytes:
        """A message of an acceptable size, unpacked if rosbag2 compressed it on its own: CDR begins with a zero byte."""
        if len(data) > self._limits.message_bytes:
            raise DamagedBagError(f"{len(data)} bytes where at most {self._limits.message_bytes} are accepted")
        if channel.encoding == "cdr" and data.startswith(ZSTD_MAGIC):
            return unpack_message(data, self._limits.message_bytes)
        return data

    def _decoder(self, channel: Channel) -> TypeDecoder:
        """The channel's decoder; those of one definition share it, and why there is none is found out only once."""
        definition = Definition(channel.type, channel.encoding, channel.schema, channel.schema_encoding)
        if definition not in self._decoders:
            self._decoders[definition] = _decoder_or_reason(definition, self._limits)
        decoder = self._decoders[definition]
        if isinstance(decoder, UndecodableTypeError):
            raise decoder
        if channel.type_hash and channel.type_hash != decoder.type_hash:
            line = f"its type hash is not that of its definition of {channel.type}, which was used"
            self._losses.say((channel, "hash"), f"{channel.topic}: {line}")
        return decoder


def _decoder_or_reason(definition: Definition, limits: BagLimits) -> TypeDecoder | UndecodableTypeError:
    try:
        return decoder_for(definition, limits)
    except UndecodableTypeError as error:
        return error


class _Failures:
    """Messages that could not be converted, in one line per channel: how many, and why the first."""

    def __init__(self, losses: Losses) -> None:
        self._losses = losses
        self._counts: Counter[Channel] = Counter()
        self._first: dict[Channel, str] = {}

    def add(self, channel: Channel, error: Exception) -> None:
        self._counts[channel] += 1
        reason = self._first.setdefault(channel, str(error) or type(error).__name__)
        what = f"{self._counts[channel]} messages of {channel.type or 'an unknown type'} could not be decoded and were left out"
        self._losses.say((channel, "conversion"), f"{channel.topic}: {what}; the first: {reason}")
