"""How much poses scatter from frame to frame, told by themselves: by the sixth differences of each half a second.

    sigma = median |6! dt^6 p[t_k-6, ..., t_k]| / (1.538 sqrt(924))     of positions; of orientations twice that of quaternions

p[...] is the divided difference of seven successive poses. White noise makes it sqrt(924) times as large as itself, and whoever
carries a body, a fall, and a turn leave next to nothing of it; 1.538 is the median length of three standard normal numbers.
Impacts and outliers are in few windows. Of the last spans a quarter may scatter less, so that what goes wrong for some seconds
is no noise of the tracker. Differences of exactly nothing are left out: they are poses that were sent twice, or rounded.

Spans are those of the stamps, and what lies before them is forgotten soon: live and in a recording the same poses give the same
noise, although one may have begun a little earlier.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate, pairwise
from math import ceil, comb, factorial, log2, radians, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import Quaternion, Vector
from contact_curation.motion.pose_stream import PoseRun, finite, reading_state, stamped_pose

RIG_NOISE = 2.2e-5
"""Of positions of ContactNets' rig, standard deviation per axis [m] (method.md 3); bounds of segmenter and gates are for it."""

RIG_TURN = radians(0.024)
"""Of its orientations, likewise [rad]."""

SPAN_NS = 500_000_000
"""Length of a span of stamps [ns]."""

KEPT = 32
"""So many last spans count."""

FEWEST = 15
"""Windows of a span; fewer say nothing."""

ORDER, MEDIAN_LENGTH = 6, 1.538172
"""Of differences; the median length of three standard normal numbers."""

EVEN = 1.2
"""Windows whose steps of time differ by a larger factor are left out."""

LOUD = 1.6
"""Times what was expected; from there on tosses are lost (benchmarks/data/tracker_noise.py)."""

MOST = 28.0
"""With more, many tosses are lost whatever is expected, and some begin in the hand."""

SLOWEST = 0.04
"""Windows with a longer step say nothing, since the body's own motion is all that is seen [s]."""

Row = tuple[int, float, float, float, float, float, float, float]


@dataclass(frozen=True)
class TrackerScale:
    """How noisy a tracker's poses are from frame to frame.

    Attributes:
        position: multiple of the noise of positions of ContactNets' rig, at least 1.
        turn: likewise of orientations.
    """

    position: float = 1.0
    turn: float = 1.0

    def at(self, reach: float) -> float:
        """Standard deviation of a vertex so far from the centre [m]."""
        return RIG_NOISE * self.position + RIG_TURN * self.turn * reach


RIG = TrackerScale()
"""ContactNets' rig."""


