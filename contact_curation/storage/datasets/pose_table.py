"""Poses over time as text, a row each: what motion capture, pose estimators and `rostopic echo -p` write.

The columns are told by a header, in any order and among others; without one they are those of the TUM benchmark's
trajectories (https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats): time, x, y, z, qx, qy, qz, qw. Comma, semicolon,
tab or spaces part the columns.
"""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from functools import partial
from itertools import islice, pairwise
from pathlib import Path
from statistics import median
from typing import NamedTuple

from contact_curation.errors import InvalidValueError, UnreadableInputError, why_unreadable
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.toss import NANOSECONDS

TUM = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
KINDS = ("x", "y", "z", "qw", "qx", "qy", "qz")

LONGEST_LINE, LONGEST_HEADER = 1 << 16, 100
"""Characters of a line, and lines before the first row of numbers."""

POSITION_WORDS = {"p", "t", "pos", "position", "point", "trans", "translation", "location", "xyz"}
ORIENTATION_WORDS = {"q", "quat", "quaternion", "orient", "orientation", "rot", "rotation", "attitude"}
WHOLE_SECONDS, NANOSECONDS_BESIDE = {"sec", "secs"}, {"nanosec", "nanosecs", "nsec", "nsecs"}
TIME_WORDS = {"t", "time", "timestamp", "stamp", "seconds", "nanoseconds", "ns", *WHOLE_SECONDS, *NANOSECONDS_BESIDE}
OTHER_WORDS = {"v", "vel", "velocity", "twist", "angular", "linear", "acc", "acceleration", "cov", "covariance", "euler", "b"}
"""Of columns that are no pose: EuRoC's ground truth has velocities and biases beside it."""

UNITS_OF_TIME = {
    "s": NANOSECONDS, "seconds": NANOSECONDS, "secs": NANOSECONDS, "sec": NANOSECONDS,
    "ms": 1_000_000, "milliseconds": 1_000_000, "us": 1_000, "microseconds": 1_000, "ns": 1, "nanoseconds": 1,
}  # fmt: skip
UNITS_OF_LENGTH = {"mm": 0.001, "millimeters": 0.001, "millimetres": 0.001, "cm": 0.01}
"""[m] Others are metres."""

LARGEST_STEP = {"s": 0.5, "ms": 0.5e3, "us": 0.5e6}
"""Of the times of poses that come at 2 Hz at least, by the unit that they are in; larger ones are nanoseconds."""

LOOKED_AT = 1000
"""Rows that tell the unit of the times."""

LARGEST_TIME, SLOWEST_RATE = Decimal(1 << 62), 1e-3
COMMENTS, SEPARATORS = ("#", "%"), (";", "\t", ",", None)
SHOWN = 12
"""Names of columns in a message."""

EXPECTED = f"columns named {', '.join(TUM)} (or such as pose.position.x, q_w), or without names, in this order"


class _Columns(NamedTuple):
    """Where the columns are: that of times, of nanoseconds beside whole seconds, and those of `KINDS`."""

    time: int | None
    nanoseconds: int | None
    time_unit: int | None
    pose: tuple[int, ...]
    length: float

    @property
    def fewest(self) -> int:
        return 1 + max(at for at in (self.time, self.nanoseconds, *self.pose) if at is not None)


