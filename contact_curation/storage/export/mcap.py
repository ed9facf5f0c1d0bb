"""Exports the selected tosses of recordings as MCAP files, with the same messages, which give the same tosses again.

A part of a recording consists of the messages of some windows of time, byte for byte, and of the older messages that they need.
What was written is read back: each toss must be the one of the whole recording, bit for bit; if it is not, a larger window is
taken.

The older messages of a window are all of /tf_static, and the newest of every other latched topic and of the camera; latched
poses are not among them. Images may have waited for the first CameraInfo, so this is taken even if it came after them.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.well_known import SchemaEncoding
from rosbags.typesys import Stores, get_typestore

from contact_curation.contact.body import Body
from contact_curation.errors import ChangedTossError
from contact_curation.motion.pose_noise import TrackerScale
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.records import OfferedQos, RawMessage
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.export.survey import Motion, Surroundings, Survey, Window, Windows, digests_in, survey
from contact_curation.storage.inputs.pose_source import TF_STATIC_NAME, PoseSource
from contact_curation.storage.inputs.recording_notes import RULES_NOTE, note_of_rules
from contact_curation.storage.inputs.records import InputsConfig
from contact_curation.storage.provenance import TossProvenance

RIG_MARGIN_NS = 1_100_000_000
"""Additional time for poses of a moving board or camera: two on either side are interpolated, at most half a second apart."""

EXPORT_NOTE = "contact_curation.export"
NOTES_OF_OTHERS = ("rosbag2",)
"""Notes about all messages of the recording, which do not apply to a part of it."""


class SubsetFile:
    """Writes one part of a bag, opened at its first message; use it as a context manager.

    Args:
        path: path of the file.
        windows: windows of log times.
        source: the topics with the body's poses.
        qos: gives the quality of service of a topic's publishers.
    """

    def __init__(self, path: Path, windows: Iterable[Window], source: PoseSource, qos: Callable[[str], OfferedQos]) -> None:
        listed = tuple(windows)
        self._path = path
        self._qos = qos
        self._source = source
        self._camera = source.camera.name if source.camera else ""
        self._calibrated = not self._camera
        self._rig = frozenset(source.topics) - {source.body.name}
        self._windows = Windows(listed)
        self._rig_windows = Windows(one.wider(RIG_MARGIN_NS) for one in listed)
        self._pending: dict[str, list[RawMessage]] = {}
        self._bag: BagWriter | None = None

    def offer(self, message: RawMessage) -> None:
        """Takes the next message of the bag, and writes it if it belongs to the part."""
        windows = self._rig_windows if message.topic in self._rig else self._windows
        late_camera = message.topic == self._camera and self._bag is not None and not self._calibrated
        if late_camera or windows.holds(message.log_time_ns):
            held = sorted((one for pending in self._pending.values() for one in pending), key=lambda one: one.log_time_ns)
            self._pending.clear()
            for one in (*held, message):
                self._write(one)
        elif self._holds_for_later(message.topic):
            earlier = self._pending.get(message.topic, []) if _is_static(message.topic) else []
            if all(one.data != message.data for one in earlier):
                self._pending[message.topic] = [*earlier, message]

    def over(self, log_time_ns: int) -> bool:
        """Whether no message from this time on can belong to the part."""
        return self._calibrated and self._rig_windows.over(log_time_ns)

    def note(self, name: str, values: dict[str, str]) -> None:
        """Adds a note about the recording that this is a part of."""
        self._opened().note(name, values)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._bag is not None:
            self._bag.__exit__(kind, error, trace)

    def _holds_for_later(self, topic: str) -> bool:
        if topic == self._source.body.name:
            return False
        return topic == self._camera or _is_static(topic) or self._qos(topic).latched

    def _opened(self) -> BagWriter:
        if self._bag is None:
            self._bag = BagWriter(self._path)
        return self._bag

    def _write(self, one: RawMessage) -> None:
        self._calibrated = self._calibrated or one.topic == self._camera
        schema, encoding = (
            (one.schema, one.schema_encoding) if one.schema else (_known_definition(one.type), SchemaEncoding.ROS2)
        )
        self._opened().write_raw(
            one.topic,
            one.type,
            schema,
            one.data,
            one.log_time_ns,
            qos=self._qos(one.topic),
            schema_encoding=encoding,
            type_hash=one.type_hash,
            publish_time_ns=one.publish_time_ns,
        )


def write_subsets(reader: BagReader, parts: dict[Path, tuple[Window, ...]], source: PoseSource, noise: TrackerScale) -> None:
    """Writes parts of a bag as bags.

    Args:
        reader: reader of the bag.
        parts: windows of log times, by the file that they are written to.
        source: the topics with the body's poses.
        noise: of the tracker, which a short part cannot tell as well as the whole.

    Raises:
        InvalidValueError: a file cannot be written.
    """
    qos = cache(reader.qos)
    notes = {name: values for name, values in reader.notes.items() if name not in NOTES_OF_OTHERS}
    notes[EXPORT_NOTE] = {"input": str(reader.path), "sha256": reader.sha256}
    if noise.position == noise.turn:
        notes[RULES_NOTE] = {**notes.get(RULES_NOTE, {}), **note_of_rules(SegmenterConfig(tracker_noise=noise.position))}
    open_files = {path: SubsetFile(path, windows, source, qos) for path, windows in parts.items()}

    def finish(path: Path) -> None:
        with open_files.pop(path) as file:
            for name, values in notes.items():
                file.note(name, values)

    try:
        for message in reader.raw_messages():
            for path in [path for path, file in open_files.items() if file.over(message.log_time_ns)]:
                finish(path)
            for file in open_files.values():
                file.offer(message)
        for path in list(open_files):
            finish(path)
    except BaseException as error:
        for file in open_files.values():
            file.__exit__(type(error), error, error.__traceback__)
        raise


def _is_static(topic: str) -> bool:
    return topic.rpartition("/")[2] == TF_STATIC_NAME


@cache
def _known_definition(type_name: str) -> str:
    """ROS 2 Jazzy's definition of a type, for bags without definitions; empty for other types."""
    store = get_typestore(Stores.ROS2_JAZZY)
    return store.generate_msgdef(type_name, ros_version=2)[0] if type_name in store.fielddefs else ""


