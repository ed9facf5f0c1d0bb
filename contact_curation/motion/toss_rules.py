"""The rules of a toss: free fall in a stream's last frames begins one; a finished motion is cut out of its run and judged."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import Quaternion, Vector
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration, apply_calibration, calibrated_vectors
from contact_curation.motion.segmenter_config import SegmenterBounds, SegmenterConfig
from contact_curation.motion.smoothing import (
    QUIET_PERIOD,
    all_around,
    clear_steps,
    kinematics,
    median_orientations,
    vertex_travels,
)
from contact_curation.motion.toss import NANOSECONDS, Toss, toss_identity
from contact_curation.motion.transitions import usual_period

MEMORY = 6
"""So many last frames give back the state of a `FallDetector`."""

WIDEST_STRIDE = 7
"""Free fall is looked for in every so many frames at most: from 1050 Hz on noise hides it more and more."""

NEARLY = 0.02
"""So much less than a whole stride will do, so that usual rates, like 300 Hz, are not on the border between two."""


def stride_at(frame_period: float) -> int:
    """Free fall is looked for in every so many frames: at high rates accelerations from one frame to the next are noise."""
    return min(max(int(QUIET_PERIOD / frame_period + NEARLY), 1), WIDEST_STRIDE)


@dataclass(slots=True)
class FallDetector:
    """Vertical velocity and acceleration after frame n of a run without gaps, filtered at any frame rate.

    The median of three looks one frame ahead, so both lag by one frame.

    Attributes:
        frames: taken in so far, counted up to three.
        stamps_ns: of frames n and n - 1.
        height: of frame n [m].
        quotients: difference quotients of frames n and n - 1 [m/s].
        velocity: of frame n - 1 [m/s].
        accelerations: of frames n - 1 and n - 2 [m/s^2].
    """

    frames: int = 0
    stamps_ns: tuple[int, int] = (0, 0)
    height: float = 0.0
    quotients: tuple[float, float] = (0.0, 0.0)
    velocity: float = 0.0
    accelerations: tuple[float, float] = (0.0, 0.0)

    def push(self, stamp_ns: int, height: float) -> None:
        """Takes in frame n."""
        last_ns, older_ns = self.stamps_ns
        if self.frames:
            quotient = (height - self.height) / (stamp_ns - last_ns) * NANOSECONDS
            last, older = self.quotients
            if self.frames == 1:  # the first difference of a run is repeated
                last, self.velocity = quotient, quotient
            else:
                velocity = max(min(last, older), min(max(last, older), quotient))
                acceleration = (velocity - self.velocity) / (last_ns - older_ns) * NANOSECONDS
                self.velocity, self.accelerations = velocity, (acceleration, self.accelerations[0])
            self.quotients = (quotient, last)
        self.frames, self.stamps_ns, self.height = min(self.frames + 1, 3), (stamp_ns, last_ns), height

    def falls(self, gravity: float, tolerance: float, mean_tolerance: float) -> bool:
        """Whether frames n - 2 and n - 1 are in free fall.

        Args:
            gravity: [m/s^2].
            tolerance: each acceleration is under -gravity plus this [m/s^2].
            mean_tolerance: their mean is within this of -gravity [m/s^2].
        """
        later, earlier = self.accelerations
        highest = tolerance - gravity
        return later < highest and earlier < highest and abs(0.5 * (later + earlier) + gravity) < mean_tolerance


FALL_ROUNDING = 1e-6
"""[m/s^2] Accelerations that are calculated over arrays may differ by so much from those of a `FallDetector`, and more."""


def may_fall(
    stamps_ns: NDArray[np.int64], heights: Array, gravity: float, tolerance: float, mean_tolerance: float, stride: int = 1
) -> NDArray[np.bool_]:
    """Where a `FallDetector` of every `stride`-th frame may find free fall; nowhere else does it.

    Args:
        stamps_ns: (MEMORY * stride + N,) of a run.
        heights: (MEMORY * stride + N,) [m].
        gravity: as the others of `FallDetector.falls`, at least what they are at any of these frames.
        tolerance: likewise.
        mean_tolerance: likewise.
        stride: 1 for every frame.

    Returns:
        (N,) for the frames after the first `MEMORY * stride`.
    """
    steps = np.maximum(stamps_ns[stride:] - stamps_ns[:-stride], 1) / NANOSECONDS
    quotients = (heights[stride:] - heights[:-stride]) / steps  # of frames 1, 2, ... in strides
    lower, upper = np.minimum(quotients[stride:], quotients[:-stride]), np.maximum(quotients[stride:], quotients[:-stride])
    velocities = np.maximum(lower[:-stride], np.minimum(upper[:-stride], quotients[2 * stride :]))  # one stride behind
    accelerations = (velocities[stride:] - velocities[:-stride]) / steps[2 * stride : -stride]  # of frames 3, 4, ...
    first = (MEMORY - 4) * stride
    later, earlier = accelerations[first:], accelerations[first - stride : -stride]
    highest = tolerance - gravity + FALL_ROUNDING
    return np.asarray(
        (later < highest) & (earlier < highest) & (np.abs(0.5 * (later + earlier) + gravity) < mean_tolerance + FALL_ROUNDING)
    )


class Frame(NamedTuple):
    """One pose of the body in the board's frame."""

    stamp_ns: int
    position: Vector
    orientation_wxyz: Quaternion


