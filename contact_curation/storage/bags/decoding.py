"""Decodes stored messages to objects or CDR, with the message definitions that the bag itself contains.

Every type has its own type store, so a definition that cannot be parsed, or that contradicts another topic's, affects only its
own topic. Names get ROS 2's form: fields of ROS 1 messages become lower case (`K` of CameraInfo becomes `k`). Messages that
cannot be converted are left out, counted and reported.
"""

import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from contact_curation.storage.bags.file import (
    ZSTD_MAGIC,
    BagLimits,
    DamagedBagError,
    Losses,
    UndecodableTypeError,
    unpack_message,
)
from contact_curation.storage.bags.records import BagMessage, Channel, RawMessage, StoredMessage

HEADER = "std_msgs/msg/Header"
IDL_SEPARATOR = "=" * 80 + "\n"
LONGEST_SCHEMA, MOST_FIELDS = 1 << 18, 4000
"""Longest accepted definition [characters], and most fields of all its types; real ones have a few kB and hundreds of fields.

Its parser takes 6 microseconds a character, and the code that is generated takes some 0.6 ms a field.
"""
TYPE_ERRORS = (TypesysError, SerdeError, LookupError, ValueError, TypeError, AssertionError, SyntaxError, RecursionError)
"""Errors of rosbags for definitions from which it cannot make a decoder."""
DECODE_ERRORS = (SerdeError, struct.error, LookupError, ValueError, TypeError, OverflowError, RecursionError)
"""Errors of rosbags for bytes that are not a message of the type."""
DECODERS = 64
"""Number of decoders that are cached for the next bags; making one takes about 20 ms, and bags have few types."""


class Definition(NamedTuple):
    """Type, encoding and definition of a channel's messages.

    Attributes:
        type: ROS 2 type name.
        encoding: encoding of the messages, `cdr` or `ros1`.
        schema: definition text; empty if the bag contains none.
        schema_encoding: encoding of the definition text.
    """

    type: str
    encoding: str
    schema: str
    schema_encoding: str


@dataclass(frozen=True, eq=False)
class TypeDecoder:
    """Decodes messages of one definition.

    Attributes:
        decode: converts bytes to a message object; raises one of DECODE_ERRORS.
        to_cdr: converts bytes to CDR of the ROS 2 type; raises one of DECODE_ERRORS.
        schema: ROS 2 definition text.
        schema_encoding: encoding of the definition text.
        type_hash: `RIHS01_...` of the definition.
    """

    decode: Callable[[bytes], object]
    to_cdr: Callable[[bytes], bytes]
    schema: str
    schema_encoding: str
    type_hash: str


@lru_cache(DECODERS)
def decoder_for(definition: Definition, limits: BagLimits) -> TypeDecoder:
    """Makes a decoder from a definition, or from ROS 2 Jazzy's if the bag contains none.

    Raises:
        UndecodableTypeError: the encoding, the definition or the type is not supported.
    """
    if definition.encoding not in ("cdr", "ros1"):
        raise UndecodableTypeError(f"messages are encoded as {definition.encoding!r}; only cdr and ros1 are understood")
    try:
        store = _store(definition, limits)
        store.get_msgdef(definition.type)
        return _ros1_decoder(definition, store) if definition.encoding == "ros1" else _ros2_decoder(definition, store)
    except TYPE_ERRORS as error:
        raise UndecodableTypeError(f"the definition of its type is not understood: {_reason(error)}") from error


def _ros2_decoder(definition: Definition, store: Typestore) -> TypeDecoder:
    def decode(data: bytes) -> object:
        return store.deserialize_cdr(data, definition.type)

    def to_cdr(data: bytes) -> bytes:
        return data

    return TypeDecoder(decode, to_cdr, definition.schema, definition.schema_encoding, store.hash_rihs01(definition.type))


def _ros1_decoder(definition: Definition, store: Typestore) -> TypeDecoder:
    jazzy_header = get_typestore(Stores.ROS2_JAZZY).fielddefs[HEADER]
    ros2 = get_typestore(Stores.EMPTY)
    ros2.register({**store.fielddefs, HEADER: jazzy_header})  # without seq, as ros1_to_cdr expects it

    def decode(data: bytes) -> object:
        return store.deserialize_ros1(data, definition.type)

    def to_cdr(data: bytes) -> bytes:
        return bytes(ros2.ros1_to_cdr(data, definition.type))

    schema, _ = ros2.generate_msgdef(definition.type, ros_version=2)
    return TypeDecoder(decode, to_cdr, schema, "ros2msg", ros2.hash_rihs01(definition.type))