class PoseNoise:
    """Follows one body's poses in the board's frame."""

    def __init__(self) -> None:
        self._rows: list[Row] = []
        self._spans: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self._whole = False
        self._scale = RIG

    def push(self, stamp_ns: int, position: Vector, orientation_wxyz: Quaternion) -> None:
        """Takes in the next pose, with a later stamp."""
        if self._rows and stamp_ns // SPAN_NS != self._rows[-1][0] // SPAN_NS:
            self._close(_scatter(self._rows))
            self._rows = self._rows[-ORDER:]
        self._rows.append((stamp_ns, *position, *orientation_wxyz))

    def push_run(self, run: PoseRun) -> int:
        """The same for the poses of a run, up to the first one that changes `scale`; returns how many were taken in."""
        known, before = len(self._rows), self._scale
        stamps = np.concatenate([np.array([row[0] for row in self._rows], dtype=np.int64), run.stamps_ns])
        poses = np.concatenate([np.array(self._rows).reshape(-1, 8)[:, 1:], np.hstack([run.positions, run.orientations_wxyz])])
        ends = [end for end in (np.flatnonzero(np.diff(stamps // SPAN_NS)) + 1).tolist() if end >= max(known, 1)]
        parts = list(pairwise((0, *ends)))
        parts = [(max(0, begin - ORDER), end) for begin, end in parts]
        taken, begin = len(stamps), 0
        for (begin, end), found in zip(parts, _scatters(stamps, poses, parts), strict=True):
            self._close(found)
            begin = max(begin, end - ORDER)
            if self._scale != before:
                taken = end + 1
                break
        rows = PoseRun(stamps[begin:taken], poses[begin:taken, :3], poses[begin:taken, 3:]).one_by_one()
        self._rows = [(stamp_ns, *position, *orientation) for stamp_ns, position, orientation in rows]
        return taken - known

    def reset(self) -> None:
        """The next pose has nothing to do with the last one."""
        self._rows, self._whole = [], False

    @property
    def multiple(self) -> float:
        """Of `RIG_NOISE`; 0 where there is too little to say, or poses come too slowly to. Another thread may ask for it."""
        return self._multiples[0]

    @property
    def scale(self) -> TrackerScale:
        """For which bounds may be taken: `RIG` up to `LOUD` times it and over `MOST`, else the next power of the root of 2."""
        return self._scale

    def warning(self, expected_noise: float) -> str:
        """One line where poses scatter by much more than was expected, in multiples of `RIG_NOISE`; else nothing."""
        multiple = self.multiple
        if multiple <= LOUD * expected_noise:
            return ""
        noisy = f"found {scattering(multiple)}, expected {1e3 * RIG_NOISE * expected_noise:.2g} mm"
        remedy = f"say segmenter.tracker_noise={multiple:.1f}" if multiple <= MOST else "smooth them, or take fewer a second"
        return f"{noisy}: tosses may be lost; {remedy}"

    def snapshot(self) -> dict[str, Any]:
        """The state as plain numbers and lists: JSON keeps it exactly."""
        return {"rows": [list(row) for row in self._rows], "spans": [list(span) for span in self._spans], "whole": self._whole}

    def restore(self, snapshot: Mapping[str, Any]) -> None:
        """Takes up the state of `snapshot`.

        Raises:
            InvalidValueError: it is no such state.
        """
        with reading_state("noise", snapshot, "PoseNoise.snapshot"):
            poses = [stamped_pose(row) for row in snapshot["rows"]]
            spans = [(finite(position), finite(turn)) for position, turn in snapshot["spans"]]
            self._whole = bool(snapshot["whole"])
        self._rows = [(stamp_ns, *position, *orientation) for stamp_ns, position, orientation in poses]
        self._spans = deque(spans, maxlen=KEPT)
        self._scale = _scale_for(*self._multiples) if self._spans else RIG

    def _close(self, found: tuple[float, float] | None) -> None:
        """Ends a span with what was found in it; the first one of a stream was not seen whole, and does not count."""
        if self._whole and found is not None:
            self._spans.append(found)
            self._scale = _scale_for(*self._multiples)
        self._whole = True

    @property
    def _multiples(self) -> tuple[float, float]:
        """Of positions and orientations, by the spans; by what there is while there is none."""
        spans = list(self._spans)
        if not spans and (found := _scatter(self._rows.copy())) is not None:  # at once, while another thread takes poses in
            spans = [found]
        if not spans:
            return 0.0, 0.0
        position, turn = (sorted(each)[(len(spans) - 1) // 4] for each in zip(*spans, strict=True))
        return position / RIG_NOISE, turn / RIG_TURN


def spans_of(run: PoseRun) -> list[PoseRun]:
    """A run, cut where its stamps come into another span."""
    cuts = (np.flatnonzero(np.diff(run.stamps_ns // SPAN_NS)) + 1).tolist()
    return [run.part(start, stop) for start, stop in pairwise((0, *cuts, len(run)))]


def scattering(multiple: float) -> str:
    """Positions with so many times the rig's noise, in words."""
    return f"positions that scatter by {1e3 * RIG_NOISE * multiple:.2g} mm from frame to frame"


def _scatter(rows: list[Row]) -> tuple[float, float] | None:
    """Of one span: as `_scatters`."""
    if len(rows) < ORDER + FEWEST:
        return None
    stamps, poses = np.array([row[0] for row in rows]), np.array([row[1:] for row in rows])
    return _scatters(stamps, poses, [(0, len(rows))])[0]


def _scatters(stamps: NDArray[np.int64], poses: Array, parts: list[tuple[int, int]]) -> list[tuple[float, float] | None]:
    """Standard deviations of a position [m] and of a turn [rad] about an axis; None where too few poses are even.

    Args:
        stamps: (N,) [ns].
        poses: (N, 7) positions [m] and orientations.
        parts: first row and the one after the last of each span and of the poses before it that its windows begin with.
    """
    if not parts:
        return []
    rows = np.concatenate([np.arange(begin, end) for begin, end in parts])  # (M,) those of two spans twice
    lengths = [end - begin for begin, end in parts]
    times = 1e-9 * (stamps[rows] - np.repeat(stamps[[begin for begin, _ in parts]], lengths))
    bent = poses[rows]
    bent[1:, 3:] *= np.cumprod(np.where((bent[1:, 3:] * bent[:-1, 3:]).sum(axis=1) < 0.0, -1.0, 1.0))[:, np.newaxis]
    between = times[1:] - times[:-1]
    steps = np.stack([between[k : k + len(times) - ORDER] for k in range(ORDER)])  # (6, M - 6)
    longest = steps.max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # windows over the edge of two spans are left out below
        for order in range(1, ORDER + 1):
            bent = (bent[1:] - bent[:-1]) / (times[order:] - times[:-order])[:, np.newaxis]
        bent = bent * (factorial(ORDER) * steps.mean(axis=0) ** ORDER)[:, np.newaxis]  # (M - 6, 7)
    even = (longest <= SLOWEST) & (longest <= EVEN * steps.min(axis=0)) & np.any(bent[:, :3] != 0.0, axis=1)
    edges = pairwise(accumulate(lengths, initial=0))
    return [_deviations(bent[begin : end - ORDER][even[begin : end - ORDER]]) for begin, end in edges]


def _deviations(bent: Array) -> tuple[float, float] | None:
    """Of a span's windows (N, 7)."""
    return None if len(bent) < FEWEST else (_deviation(bent[:, :3]), 2.0 * _deviation(bent[:, 3:]))


def _deviation(bent: Array) -> float:
    squares = np.sort((bent * bent).sum(axis=1))
    low, high = float(squares[(len(squares) - 1) // 2]), float(squares[len(squares) // 2])
    return 0.5 * (sqrt(low) + sqrt(high)) / (MEDIAN_LENGTH * sqrt(comb(2 * ORDER, ORDER)))


def _scale_for(position: float, turn: float) -> TrackerScale:
    return RIG if max(position, turn) > MOST else TrackerScale(_rounded_up(position), _rounded_up(turn))


def _rounded_up(multiple: float) -> float:
    return 1.0 if multiple <= LOUD else 2.0 ** (0.5 * ceil(2.0 * log2(multiple)))