class PoseTable:
    """The poses of a file of text.

    Args:
        path: of the file.
        rate: poses in a second, of a file without times; None where it has them.

    Attributes:
        named: whether a header names the columns.
        left_out: how many rows of the last iteration had no whole pose, and what the first of them lacked.

    Raises:
        UnreadableInputError: it cannot be read, or its columns are no poses.
        InvalidValueError: a rate and times, or neither.
    """

    def __init__(self, path: Path, rate: float | None = None) -> None:
        self.path, self.named, self.left_out = path, True, (0, "")
        if path.exists() and not path.is_file():
            raise UnreadableInputError(path, "is no regular file, expected one: it is read several times")
        self._columns = self._header()
        if rate is None and self._columns.time is None:
            raise InvalidValueError("rate", f"none, and no times in {path}", "poses in a second (--rate)")
        if rate is not None and self._columns.time is not None:
            raise InvalidValueError("rate", f"{rate:g}, and times in {path}", "no rate where times are known")
        if rate is not None and not rate >= SLOWEST_RATE:
            raise InvalidValueError("rate", f"{rate:g}", f"at least {SLOWEST_RATE:g} poses in a second")
        self._period_ns = None if rate is None else NANOSECONDS / rate
        self._unit = self._columns.time_unit or (1 if rate is not None else self._unit_by_steps())

    def __iter__(self) -> Iterator[tuple[int, ScalarPose]]:
        """Stamps [ns] as in the file, and poses in metres."""
        left_out, first = 0, ""
        self.left_out = left_out, first
        for row, (line, values) in enumerate(self._rows()):
            try:
                if len(values) < self._columns.fewest:
                    raise _NoPose(f"found {len(values)} values, expected {self._columns.fewest}")
                yield self._stamp_ns(row, values), self._pose(values)
            except _NoPose as why:
                left_out, first = left_out + 1, first or f"line {line}: {why}"
                self.left_out = left_out, first

    def _stamp_ns(self, row: int, values: Sequence[str]) -> int:
        if self._period_ns is not None:
            return round(row * self._period_ns)
        time, beside = (None if at is None else _time(values[at]) for at in self._columns[:2])
        if time is None:
            raise _NoPose("found no time")
        return int(time * self._unit) + (0 if beside is None else int(beside))

    def _pose(self, values: Sequence[str]) -> ScalarPose:
        x, y, z, qw, qx, qy, qz = (_number(values[at]) for at in self._columns.pose)
        length = self._columns.length
        return ScalarPose((length * x, length * y, length * z), (qw, qx, qy, qz))

    def _unit_by_steps(self) -> int:
        at = self._columns.time
        rows = (values for _, values in islice(self._rows(), LOOKED_AT) if at is not None and at < len(values))
        times = [time for time in (_time(values[at or 0]) for values in rows) if time is not None]
        steps = [later - earlier for earlier, later in pairwise(times) if later > earlier]
        step = float(median(steps)) if steps else 0.0
        return UNITS_OF_TIME[next((unit for unit, most in LARGEST_STEP.items() if step <= most), "ns")]

    def _lines(self) -> Iterator[tuple[int, str]]:
        try:
            with self.path.open(encoding="utf-8-sig", errors="replace") as file:
                for number, line in enumerate(iter(partial(file.readline, LONGEST_LINE), ""), start=1):
                    if len(line) == LONGEST_LINE or "\0" in line:
                        raise UnreadableInputError(self.path, f"found no text in line {number}, expected a row of numbers")
                    yield number, line.strip()
        except OSError as error:
            raise UnreadableInputError(self.path, why_unreadable(self.path, error)) from error

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        for number, line in self._lines():
            if number >= self._first_line and line and not line.startswith(COMMENTS):
                yield number, _parts(line, self._separator)

    def _header(self) -> _Columns:
        """The columns; finds the first row, and what separates its values."""
        before: list[str] = []
        for number, line in islice(self._lines(), LONGEST_HEADER):
            for separator in SEPARATORS:
                row = _parts(line, separator)
                if not line.startswith(COMMENTS) and _is_row(row):
                    self._first_line, self._separator = number, separator
                    return self._told(_headers(before, separator, len(row)), len(row))
            before.append(line)
        raise UnreadableInputError(self.path, f"found no numbers in the first {LONGEST_HEADER} lines; expected {EXPECTED}")

    def _told(self, headers: Sequence[Sequence[str]], count: int) -> _Columns:
        """The columns by the first of some headers that names a pose."""
        if not headers and count in (len(TUM), len(TUM) - 1):
            self.named, headers = False, [TUM[-count:]]
        why = f"{count} columns without names"
        for names in reversed(headers):
            try:
                return _columns(names)
            except _NoPose as lacking:
                why = str(lacking)
        raise UnreadableInputError(self.path, f"found {why}; expected {EXPECTED}")


class _NoPose(Exception):
    """Of a row or a header: what it is in place of a pose."""


def _parts(line: str, separator: str | None) -> list[str]:
    """The values of a line."""
    if separator != ",":
        line = line.replace(",", ".")  # 0,5;1,5 in parts of Europe
    parts = next(csv.reader([line], delimiter=separator), []) if separator else line.split()
    return [part.strip().strip("\"'") for part in parts]