def _store(definition: Definition, limits: BagLimits) -> Typestore:
    if not definition.schema:
        store = get_typestore(Stores.ROS2_JAZZY)
        if definition.type not in store.fielddefs:
            raise TypesysError(f"the bag does not define {definition.type!r}, nor is it one of ROS 2 Jazzy's")
        return store
    if len(definition.schema) > LONGEST_SCHEMA:
        raise TypesysError(f"it has {len(definition.schema)} characters where at most {LONGEST_SCHEMA} are accepted")
    types = _types(definition)
    fields = sum(len(fields) for _, fields in types.values())
    if fields > MOST_FIELDS:
        raise TypesysError(f"it has {fields} fields where at most {MOST_FIELDS} are accepted")
    _refuse_long_arrays(types, limits)
    store = get_typestore(Stores.EMPTY)
    store.register(types)
    return store


def _types(definition: Definition) -> Typesdict:
    if definition.schema_encoding == "ros2msg":
        return get_types_from_msg(definition.schema, definition.type)
    if definition.schema_encoding == "ros1msg":
        return _in_lower_case(get_types_from_msg(definition.schema, definition.type))
    if definition.schema_encoding in ("ros2idl", "omgidl"):
        return _types_from_idl(definition.schema)
    raise TypesysError(f"it is written as {definition.schema_encoding!r}; ros2msg, ros2idl and ros1msg are understood")


def _types_from_idl(schema: str) -> Typesdict:
    """Parses a schema of rosbag2 in IDL: one file per type, each after a separator and a line with its name."""
    if not schema.startswith(IDL_SEPARATOR):
        return get_types_from_idl(schema)
    types: Typesdict = {}
    for part in schema.split(IDL_SEPARATOR)[1:]:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    return types


def _in_lower_case(types: Typesdict) -> Typesdict:
    """Makes the names of fields lower case, as ROS 2 requires; the order of the fields, and so the bytes, stay the same."""
    return {
        name: (constants, [(field.lower(), kind) for field, kind in fields] if _stay_apart(fields) else fields)
        for name, (constants, fields) in types.items()
    }


def _stay_apart(fields: list[tuple[str, FieldDesc]]) -> bool:
    return len({field.lower() for field, _ in fields}) == len(fields)


def _refuse_long_arrays(types: Typesdict, limits: BagLimits) -> None:
    """Refuses very long fixed-size arrays, which no message has: rosbags generates a line of code per element."""
    for name, (_, fields) in types.items():
        for field, (kind, detail) in fields:
            if kind == Nodetype.ARRAY and int(detail[1]) > limits.fixed_array_length:
                raise TypesysError(f"{name}.{field} has {detail[1]} elements; at most {limits.fixed_array_length} are accepted")


def _reason(error: Exception) -> str:
    return str(error) or type(error).__name__


CONVERT_ERRORS = (*DECODE_ERRORS, DamagedBagError, UndecodableTypeError)


