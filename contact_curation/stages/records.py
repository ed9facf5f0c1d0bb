"""The state of the stages between runs, as typed records; only this module knows their format.

A record is a frozen dataclass or named tuple of numbers, texts, tuples, mappings, throws and other records. On disk it is one
JSON object: its fields, and under `format` the version of this layout. A newer one, or something else, is refused in one line;
one without a format was written before there were formats. Whoever supervises the stages reads the same records. `KEY` is the
name that a store has a record under.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from math import inf
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ClassVar, NamedTuple, get_args, get_origin, get_type_hints

from contact_curation.design.designer import Realised
from contact_curation.design.release_delay import Seen
from contact_curation.design.throw import Throw, ThrowKind, ThrowReport, ThrowState
from contact_curation.errors import InvalidValueError, UnreadableInputError
from contact_curation.files import read_bounded, write_atomically
from contact_curation.stages.joint_gains import UNKNOWN_GAINS, JointGains

FORMAT = 1
"""Version of the layout of all records."""

LARGEST_BYTES = 1 << 16
"""Of a record in a file of its own."""


class Cursor(NamedTuple):
    """The last numbered message that was taken; zero and empty before the first.

    Attributes:
        sequence: its number.
        toss_id: its toss.
        version: of the theta, if it is information.
    """

    sequence: int = 0
    toss_id: str = ""
    version: str = ""


class Stamped(NamedTuple):
    """What a message's header says of a toss.

    Attributes:
        stamp_ns: time.
        frame_id: frame.
    """

    stamp_ns: int = 0
    frame_id: str = ""


START, UNSTAMPED = Cursor(), Stamped()


@dataclass(frozen=True)
class IngestPosition:
    """What ingest has taken in.

    Attributes:
        configuration: digest of all that the tosses depend on.
        newest: per topic the time of publication of the newest measurement [ns].
    """

    KEY: ClassVar = "newest"
    configuration: str
    newest: Mapping[str, int]


@dataclass(frozen=True)
class IngestSnapshot:
    """The state that measurements of the journal are taken in from.

    Attributes:
        configuration: digest of all that the tosses depend on.
        after: number of the last measurement in it.
        ingest: `TossIngest.snapshot`.
    """

    KEY: ClassVar = "ingest"
    configuration: str
    after: int
    ingest: Mapping[str, Any]


@dataclass(frozen=True)
class AnnouncedTosses:
    """Up to which numbers tosses and rejected motions were announced."""

    KEY: ClassVar = "announced"
    tosses: int = 0
    rejected: int = 0


@dataclass(frozen=True)
class ScorerPosition:
    """What the scorer has scored: every toss up to the cursor, at this version of theta.

    Attributes:
        version: of theta.
        cursor: after the last toss.
        loss: by which, in words; empty where it is not known.
        compression: of the factors, likewise.
    """

    KEY: ClassVar = "cursor"
    version: str
    cursor: Cursor
    loss: str = ""
    compression: str = ""


@dataclass(frozen=True)
class AnnouncedInformation:
    """Up to which number information was announced."""

    KEY: ClassVar = "announced"
    sequence: int = 0


@dataclass(frozen=True)
class TossHeader:
    """The header that a toss's information goes out with: stamp of its last frame, frame of its poses."""

    KEY: ClassVar = "header"
    stamped: Stamped


@dataclass(frozen=True)
class CuratorPosition:
    """What the curator has taken in.

    Attributes:
        cursor: behind the last information.
        newest: header of the newest toss.
        versions: thetas that information is known at, the newest last; None before any was forgotten.
        most: most tosses that were known at one theta, which may be forgotten.
        body: whose information was taken; empty where that is not known.
    """

    KEY: ClassVar = "cursor"
    cursor: Cursor = START
    newest: Stamped = UNSTAMPED
    versions: tuple[str, ...] | None = None
    most: int = 0
    body: str = ""


@dataclass(frozen=True)
class BufferRecord:
    """The buffer as it was published last.

    Attributes:
        revision: counts changes of the selected tosses, their order, theta or criterion; 0 before the first.
        selected: ids, best first.
        version: of the theta that they are ranked at.
        criterion: that they are ranked by.
        seen: how many tosses they were selected from.
    """

    KEY: ClassVar = "buffer"
    revision: int = 0
    selected: tuple[str, ...] = ()
    version: str = ""
    criterion: str = ""
    seen: int = 0


