"""Poses over time as text or in Parquet, a row each: what motion capture, pose estimators and `rostopic echo -p` write.

The columns are told by a header, in any order and among others; without one they are those of the TUM benchmark's
trajectories (https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats): time, x, y, z, qx, qy, qz, qw. Comma, semicolon,
tab or spaces part the columns.
"""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from functools import partial
from itertools import islice, pairwise, takewhile
from pathlib import Path
from statistics import median
from typing import NamedTuple

from contact_curation.errors import InvalidValueError, UnreadableInputError, why_unreadable
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.datasets.orientations import (
    ANGLES,
    NUMBERED,
    QUATERNION,
    UNTOLD,
    AngleConvention,
    ToQuaternion,
    of_matrix,
    of_quaternion,
)
from contact_curation.storage.datasets.parquet_lines import is_parquet, parquet_lines
from contact_curation.storage.datasets.pose_columns import (
    POSITION,
    TUM,
    UNITS_OF_TIME,
    ColumnsError,
    PoseColumns,
    columns_of,
    words_of,
)
from contact_curation.storage.inputs.pose_messages import BODY_PREFIX, MOST_NAMES

LONGEST_LINE, LONGEST_HEADER = 1 << 16, 100
"""Characters of a line, and lines before the first row of numbers."""

LARGEST_STEP = {"s": 0.5, "ms": 0.5e3, "us": 0.5e6}
"""Of the times of poses that come at 2 Hz at least, by the unit that they are in; larger ones are nanoseconds."""

LOOKED_AT = 1000
"""Rows that tell the unit of the times."""

FINE = re.compile(r"[.,]\d{6}(\d+)")
"""What a date has beyond microseconds, which Python's do not."""

LARGEST_TIME, SLOWEST_RATE = Decimal(1 << 62), 1e-3
COMMENTS, SEPARATORS = ("#", "%"), (";", "\t", ",", None)
NAMING_WORDS = {"name", "id", "body", "object", "subject", "target", "tag", "marker", "rigid", "child", "frame"}
"""Of a column that says whose pose a row has."""
FRAME_WORDS, COUNTING_WORDS = {"frame", "frames"}, {"number", "num", "nr", "no", "index", "idx", "id", "count"}
"""Of a column with the numbers of frames."""
FEWEST = len(POSITION) + len(ANGLES)
"""Numbers of a row."""

NAMES = "such as pose.position.x, q_w, or r11 to r33, or roll, pitch, yaw"
EXPECTED = f"columns named {', '.join(TUM)} (or {NAMES}), or without names, in this order"