@dataclass(frozen=True, eq=False)
class Motion:
    """A toss to be judged, and what is known of it beyond the record.

    Attributes:
        toss: T frames.
        accelerations: (T, 3) [m/s^2].
    """

    toss: Toss
    accelerations: Array


def cut(run: Sequence[Frame], first: int, stop: int, body: str, source: str, config: SegmenterConfig) -> Motion:
    """The frames `first` to `stop` of a run without gaps, with velocities that have seen the frames around them.

    Args:
        run: successive frames.
        first: index of the first frame.
        stop: index after the last frame, at least two more.
        body: name of the body.
        source: where the poses came from.
        config: for the frame period, and whether orientations are filtered.
    """
    stamps = np.array([frame.stamp_ns for frame in run], dtype=np.int64)
    positions = _table([frame.position for frame in run], 3)
    orientations = _table([frame.orientation_wxyz for frame in run], 4)
    if config.filter_orientations:
        orientations = median_orientations(orientations)
    kept = slice(first, stop)
    frame_period = config.frame_period or usual_period(np.diff(stamps[kept]) / NANOSECONDS)
    rates = kinematics(stamps, positions, orientations, frame_period)
    beginning = [value for frame in run[first : first + 2] for value in (*frame.position, *frame.orientation_wxyz)]
    toss = Toss(
        toss_id=toss_identity(body, source, int(stamps[first]), beginning),
        body=body,
        source=source,
        frame_period=frame_period,
        stamps_ns=stamps[kept],
        positions=positions[kept],
        orientations_wxyz=orientations[kept],
        linear_velocities=rates.linear_velocities[kept],
        angular_velocities=rates.angular_velocities[kept],
    )
    return Motion(toss, rates.accelerations[kept])


def _table(rows: Sequence[Sequence[float]], width: int) -> Array:
    """(T, width) numbers of T rows; `np.array` would first look at each for its shape."""
    return np.fromiter(chain.from_iterable(rows), dtype=float, count=width * len(rows)).reshape(-1, width)


def reasons_against(
    motion: Motion, polytope: Polytope, bounds: SegmenterBounds, rig: RigCalibration = NO_CORRECTION
) -> tuple[str, ...]:
    """Why a motion is no toss once its rig is corrected, one line each; empty when it is one."""
    toss = apply_calibration(motion.toss, rig)
    lowest = polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1)  # (T,)
    reasons = []
    duration = toss.duration + toss.frame_period
    if duration < bounds.shortest:
        reasons.append(f"duration: found {duration:.4f} s, expected at least {bounds.shortest:.4f} s")
    if abs(lowest.min()) > bounds.lowest_corner:
        expected = f"within {1e3 * bounds.lowest_corner:.3g} mm of the board"
        reasons.append(f"lowest corner of the toss: found {1e3 * lowest.min():.1f} mm, expected {expected}")
    accelerations = calibrated_vectors(motion.accelerations, rig)
    excess = quaternions.lengths(accelerations + np.array([0.0, 0.0, bounds.gravity]))  # (T,)
    clear = np.append(clear_steps(lowest, vertex_travels(toss, bounds.reach)), True)  # (T,)
    airborne = all_around(lowest > bounds.airborne_clearance, 3, 1) & all_around(clear, 3, 0)
    excess = np.where(airborne, excess, 0.0)
    bound = bounds.airborne_bound(toss.frame_period)
    if excess.max() > bound:
        reasons.append(
            f"acceleration in the air beyond gravity: found {excess.max():.1f} m/s^2 at frame {excess.argmax()}, "
            f"expected at most {bound:.3g} m/s^2"
        )
    return tuple(reasons)
