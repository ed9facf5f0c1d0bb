"""Poses in arrays, written as a bag: how poses that are no recording yet get to everything that reads recordings."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.numbers import numbers
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.toss import NANOSECONDS
from contact_curation.pipeline.carried_body import GivenBody, body_of
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.datasets.orientations import ROUNDED, of_quaternion
from contact_curation.storage.datasets.pose_bag import PoseWriter
from contact_curation.storage.saved_path import saved_path


def write_poses(
    path: str | Path,
    times: ArrayLike,
    positions: ArrayLike,
    orientations_wxyz: ArrayLike,
    body: GivenBody,
    *,
    overwrite: bool = False,
) -> int:
    """Writes poses over time as the bag that a tracker would have recorded of them, for `check`, `read` and `rank`.

    Args:
        path: of the bag, ``*.mcap``.
        times: (T,) of the poses, from 0 on, ascending [s].
        positions: (T, 3) of the body's frame, z up and 0 on the board [m].
        orientations_wxyz: (T, 4) unit quaternions that take the body's frame to the board's; three decimals will do.
        body: the tracked object, or its file; only its name counts.
        overwrite: whether to replace a file that is there.

    Returns:
        The number of poses written. Poses that are not finite, as where a tracker lost the body, are left out.

    Raises:
        InvalidValueError: shapes that do not go together, times that are negative or do not ascend, quaternions whose length
            is not 1, or a file that must not be replaced or cannot be written.

    Examples:
        >>> times = np.arange(500) / 100.0
        >>> positions = np.tile([0.0, 0.0, 0.0524], (500, 1))  # lies still
        >>> orientations_wxyz = np.tile([1.0, 0.0, 0.0, 0.0], (500, 1))
        >>> cc.write_poses("lying.mcap", times, positions, orientations_wxyz, body)
        500
    """
    given = {"times": times, "positions": positions, "orientations_wxyz": orientations_wxyz}
    stamps, places, turns = (numbers(name, values) for name, values in given.items())
    count = stamps.size
    shapes = {"times": (stamps, (count,)), "positions": (places, (count, 3)), "orientations_wxyz": (turns, (count, 4))}
    for name, (values, shape) in shapes.items():
        if values.shape != shape or not count:
            raise InvalidValueError(name, f"shape {values.shape}", f"{shape}" if count else "at least one pose")
    known = np.isfinite(np.column_stack([stamps, places, turns])).all(axis=1)
    stamps, places, turns = stamps[known], places[known], turns[known]
    stamps_ns = [round(stamp * NANOSECONDS) for stamp in stamps.tolist()]
    for one, after in pairwise(stamps_ns):
        if after <= one:
            found = f"{one / NANOSECONDS:.16g} s and then {after / NANOSECONDS:.16g} s"
            raise InvalidValueError("times", found, "times that ascend, by 1 ns at least")
    if stamps_ns and stamps_ns[0] < 0:
        raise InvalidValueError("times", f"{stamps[0]:.9g} s", "times of at least 0 s")
    off = np.linalg.norm(turns, axis=1) - 1.0
    if np.any(np.abs(off) >= ROUNDED):
        raise InvalidValueError("orientations_wxyz", f"length {1.0 + off[np.abs(off).argmax()]:.4g}", "unit quaternions")
    stamped = (
        (stamp_ns, ScalarPose((x, y, z), of_quaternion(turn)))
        for stamp_ns, (x, y, z), turn in zip(stamps_ns, places.tolist(), turns.tolist())
    )
    with BagWriter(saved_path(path, (".mcap",), overwrite=overwrite)) as bag:
        return PoseWriter(bag, body_of(body)).write(stamped)