def _is_row(parts: Sequence[str]) -> bool:
    numbers, empty = sum(_is_number(part) for part in parts), sum(not part for part in parts)
    return numbers > len(parts) - numbers - empty and numbers + empty >= len(KINDS)


def _headers(before: Sequence[str], separator: str | None, count: int) -> list[Sequence[str]]:
    """Names of the columns: the last line before the rows, and before it that line below the one above it, as Motive writes.

    Comments are names where there are as many as columns.
    """
    lines = []
    for line in before:
        names = _parts(line.lstrip("".join(COMMENTS)).strip(), separator)
        if any(names) and not (line.startswith(COMMENTS) and len(names) != count):
            lines.append(names)
    if len(lines) > 1 and len(lines[-2]) == len(lines[-1]):
        return [[" ".join(pair) for pair in zip(*lines[-2:])], lines[-1]]
    return list(lines[-1:])


def _columns(names: Sequence[str]) -> _Columns:
    """Those that names tell."""
    found: dict[str, list[int]] = {}
    for at, name in enumerate(names):
        found.setdefault(_kind(name), []).append(at)
    for kind in KINDS:
        several = [names[at] for at in found.get(kind, [])]
        if len(several) > 1:
            raise _NoPose(f"{len(several)} columns of {kind} ({several[0]}, {several[1]})")
    missing = [kind for kind in KINDS if kind not in found]
    if missing:
        shown = ", ".join(name for name in names[:SHOWN] if name) + (", ..." if len(names) > SHOWN else "")
        raise _NoPose(f"no column of {', '.join(missing)} in {shown}")
    times = found.get("time", [])
    times = [at for at in times if "header" in _words(names[at])] or times
    pose = tuple(found[kind][0] for kind in KINDS)
    length = UNITS_OF_LENGTH.get(_unit(names[pose[0]]), 1.0)
    for at in times:
        for beside in times:
            words, others = set(_words(names[at])), set(_words(names[beside]))
            if words & WHOLE_SECONDS and words - WHOLE_SECONDS == others - NANOSECONDS_BESIDE:
                return _Columns(at, beside, NANOSECONDS, pose, length)
    time = times[0] if times else None
    return _Columns(time, None, None if time is None else UNITS_OF_TIME.get(_unit(names[time])), pose, length)


def _kind(name: str) -> str:
    """What a column contains: one of `KINDS`, a time, or empty."""
    words = _words(name)
    if not words or set(words) & OTHER_WORDS:
        return ""
    axis, others = re.fullmatch(r"([qpt]?)([wxyz])", words[-1]), set(words[:-1])
    if axis is None:
        return "time" if set(words) & TIME_WORDS else ""
    if axis[1] == "q" or axis[2] == "w" or others & ORIENTATION_WORDS:
        return "q" + axis[2]
    return axis[2] if axis[1] or not others or others & POSITION_WORDS else ""


def _unit(name: str) -> str:
    """The unit of a column: in brackets, else the name's last word."""
    bracketed = re.search(r"[\[(]\s*(\w+)\s*[\])]", name)
    return bracketed[1].lower() if bracketed else (_words(name) or [""])[-1]


def _words(name: str) -> list[str]:
    """The parts of a column's name in lower case, without a unit in brackets."""
    return re.findall(r"[a-z]+", re.sub(r"[\[(][^\[\]()]*[\])]", "", name).lower())


def _time(text: str) -> Decimal | None:
    """A time with all of its digits, a date (ISO 8601, UTC if it does not say) as seconds since 1970; None for what is none."""
    try:
        value = Decimal(text)
    except InvalidOperation:
        return _date(text)
    return value if value.is_finite() and value.copy_abs() < LARGEST_TIME else None


def _date(text: str) -> Decimal | None:
    try:
        date = datetime.fromisoformat(text)
    except ValueError:
        return None
    passed = (date if date.tzinfo else date.replace(tzinfo=UTC)) - datetime.fromtimestamp(0, UTC)
    return Decimal(passed // timedelta(microseconds=1)).scaleb(-6)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(text: str) -> float:
    if not _is_number(text) or not math.isfinite(float(text)):
        raise _NoPose(f"found {text[:40]!r}, expected a number")
    return float(text)
