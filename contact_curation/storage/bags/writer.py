"""Writes MCAP bags as rosbag2 does (ros2 profile, CDR, schemas, offered QoS), with checksums, whole or not at all."""

import errno
import fcntl
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, NamedTuple, Self

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from contact_curation.errors import InvalidValueError
from contact_curation.files import lock, sync_file, writing
from contact_curation.storage.bags.folder import METADATA_NAME, TopicMetadata, metadata_text
from contact_curation.storage.bags.records import OfferedQos, profiles_text

LARGEST_LOG_TIME = 2**63 - 1
"""Largest log time [ns]: rosbag2 stores log times as signed 64-bit integers."""


class _StreamKey(NamedTuple):
    topic: str
    type: str
    qos: OfferedQos


@dataclass
class _Stream:
    channel: int
    type_hash: str
    count: int = 0

    def described(self, key: _StreamKey) -> TopicMetadata:
        return TopicMetadata(key.topic, key.type, self.count, self.type_hash, key.qos)


class BagWriter:
    """Writes one bag; use it as a context manager.

    Messages go to a hidden file beside the target. It gets the target's name when the `with` block ends without an error, and
    is removed otherwise. A process that is killed leaves the hidden file, which `BagReader` can read. Its name follows from the
    target's name, so that it is found again; a link of that name is refused.

    Args:
        path: `*.mcap` for a storage file; any other name for a rosbag2 folder (storage file and metadata.yaml).
        typestore: definitions of message types; ROS 2 Jazzy's by default.
        over_readers: whether a bag that is being read may be replaced; its readers keep the old one.

    Raises:
        InvalidValueError: `path` cannot be written, is a bag that is being written or read, or is an existing folder.
    """

    def __init__(self, path: Path, typestore: Typestore | None = None, *, over_readers: bool = False) -> None:
        self.path = Path(path)
        self._over_readers = over_readers
        self._as_folder = self.path.suffix != ".mcap"
        self._file_name = f"{self.path.name}_0.mcap"
        self._partial = self.path.with_name(f".{self.path.name}.partial")
        self._typestore = typestore or get_typestore(Stores.ROS2_JAZZY)
        self._definitions: dict[str, tuple[str, str]] = {}
        self._schemas: dict[tuple[str, str, str], int] = {}
        self._streams: dict[_StreamKey, _Stream] = {}
        self._first_ns, self._last_ns = LARGEST_LOG_TIME, 0
        self._appeared = False
        self._check_target()
        self._file = self._opened()
        self._writer = Writer(self._file, compression=CompressionType.ZSTD, enable_crcs=True)
        self._writer.start(profile=Profile.ROS2, library="contact-curation")

    def write(self, topic: str, message: Any, log_time_ns: int, latched: bool = False) -> None:
        """Adds a message object of the typestore.

        Args:
            topic: name of the topic.
            message: object of one of the typestore's classes (`typestore.types[...]`).
            log_time_ns: time at which it was recorded [ns].
            latched: whether the topic is published transient local.
        """
        type_name: str = message.__msgtype__
        schema, type_hash = self._definition(type_name)
        data = bytes(self._typestore.serialize_cdr(message, type_name, little_endian=True))
        self.write_raw(topic, type_name, schema, data, log_time_ns, qos=OfferedQos(latched=latched), type_hash=type_hash)

    def write_raw(
        self,
        topic: str,
        type_name: str,
        schema: str,
        data: bytes,
        log_time_ns: int,
        *,
        qos: OfferedQos = OfferedQos(),  # noqa: B008  (frozen)
        schema_encoding: str = SchemaEncoding.ROS2,
        type_hash: str = "",
        publish_time_ns: int | None = None,
    ) -> None:
        """Adds a serialised message (CDR), byte for byte.

        Args:
            topic: name of the topic.
            type_name: ROS 2 type name.
            schema: definition text of the type and of the types of its fields.
            data: CDR with its encapsulation header.
            log_time_ns: time at which it was recorded [ns].
            qos: quality of service of the topic's publishers.
            schema_encoding: `ros2msg` or `ros2idl`.
            type_hash: `RIHS01_...`, if known.
            publish_time_ns: time at which it was sent [ns]; the log time by default.

        Raises:
            InvalidValueError: the log time is negative or too large for a bag.
        """
        if not 0 <= log_time_ns <= LARGEST_LOG_TIME:
            raise InvalidValueError(f"log time of a message on {topic}", log_time_ns, "nanoseconds in [0, 2^63)")
        key = _StreamKey(topic, type_name, qos)
        stream = self._streams.get(key) or self._declare(key, schema, schema_encoding, type_hash)
        stream.count += 1
        self._first_ns, self._last_ns = min(self._first_ns, log_time_ns), max(self._last_ns, log_time_ns)
        published = log_time_ns if publish_time_ns is None else publish_time_ns
        with writing(self.path):
            self._writer.add_message(stream.channel, log_time=log_time_ns, data=data, publish_time=published)

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Adds a named note about the whole recording, as MCAP metadata; `BagReader.note` reads it."""
        self._writer.add_metadata(name, dict(values))

    def flush(self) -> None:
        """Passes everything written so far to the operating system, so that it survives a kill of this process."""
        with writing(self.path):
            self._writer.flush()  # type: ignore[no-untyped-call]

    def appear(self) -> None:
        """Gives the storage file its final name before it is complete, so that it can be read and survives a kill.

        Raises:
            InvalidValueError: the bag is a folder, or another bag of this name is being read.
        """
        if self._as_folder:
            raise InvalidValueError("output", self.path, "a name ending in .mcap: a folder appears when it is complete")
        self.flush()
        self._check_target()
        with writing(self.path):
            self._partial.replace(self.path)
        self._appeared = True

    def close(self) -> None:
        """Completes the bag and gives it its final name.

        Raises:
            InvalidValueError: it cannot be written there.
        """
        with writing(self.path):
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.flush()
            sync_file(self._file.fileno())
            if self._as_folder:
                topics = [stream.described(key) for key, stream in self._streams.items()]
                text = metadata_text(self._file_name, topics, self._first_ns, self._last_ns)
                (self._partial / METADATA_NAME).write_text(text, encoding="utf-8")
            if not self._appeared:
                self._check_target()
                self._partial.replace(self.path)
            self._file.close()

    def discard(self) -> None:
        """Removes what was written so far, unless it has its final name already."""
        with suppress(OSError):  # on a full disk, which could not take the rest
            self._file.close()
        if not self._appeared:
            self._remove()

    def _remove(self) -> None:
        if self._as_folder:
            shutil.rmtree(self._partial, ignore_errors=True)
        else:
            with suppress(OSError):
                self._partial.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is not None:
            self.discard()
            return
        try:
            self.close()
        except BaseException:
            self.discard()
            raise

    def _check_target(self) -> None:
        """Refuses to replace a bag that is being read: its readers hold a shared lock (`BagFile`)."""
        if self.path.is_dir() or (self._as_folder and self.path.exists()):
            raise InvalidValueError("output", self.path, "a name that is not taken yet")
        with suppress(FileNotFoundError, NotADirectoryError), self.path.open("rb") as file:
            if self._over_readers:
                _lock(file, self.path, "a file that nobody is writing", fcntl.LOCK_SH)
            else:
                _lock(file, self.path, "a file that nobody is reading")

    def _opened(self) -> BinaryIO:
        with writing(self.path):
            if self._as_folder:
                _make_folder(self._partial)
            name = self._partial / self._file_name if self._as_folder else self._partial
            file = os.fdopen(os.open(name, os.O_CREAT | os.O_APPEND | os.O_WRONLY | os.O_NOFOLLOW, 0o666), "ab")
            try:
                _lock(file, self.path, "a path that nobody else is writing")
                file.truncate(0)
                file.seek(0)
            except InvalidValueError:
                file.close()
                raise
            except OSError:
                self._remove()
                file.close()
                raise
        return file

    def _definition(self, type_name: str) -> tuple[str, str]:
        if type_name not in self._definitions:
            schema, _ = self._typestore.generate_msgdef(type_name, ros_version=2)
            self._definitions[type_name] = schema, self._typestore.hash_rihs01(type_name)
        return self._definitions[type_name]

    def _declare(self, key: _StreamKey, schema: str, schema_encoding: str, type_hash: str) -> _Stream:
        schema_key = (key.type, schema_encoding, schema)
        if schema_key not in self._schemas:
            self._schemas[schema_key] = self._writer.register_schema(key.type, schema_encoding, schema.encode())
        metadata = {"offered_qos_profiles": profiles_text(key.qos), "topic_type_hash": type_hash}
        channel = self._writer.register_channel(key.topic, MessageEncoding.CDR, self._schemas[schema_key], metadata)
        self._streams[key] = _Stream(channel, type_hash)
        return self._streams[key]


def _make_folder(path: Path) -> None:
    path.mkdir(exist_ok=True)
    if path.is_symlink():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path))


def _lock(file: BinaryIO, path: Path, expected: str, kind: int = fcntl.LOCK_EX) -> None:
    if not lock(file, kind):
        raise InvalidValueError("output", path, expected)
