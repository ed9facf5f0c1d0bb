"""A finished motion is cut out of its run of frames and judged: is it a toss?"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import Quaternion, Vector
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.smoothing import all_around, kinematics, median_orientations, noise_growth
from contact_curation.motion.toss import NANOSECONDS, Toss, toss_identity


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
    positions = np.array([frame.position for frame in run])
    orientations = np.array([frame.orientation_wxyz for frame in run])
    if config.filter_orientations:
        orientations = median_orientations(orientations)
    rates = kinematics(stamps, positions, orientations)
    kept = slice(first, stop)
    toss = Toss(
        toss_id=toss_identity(body, source, int(stamps[first])),
        body=body,
        source=source,
        frame_period=config.frame_period or float(np.median(np.diff(stamps[kept]))) / NANOSECONDS,
        stamps_ns=stamps[kept],
        positions=positions[kept],
        orientations_wxyz=orientations[kept],
        linear_velocities=rates.linear_velocities[kept],
        angular_velocities=rates.angular_velocities[kept],
    )
    return Motion(toss, rates.accelerations[kept])


def reasons_against(motion: Motion, polytope: Polytope, config: SegmenterConfig) -> tuple[str, ...]:
    """Why a motion is no toss, one line each; empty when it is one."""
    toss = motion.toss
    lowest = polytope.corner_heights(toss.positions, toss.orientations_wxyz).min(axis=1)  # (T,)
    reasons = []
    duration = toss.frames * toss.frame_period
    if duration < config.shortest:
        reasons.append(f"duration: found {duration:.3f} s, expected at least {config.shortest:g} s")
    if abs(lowest.min()) > config.lowest_corner:
        expected = f"within {1e3 * config.lowest_corner:g} mm of the board"
        reasons.append(f"lowest corner of the toss: found {1e3 * lowest.min():.1f} mm, expected {expected}")
    excess = np.linalg.norm(motion.accelerations + np.array([0.0, 0.0, config.gravity]), axis=1)  # (T,)
    excess = np.where(all_around(lowest > config.airborne_clearance, 3, 1), excess, 0.0)
    bound = config.airborne_acceleration * noise_growth(toss.frame_period) ** 2
    if excess.max() > bound:
        reasons.append(
            f"acceleration in the air beyond gravity: found {excess.max():.1f} m/s^2 at frame {excess.argmax()}, "
            f"expected at most {bound:.3g} m/s^2"
        )
    return tuple(reasons)