class PoseTable:
    """The poses of a file of text, or in Parquet.

    Args:
        path: of the file.
        rate: poses in a second, of a file without times; None where it has them.
        body: whose poses are wanted, where the table has those of several.
        angles: how angles turn, of a table that has them in place of quaternions or matrices.

    Attributes:
        named: whether a header names the columns.
        of_others: how many rows of the last iteration a column says to be of other bodies.
        assumed: what names of columns do not say, and how it was taken; empty where they say all.
        left_out: how many rows of the last iteration had no whole pose, and what the first of them lacked.

    Raises:
        UnreadableInputError: it cannot be read, or its columns are no poses.
        InvalidValueError: a rate and times, or neither.
    """

    def __init__(self, path: Path, rate: float | None = None, body: str = "", angles: AngleConvention = UNTOLD) -> None:
        self.path, self.named, self.left_out, self.of_others = path, True, (0, ""), 0
        self._body, self._name, self._length_unit, self._names = body, "", "", list[str]()
        if path.exists() and not path.is_file():
            raise UnreadableInputError(path, "is no regular file, expected one: it is read several times")
        self._columns = self._with_one_time(self._header())
        if rate is None and self._columns.time is None:
            raise InvalidValueError("rate", f"none, and no times in {path}", "poses in a second (--rate)")
        if rate is not None and self._columns.time not in (None, self._columns.date):
            raise InvalidValueError("rate", f"{rate:g}, and times in {path}", "no rate where times are known")
        if rate is not None and not rate >= SLOWEST_RATE:
            raise InvalidValueError("rate", f"{rate:g}", f"at least {SLOWEST_RATE:g} poses in a second")
        self._period_ns = None if rate is None else NANOSECONDS / rate
        self._to_quaternion = self._orientations(angles)
        self._whose = self._column_of_names()
        self._frames = None if rate is None else self._column_of_frames()
        self._unit = self._columns.time_unit or (1 if rate is not None else self._unit_by_steps())

    def __iter__(self) -> Iterator[tuple[int, ScalarPose]]:
        """Stamps [ns] as in the file, and poses in metres."""
        left_out, first = 0, ""
        self.left_out, self.of_others = (left_out, first), 0
        for row, (line, values) in enumerate(self._own_rows()):
            try:
                if len(values) < self._columns.fewest:
                    raise _NoPose(f"found {len(values)} values, expected {self._columns.fewest}")
                yield self._stamp_ns(row, values), self._pose(values)
            except _NoPose as why:
                left_out, first = left_out + 1, first or f"line {line}: {why}"
                self.left_out = left_out, first

    def _stamp_ns(self, row: int, values: Sequence[str]) -> int:
        if self._period_ns is not None:
            return round((row if self._frames is None else self._frames.poses_at(values)) * self._period_ns)
        time, beside, day = (None if at is None else values[at] for at in (*self._columns[:2], self._columns.date))
        time = time or ""
        if (number := _time(time)) is not None:
            return int(number * self._unit) + int(self._columns.beside_unit * ((_time(beside) if beside else None) or 0))
        seconds = _date(time)
        if seconds is None and day is not None:
            time = f"{day} {time}"
            seconds = _date(time)
        if seconds is None:
            expected = "a number, or a date with a time such as 2026-11-28 10:00:00.0067, also in two columns"
            raise _NoPose(f"found no time in {time[:40]!r}, expected {expected}")
        return int(seconds * NANOSECONDS)

    def _pose(self, values: Sequence[str]) -> ScalarPose:
        x, y, z, *orientation = (_number(values[at]) for at in self._columns.pose)
        length = self._columns.length
        try:
            return ScalarPose((length * x, length * y, length * z), self._to_quaternion(orientation))
        except ValueError as error:
            raise _NoPose(str(error)) from error

    def _orientations(self, angles: AngleConvention) -> ToQuaternion:
        """What makes quaternions of the columns of orientations.

        Raises:
            UnreadableInputError: they are angles, and it is not known how they turn.
            InvalidValueError: it is said of angles that are none, or otherwise than in the names of columns.
        """
        form, told = self._columns.form, self._columns.angle_unit
        named = [self._names[at] for at in self._columns.pose[len(POSITION) :]] if self._names else []
        taken = [f"{named[0]} to {named[-1]} are taken as a rotation matrix row by row"] if form in NUMBERED else []
        time, other = self._columns.time, self._columns.other_time
        if time is not None and other is not None:
            taken += [f"times are taken from {self._names[time]}, not from {self._names[other]}: leave out the wrong one"]
        self.assumed = "; ".join(taken)
        if form != ANGLES:
            if angles != UNTOLD:
                given = " ".join(filter(None, (angles.order, angles.unit)))
                raise InvalidValueError("angles", f"{given}, and no angles in {self.path}", "angles, or no such option")
            return of_quaternion if form == QUATERNION else of_matrix
        found = f"found angles {', '.join(named)}"
        if not angles.order:
            how = "in which order they turn, --angles (xyz: about fixed axes, XYZ: about the body's), or a quaternion or matrix"
            raise UnreadableInputError(self.path, f"{found}, expected {how}")
        if not told and not angles.unit:
            raise UnreadableInputError(self.path, f"{found}, expected a unit in their names, or --angle-unit deg or rad")
        if told and angles.unit and told != angles.unit:
            raise InvalidValueError("angle_unit", f"{angles.unit}, and {told} in {self.path}", "the unit of the columns")
        return replace(angles, unit=told or angles.unit).to_quaternion

    def _column_of_names(self) -> int | None:
        """The column that says whose pose a row has, where some rows have the body's and others not.

        Raises:
            UnreadableInputError: it has several names, none of them the body's.
        """
        rows = [values for _, values in islice(self._rows(), LOOKED_AT)]
        used = {self._columns.time, self._columns.beside, *self._columns.pose}
        for at, name in enumerate(self._names):
            words = set(words_of(name))
            if at in used or not words or not words <= NAMING_WORDS:
                continue
            found = list(dict.fromkeys(values[at] for values in rows if at < len(values)))
            if _numbers_frames(words) and all(_time(one) is not None for one in found):
                continue
            if not 1 < len(found) <= len(rows) // 2:  # else rows are numbered
                continue
            called = self._called(found)
            if len(called) == 1:
                self._name = called[0]
                return at
            which = "several" if called else "none"
            what = f"poses of {', '.join(found[:MOST_NAMES])} in column {name!r}, {which} of them {self._body}'s"
            raise UnreadableInputError(self.path, f"found {what}; name the body (--body-name), or give the rows of one")
        return None

    def _column_of_frames(self) -> "_Frames | None":
        """The column that numbers the frames of a camera, if it has numbers that grow: some may have no row."""
        rows = [values for _, values in islice(self._own_rows(), LOOKED_AT)]
        for at, name in enumerate(self._names):
            numbers = [_time(values[at]) for values in rows if at < len(values)] if _numbers_frames(set(words_of(name))) else []
            known = [number for number in numbers if number is not None]
            steps = [int(later - earlier) for earlier, later in pairwise(known) if later > earlier]
            if any(steps) and known == numbers:
                return _Frames(at, math.gcd(*steps))
        return None

    def _called(self, names: Sequence[str]) -> list[str]:
        """Those of some names that are the body's: its name as it is, else the same words."""
        own = (self._body, f"{BODY_PREFIX}{self._body}")
        words = [words_of(name) for name in own]
        return [name for name in names if name in own] or [name for name in names if words_of(name) in words]

    def _with_one_time(self, columns: PoseColumns) -> PoseColumns:
        """Columns without what is beside seconds, where either are whole times by themselves."""
        if columns.time is None or columns.beside is None:
            return columns
        rows = [values for _, values in islice(self._rows(), LOOKED_AT) if len(values) >= columns.fewest]
        seconds, beside = ([_time(values[at]) or 0 for values in rows] for at in (columns.time, columns.beside))
        if any(one * columns.beside_unit >= NANOSECONDS for one in beside):
            return columns._replace(time=columns.beside, beside=None, time_unit=columns.beside_unit)
        return columns._replace(beside=None) if any(one % 1 for one in seconds) else columns

    def _unit_by_steps(self) -> int:
        at = self._columns.time
        rows = (values for _, values in islice(self._rows(), LOOKED_AT) if at is not None and at < len(values))
        times = [time for time in (_time(values[at or 0]) for values in rows) if time is not None]
        steps = [later - earlier for earlier, later in pairwise(times) if later > earlier]
        step = float(median(steps)) if steps else 0.0
        return UNITS_OF_TIME[next((unit for unit, most in LARGEST_STEP.items() if step <= most), "ns")]

    def _lines(self) -> Iterator[tuple[int, str]]:
        if is_parquet(self.path):
            yield from enumerate(parquet_lines(self.path), start=1)
            return
        try:
            with self.path.open(encoding="utf-8-sig", errors="replace") as file:
                for number, line in enumerate(iter(partial(file.readline, LONGEST_LINE), ""), start=1):
                    if len(line) == LONGEST_LINE or "\0" in line:
                        what = f"found no text in line {number}, expected a row of numbers"
                        raise UnreadableInputError(self.path, f"{what}; cc.write_poses writes arrays")
                    yield number, line.strip()
        except OSError as error:
            raise UnreadableInputError(self.path, why_unreadable(self.path, error)) from error

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        for number, line in self._lines():
            if number >= self._first_line and line and not line.startswith(COMMENTS):
                yield number, _parts(line, self._separator)

    def _own_rows(self) -> Iterator[tuple[int, list[str]]]:
        """Those of the body, where a column says whose they are; counts the others."""
        for line, values in self._rows():
            if self._whose is not None and self._whose < len(values) and values[self._whose] != self._name:
                self.of_others += 1
            else:
                yield line, values

    def _header(self) -> PoseColumns:
        """The columns; finds the first row, and what separates its values."""
        before: list[str] = []
        for number, line in islice(self._lines(), LONGEST_HEADER):
            for separator in SEPARATORS:
                row = _parts(line, separator)
                if not line.startswith(COMMENTS) and _is_row(row):
                    self._first_line, self._separator = number, separator
                    self._length_unit = _length_unit(before, separator)
                    return self._told(_headers(before, separator, len(row)), len(row))
            before.append(line)
        raise UnreadableInputError(self.path, f"found no numbers in the first {LONGEST_HEADER} lines; expected {EXPECTED}")

    def _told(self, headers: Sequence[Sequence[str]], count: int) -> PoseColumns:
        """The columns by the first of some headers that names a pose."""
        if not headers and count in (len(TUM), len(TUM) - 1):
            self.named, headers = False, [TUM[-count:]]
        why = f"{count} columns without names"
        for names in reversed(headers):
            try:
                columns = columns_of(names, self._body, self._length_unit)
            except ColumnsError as lacking:
                why = why if why.startswith("poses of several") else str(lacking)
            else:
                self._names = list(names)
                return columns
        raise UnreadableInputError(self.path, f"found {why}; expected {EXPECTED}")