@dataclass(frozen=True)
class TrainingRecord:
    """Where the trainer is.

    Attributes:
        round: number of the newest round; 0 before the first.
        gradient_steps: taken so far.
        running: whether it is in the middle of the round.
        version: of the theta at the end of the newest round that has ended; empty before.
        revision: of the buffer that nothing is left to train on of; 0 while there is something.
        tosses_seen: how many tosses that buffer was selected from.
    """

    KEY: ClassVar = "training"
    round: int = 0
    gradient_steps: int = 0
    running: bool = False
    version: str = ""
    revision: int = 0
    tosses_seen: int = 0


class Proposal(NamedTuple):
    """The next throw, and why it is one of exploration; None when it is designed."""

    throw: Throw
    exploration: str | None


@dataclass(frozen=True, eq=False)
class ThrowRecord:
    """A throw that was made.

    Attributes:
        commanded: as planned.
        executed: as it really left.
        after_ns: its toss ends later than this.
        released_ns: when it left.
        exploration: why it was no designed one; None when it was.
        toss_id: its toss, once one was scored.
        realised: its realised gain; None until it was scored at a theta that is known here, and for exploration.
        rejected: why its motion was rejected; empty where it was not.
    """

    commanded: Throw
    executed: Throw
    after_ns: int
    released_ns: int = 0
    exploration: str | None = None
    toss_id: str = ""
    realised: Realised | None = None
    rejected: tuple[str, ...] = ()

    @property
    def planned_gain(self) -> float | None:
        """In log-det, at the theta that its toss was scored at where there is one; None for exploration."""
        if self.exploration is not None:
            return None
        return self.realised.planned if self.realised else self.commanded.expected_information

    @property
    def realised_gain(self) -> float | None:
        """Of its toss, in log-det; None until it is known, and for exploration."""
        return self.realised.realised if self.realised else None

    @property
    def awaits_motion(self) -> bool:
        """Whether neither a toss nor a rejected motion has come of it so far."""
        return not (self.toss_id or self.rejected)

    @property
    def awaits_gain(self) -> bool:
        """Whether its toss was scored, and its gain is not known so far."""
        return bool(self.toss_id) and self.exploration is None and self.realised is None

    @property
    def report(self) -> ThrowReport:
        """What is known of it."""
        rejected = f"rejected: {'; '.join(self.rejected)}" if self.rejected and not self.toss_id else ""
        return ThrowReport(
            kind=kind_of_throw(self.exploration),
            state=ThrowState.SCORED if self.toss_id else ThrowState.EXECUTED,
            commanded=self.commanded,
            executed=self.executed,
            released_ns=self.released_ns,
            toss_id=self.toss_id,
            planned=self.realised.planned if self.realised else self.commanded.expected_information,
            realised=self.realised.realised if self.realised else float("nan"),
            detail=rejected or self.exploration or "",
        )


@dataclass(frozen=True)
class GripperRecord:
    """What a thrower has learned of its gripper and its arm.

    Attributes:
        seen: the gripper's delays that count, oldest first.
        lag: time by which the arm passed its last release later than planned [s].
        joints: how far the arm's joints go, as shares of what they are told.

    Raises:
        InvalidValueError: the time is none that an arm can be late.
    """

    KEY: ClassVar = "gripper"
    seen: tuple[Seen, ...] = ()
    lag: float = 0.0
    joints: JointGains = UNKNOWN_GAINS

    def __post_init__(self) -> None:
        if not 0.0 <= self.lag < inf:
            raise InvalidValueError("lag of an arm", self.lag, "a number of seconds of at least 0")


def kind_of_throw(exploration: str | None) -> ThrowKind:
    """Of a throw that is one of exploration for this reason, or for none."""
    return ThrowKind.DESIGNED if exploration is None else ThrowKind.EXPLORATION


@dataclass(frozen=True, eq=False)
class ThrowLogRecord:
    """All throws of a designer.

    Attributes:
        begun: how many were begun, made or not.
        under_way: the one that was commanded last, until it is known what became of it.
        made: in order.
        no_throw: why none could be proposed since the last one; empty where one could.
    """

    KEY: ClassVar = "throws"
    begun: int = 0
    under_way: Proposal | None = None
    made: tuple[ThrowRecord, ...] = ()
    no_throw: str = ""


@dataclass(frozen=True)
class FirstLoss:
    """Mean loss of a toss when it was first scored."""

    KEY: ClassVar = "first loss"
    mean_loss: float


@dataclass(frozen=True)
class ReferenceScores:
    """Scores of the reference throws, by version of theta, the newest last, and the digest of these throws."""

    KEY: ClassVar = "reference scores"
    scores: Mapping[str, tuple[float, ...]]
    throws: str = ""