class MessageConverter:
    """Converts the messages of one bag; makes each decoder when it is first needed."""

    def __init__(self, limits: BagLimits, losses: Losses) -> None:
        self._limits = limits
        self._losses = losses
        self._decoders: dict[Definition, TypeDecoder | UndecodableTypeError] = {}

    @property
    def longest(self) -> int:
        """Largest accepted size of a message [bytes]."""
        return self._limits.message_bytes

    def reading(self) -> "Reading":
        """A decoder for one pass over the messages."""
        return Reading(self, _Failures(self._losses))

    def raw(self, stored: Iterable[StoredMessage]) -> Iterator[RawMessage]:
        """Converts messages to CDR bytes with their schema; messages in CDR pass unchanged, even if they cannot be decoded."""
        failures = _Failures(self._losses)
        for log_time, publish_time, channel, data in stored:
            try:
                checked = self.checked(channel, data)
                if channel.encoding == "cdr":
                    cdr, described = checked, (channel.schema, channel.schema_encoding, channel.type_hash)
                else:
                    decoder = self.compared_decoder(channel)
                    cdr, described = decoder.to_cdr(checked), (decoder.schema, decoder.schema_encoding, decoder.type_hash)
            except CONVERT_ERRORS as error:
                failures.add(channel, error)
                continue
            yield RawMessage(channel.topic, channel.type, log_time, cdr, publish_time, *described)

    def checked(self, channel: Channel, data: bytes) -> bytes:
        """Checks a message's size, and unpacks it if rosbag2 compressed it (CDR begins with a zero byte).

        Raises:
            DamagedBagError: it is larger, or its compressed frame is damaged.
        """
        if len(data) > self._limits.message_bytes:
            raise DamagedBagError(f"{len(data)} bytes where at most {self._limits.message_bytes} are accepted")
        if channel.encoding == "cdr" and data.startswith(ZSTD_MAGIC):
            return unpack_message(data, self._limits.message_bytes)
        return data

    def decoder(self, channel: Channel) -> TypeDecoder:
        """The channel's decoder; channels of one definition share it, also the reason why there is none.

        Raises:
            UndecodableTypeError: there is none.
        """
        definition = Definition(channel.type, channel.encoding, channel.schema, channel.schema_encoding)
        if definition not in self._decoders:
            self._decoders[definition] = _decoder_or_reason(definition, self._limits)
        decoder = self._decoders[definition]
        if isinstance(decoder, UndecodableTypeError):
            raise decoder
        return decoder

    def compared_decoder(self, channel: Channel) -> TypeDecoder:
        """The same; a loss is noted if the channel's type hash is not that of its definition."""
        decoder = self.decoder(channel)
        if channel.type_hash and channel.type_hash != decoder.type_hash:
            line = f"its type hash is not that of its definition of {channel.type}, which was used"
            self._losses.say((channel, "hash"), f"{channel.topic}: {line}")
        return decoder


class Reading:
    """Decodes messages in one pass, in several calls, and counts those that cannot be decoded."""

    def __init__(self, converter: MessageConverter, failures: "_Failures") -> None:
        self._converter = converter
        self._failures = failures
        self._decoders: dict[Channel, Callable[[bytes], object]] = {}

    def decoded(self, stored: Iterable[StoredMessage]) -> Iterator[BagMessage]:
        """Converts messages to objects."""
        decoders, checked = self._decoders, self._converter.checked
        for log_time, _, channel, data in stored:  # runs once per message
            try:
                decode = decoders.get(channel)
                if decode is None:
                    decode = decoders[channel] = self._converter.compared_decoder(channel).decode
                message = decode(checked(channel, data))
            except CONVERT_ERRORS as error:
                self._failures.add(channel, error)
                continue
            yield BagMessage(channel.topic, channel.type, log_time, message)

    @property
    def longest(self) -> int:
        """Largest accepted size of a message [bytes]."""
        return self._converter.longest

    def has_decoded(self, channel: Channel) -> bool:
        """Whether a message of the channel was decoded before, so that its definition was compared."""
        return channel in self._decoders

    def type_hash(self, channel: Channel) -> str:
        """`RIHS01_...` of the definition of the channel's CDR messages; empty if they cannot be decoded or are not CDR."""
        try:
            return self._converter.decoder(channel).type_hash if channel.encoding == "cdr" else ""
        except UndecodableTypeError:
            return ""


def _decoder_or_reason(definition: Definition, limits: BagLimits) -> TypeDecoder | UndecodableTypeError:
    try:
        return decoder_for(definition, limits)
    except UndecodableTypeError as error:
        return error


class _Failures:
    """Reports messages that could not be converted, one line per channel: how many, and the reason for the first."""

    def __init__(self, losses: Losses) -> None:
        self._losses = losses
        self._counts: Counter[Channel] = Counter()
        self._first: dict[Channel, str] = {}

    def add(self, channel: Channel, error: Exception) -> None:
        self._counts[channel] += 1
        reason = self._first.setdefault(channel, str(error) or type(error).__name__)
        what = f"{self._counts[channel]} messages of {channel.type or 'an unknown type'} could not be decoded and were left out"
        self._losses.say((channel, "conversion"), f"{channel.topic}: {what}; the first: {reason}")