type Parts = dict[Path, tuple[Window, ...]]


@dataclass(frozen=True, eq=False)
class BagExport:
    """The export of one recording.

    Attributes:
        origin: the recording.
        files: file of each exported toss, by its id; empty if no toss of the recording was selected.
        warnings: what could not be read, and motions in the files that were not selected; one line each.
    """

    origin: TossProvenance
    files: Mapping[str, Path]
    warnings: tuple[str, ...]


def export_bag(
    path: Path,
    files: Mapping[str, Path],
    body: Body,
    config: InputsConfig,
    advance: Callable[[int], None],
) -> BagExport:
    """Exports the selected tosses of a bag.

    Args:
        path: path of the bag.
        files: file of each selected toss, by its id; several may go to one file.
        body: tossed body.
        config: how the bag is read.
        advance: called with the number of further motions that were read.

    Raises:
        UnreadableInputError: the file is no bag.
        ChangedTossError: a toss read from the part differs from that of the whole recording.
        MissingTopicError: no topic, or more than one, may contain the body's poses.
        InvalidValueError: a file cannot be written.
    """
    with BagReader(path) as reader:
        found = survey(reader, body, config, advance)
        motions = found.wanted(files)
        if not motions:
            return BagExport(found.origin, {}, found.left_out)
        for surroundings in Surroundings:
            parts = _parts(found, motions, surroundings, files)
            write_subsets(reader, parts, found.source, found.noise)
            again = _read_again(parts, body, config)
            changed = [motion.toss_id for motion in motions if again.get(motion.toss_id) != motion.digest]
            if not changed:
                break
        else:
            raise ChangedTossError(path, changed[0])
    taken = {motion.toss_id: files[motion.toss_id] for motion in motions}
    others = sorted(set(again) - set(taken))
    extra = (f"{path}: the export holds motions that were not selected, too: {', '.join(others)}",) if others else ()
    return BagExport(found.origin, taken, (*found.left_out, *extra))


def _parts(found: Survey, motions: Sequence[Motion], surroundings: Surroundings, files: Mapping[str, Path]) -> Parts:
    parts: Parts = {}
    for motion in motions:
        target = files[motion.toss_id]
        parts[target] = (*parts.get(target, ()), found.window(motion, surroundings))
    return parts


def _read_again(files: Iterable[Path], body: Body, config: InputsConfig) -> dict[str, str]:
    """Reads the digests of all motions in some bags."""
    digests: dict[str, str] = {}
    for file in files:
        with BagReader(file) as reader:
            digests.update(digests_in(reader, body, config))
    return digests
