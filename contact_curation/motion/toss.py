"""One recorded motion, release to rest, in the board's frame and SI units."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.numbers import frozen, number, numbers, plain, shortened
from contact_curation.geometry.poses import QUATERNION_TOLERANCE
from contact_curation.geometry.quaternions import Array

NANOSECONDS = 1_000_000_000


FIRST_WALL_TIME_NS = 10**9 * NANOSECONDS
"""[ns] September 2001: earlier stamps do not come from a clock that was set, such as those of a simulation that begins at 0."""


INEXACT_FROM = 2**53
"""Below it every whole number is a float."""


def toss_identity(body: str, source: str, first_stamp_ns: int, first_poses: Sequence[float] = ()) -> str:
    """The deterministic id of a toss: the same body, source and first stamp always give the same id (DESIGN 3).

    Args:
        body: its name.
        source: where the poses came from.
        first_stamp_ns: header stamp of the first frame [ns].
        first_poses: numbers of the first frames, which count, to 1e-6, where the stamp is no time of the wall clock: then each
            recording may begin with the same stamp.
    """
    told = source
    if first_stamp_ns < FIRST_WALL_TIME_NS:
        told += "".join(f" {abs(value):.6f}" for value in first_poses)  # q and -q are one orientation
    return f"{body}-{first_stamp_ns}-{hashlib.sha256(told.encode()).hexdigest()[:8]}"


def first_stamp_in(toss_id: str) -> int | None:
    """The first stamp [ns] that an id of `toss_identity` holds; None of any other id."""
    stamp = toss_id.rpartition("-")[0].rpartition("-")[2]
    return int(stamp) if stamp.isdecimal() else None


@dataclass(frozen=True, eq=False)
class Toss:
    """A toss of T >= 2 frames; immutable, checked when made.

    Attributes:
        toss_id: deterministic, unique in a pool.
        body: name of the body.
        source: where the poses came from (a topic, a file).
        frame_period: nominal time between frames [s].
        stamps_ns: (T,) int64 header stamps, strictly increasing.
        positions: (T, 3) [m] in the board's frame, z up.
        orientations_wxyz: (T, 4) unit quaternions, body to board.
        linear_velocities: (T, 3) [m/s] in the board's frame.
        angular_velocities: (T, 3) [rad/s] in the body's frame.
    """

    toss_id: str
    body: str
    source: str
    frame_period: float
    stamps_ns: NDArray[np.int64]
    positions: Array
    orientations_wxyz: Array
    linear_velocities: Array
    angular_velocities: Array

    def __post_init__(self) -> None:
        for name, lines in (("toss_id", "of one line"), ("body", "of one line"), ("source", "")):
            text = getattr(self, name)
            if not isinstance(text, str) or (lines and len(text.splitlines()) != 1):
                raise InvalidValueError(name, repr(text), f"a text {lines}".rstrip())
            object.__setattr__(self, name, str.__str__(text))  # NumPy's would change the digest
        stamps = _stamps(self.stamps_ns)
        frames = stamps.size
        if stamps.ndim != 1 or frames < 2:
            raise InvalidValueError("toss stamps", f"shape {stamps.shape}", "(T,) with T >= 2")
        if not np.all(np.diff(stamps) > 0):
            raise InvalidValueError("toss stamps", "stamps that stand still or go back", "strictly increasing stamps")
        period = number("frame_period", self.frame_period)
        if not (np.isfinite(period) and period > 0.0):
            raise InvalidValueError("frame_period", period, "a positive number of seconds")
        object.__setattr__(self, "frame_period", period)
        object.__setattr__(self, "stamps_ns", stamps)
        widths = {"positions": 3, "orientations_wxyz": 4, "linear_velocities": 3, "angular_velocities": 3}
        for name, width in widths.items():
            value = numbers(f"toss {name}", getattr(self, name))
            if value.shape != (frames, width):
                raise InvalidValueError(f"toss {name}", f"shape {value.shape}", f"({frames}, {width})")
            if not np.isfinite(value).all():
                raise InvalidValueError(f"toss {name}", "a value that is not finite", "finite numbers")
            object.__setattr__(self, name, value)
        off = float(np.abs(np.linalg.norm(self.orientations_wxyz, axis=1) - 1.0).max())
        if off > QUATERNION_TOLERANCE:
            raise InvalidValueError("quaternion norm", f"1 {off:+.3g}", f"1 within {QUATERNION_TOLERANCE}")

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Of a pickled or copied toss, whose arrays NumPy makes writable."""
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
        self.__dict__.update(state)

    def __repr__(self) -> str:
        return f"<toss {self.toss_id} of {self.body}: {self.frames} frames in {self.duration:.2f} s>"

    @property
    def frames(self) -> int:
        return int(self.stamps_ns.size)

    @property
    def duration(self) -> float:
        """Time from first to last frame [s]."""
        return float(self.stamps_ns[-1] - self.stamps_ns[0]) / NANOSECONDS

    def digest(self) -> str:
        """SHA-256 over every field: equal tosses have equal digests."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        state = hashlib.sha256()
        for field in fields(self):
            value = getattr(self, field.name)
            state.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
        return state.hexdigest()


def _stamps(value: object) -> NDArray[np.int64]:
    """A copy of stamps that cannot be written to; InvalidValueError where a number is not whole or has over 63 bits.

    Floats from 2^53 on are rounded, and are refused.
    """
    try:
        given = plain(value)
        with np.errstate(invalid="ignore"):
            stamps = frozen(given.astype(np.int64))
    except (TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise InvalidValueError("toss stamps", shortened(value), "whole numbers of nanoseconds") from error
    if not np.array_equal(stamps, given):
        raise InvalidValueError("toss stamps", shortened(value), "whole numbers of nanoseconds below 2^63")
    if given.dtype.kind == "f" and np.abs(given).max(initial=0.0) >= INEXACT_FROM:
        raise InvalidValueError("toss stamps", "floats from 2^53 on, which are rounded", "integers of nanoseconds")
    return stamps


@dataclass(frozen=True, eq=False)
class Rejected:
    """A motion that was rejected, with all that was seen of it.

    Attributes:
        toss: what was recorded.
        reasons: at least one, one line each: what was found and what was expected.
    """

    toss: Toss
    reasons: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.reasons:
            raise InvalidValueError(f"reasons to reject toss {self.toss.toss_id}", "none", "at least one")

    def __repr__(self) -> str:
        return f"<rejected {repr(self.toss)[1:-1]}; {self.reasons[0]}>"