@dataclass(frozen=True)
class UsedTime:
    """Simulated time up to which stamps were given [ns]; a file of its own."""

    used_until_ns: int

    def __post_init__(self) -> None:
        if self.used_until_ns < 0:
            raise InvalidValueError("used_until_ns", self.used_until_ns, "at least 0")


@dataclass(frozen=True)
class ServedDashboard:
    """Where the dashboard is served; a file of its own."""

    address: str


def record_bytes(record: Any) -> bytes:
    """A record as bytes."""
    return json.dumps({"format": FORMAT, **_document(record)}).encode()


def record_of[R](kind: type[R], data: bytes, source: Path | str) -> R:
    """The record in such bytes.

    Args:
        kind: of the record.
        data: of whatever is there.
        source: where they come from, for the message.

    Raises:
        UnreadableInputError: they hold a record of a newer format, or something else.
    """
    try:
        document = dict(json.loads(data))
        version = document.pop("format", FORMAT)
        if type(version) is int and version > FORMAT:
            newer = f"holds a {kind.__name__} of format {version}, this package knows formats up to {FORMAT}"
            raise UnreadableInputError(source, newer)
        if version != FORMAT:
            raise ValueError(f"format {version}")
        return _value(kind, document)  # type: ignore[no-any-return]
    except (ValueError, KeyError, TypeError, RecursionError, InvalidValueError) as error:
        why = f"{type(error).__name__}: {error}"[:120]
        raise UnreadableInputError(source, f"found no {kind.__name__} of format {FORMAT} ({why})") from error


def load_record[R](load: Callable[[str], bytes | None], kind: type[R], name: str = "") -> R | None:
    """The record of a kind that a store holds; None where it holds none.

    Args:
        load: of the store.
        kind: of the record.
        name: which, where there are many of the kind.

    Raises:
        UnreadableInputError: there is one of a newer format, or something else.
    """
    key = record_key(kind, name)
    data = load(key)
    return None if data is None else record_of(kind, data, f"state {key!r}")


def stored_records(*records: Any, name: str = "") -> dict[str, bytes]:
    """Records as a state store saves them, together."""
    return {record_key(type(record), name): record_bytes(record) for record in records}


def record_key(kind: Any, name: str = "") -> str:
    """The key of a record in a state store."""
    return f"{kind.KEY}/{name}" if name else str(kind.KEY)


def read_record[R](path: Path, kind: type[R]) -> R | None:
    """The record in a file of its own; None where there is no file.

    Raises:
        UnreadableInputError: it holds something else.
    """
    return record_of(kind, read_bounded(path, LARGEST_BYTES, f"a {kind.__name__}"), path) if path.exists() else None


def write_record(path: Path, record: Any) -> None:
    """Replaces the file by the record, atomically.

    Raises:
        InvalidValueError: it cannot be written there.
    """
    write_atomically(path, record_bytes(record) + b"\n")


def _document(record: Any) -> dict[str, Any]:
    """A record's fields as JSON has them."""
    return {name: _plain(getattr(record, name)) for name in _field_names(record)}


def _field_names(record: Any) -> list[str]:
    """Of a record or of its class."""
    return list(record._fields) if hasattr(record, "_fields") else [field.name for field in fields(record)]


def _plain(value: Any) -> Any:
    if isinstance(value, Throw):
        return value.to_mapping()
    if is_dataclass(value) or hasattr(value, "_fields"):
        return _document(value)
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    return value


def _value(kind: Any, found: Any) -> Any:
    """What was found as a value of the type.

    Raises:
        ValueError, KeyError, TypeError, InvalidValueError: it is none.
    """
    if kind is Any:
        return found
    if kind is Throw:
        return Throw.from_mapping(found)
    origin, parts = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return None if found is None and NoneType in parts else _value(parts[0], found)
    if origin is tuple:
        return tuple(_value(parts[0], one) for one in found)
    if origin is not None:
        return {str(name): _value(parts[1], one) for name, one in dict(found).items()}
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        hints, known = get_type_hints(kind), _field_names(kind)
        unknown = sorted(set(found) - set(known))
        if unknown:
            raise KeyError(unknown[0])
        return kind(**{name: _value(hints[name], value) for name, value in dict(found).items()})
    if type(found) is not kind and not (kind is float and type(found) is int):
        raise TypeError(f"found {found!r}, expected {kind.__name__}")
    return found