class _NoPose(Exception):
    """Of a row: what it is in place of a pose."""


class _Frames(NamedTuple):
    """The column with numbers of frames, and how many of them a pose takes: all steps are multiples of that."""

    column: int
    step: int

    def poses_at(self, values: Sequence[str]) -> float:
        """How many poses after frame 0 a row is."""
        number = _time(values[self.column]) if self.column < len(values) else None
        if number is None:
            raise _NoPose("found no number of its frame, expected one")
        return float(number / self.step)


def _numbers_frames(words: set[str]) -> bool:
    """Whether a column with such a name numbers frames, if it has numbers."""
    return bool(words & FRAME_WORDS) and words <= FRAME_WORDS | COUNTING_WORDS


def _parts(line: str, separator: str | None) -> list[str]:
    """The values of a line."""
    if separator != ",":
        line = line.replace(",", ".")  # 0,5;1,5 in parts of Europe
    parts = next(csv.reader([line], delimiter=separator), []) if separator else line.split()
    return [part.strip().strip("\"'") for part in parts]


def _is_row(parts: Sequence[str]) -> bool:
    numbers, empty = sum(_is_number(part) for part in parts), sum(not part for part in parts)
    return numbers > len(parts) - numbers - empty and numbers + empty >= FEWEST


def _headers(before: Sequence[str], separator: str | None, count: int) -> list[Sequence[str]]:
    """Names of the columns: the last line before the rows, below the one above it, or below all that are as long, as in Motive.

    Comments are names where there are as many as columns.
    """
    lines = []
    for line in before:
        names = _parts(line.lstrip("".join(COMMENTS)).strip(), separator)
        if any(names) and not (line.startswith(COMMENTS) and len(names) != count):
            lines.append(names)
    above = list(takewhile(lambda names: len(names) == len(lines[-1]), reversed(lines)))
    return [[" ".join(column) for column in zip(*above[:most][::-1])] for most in dict.fromkeys((len(above), 2, 1)) if above]


def _length_unit(before: Sequence[str], separator: str | None) -> str:
    """What Motive's first line says of all lengths; else empty."""
    cells = [cell.lower() for line in before for cell in _parts(line, separator)]
    return next((unit for name, unit in pairwise(cells) if name == "length units"), "")


def _time(text: str) -> Decimal | None:
    """A time with all of its digits; None for what is no number."""
    try:
        value = Decimal(text)
    except InvalidOperation:
        return None
    return value if value.is_finite() and value.copy_abs() < LARGEST_TIME else None


def _date(text: str) -> Decimal | None:
    """A date (ISO 8601, UTC if it does not say) as seconds since 1970; None for what is none."""
    try:
        date = datetime.fromisoformat(text)
    except ValueError:
        return None
    passed = (date if date.tzinfo else date.replace(tzinfo=UTC)) - datetime.fromtimestamp(0, UTC)
    fine = FINE.search(text)
    beyond = Decimal(fine[1]).scaleb(-6 - len(fine[1])) if fine else Decimal(0)
    return Decimal(passed // timedelta(microseconds=1)).scaleb(-6) + beyond


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
