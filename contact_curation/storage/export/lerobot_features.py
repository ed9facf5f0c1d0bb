"""What LeRobot is told of a toss's frames: which columns there are, and of what.

observation.state   position (3) [m], orientation wxyz (4), linear velocity (3) [m/s] in the board's frame, angular velocity
                    (3) [rad/s] in the body's, all of the body on the board
stamp_ns            the frame's own stamp: LeRobot's `timestamp` is frame_index / fps
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of

METRES = 1.0

STATE_NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz")

FEATURES: dict[str, dict[str, Any]] = {
    "observation.state": {"dtype": "float32", "shape": [len(STATE_NAMES)], "names": list(STATE_NAMES)},
    "stamp_ns": {"dtype": "int64", "shape": [1], "names": None},
    "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    "frame_index": {"dtype": "int64", "shape": [1], "names": None},
    "episode_index": {"dtype": "int64", "shape": [1], "names": None},
    "index": {"dtype": "int64", "shape": [1], "names": None},
    "task_index": {"dtype": "int64", "shape": [1], "names": None},
}
"""As in meta/info.json; the last five are in every dataset of LeRobot's."""

Columns = dict[str, NDArray[Any]]


def episode_columns(toss: Toss, episode: int, first_index: int, fps: int) -> Columns:
    """The frames of a toss, (T,) or (T, 13) each.

    Args:
        toss: T frames.
        episode: its number.
        first_index: of its first frame among all frames.
        fps: of the dataset.
    """
    frames = np.arange(toss.frames, dtype=np.int64)
    return {
        "observation.state": states_of(toss, METRES).astype(np.float32),
        "stamp_ns": toss.stamps_ns,
        "timestamp": (frames / fps).astype(np.float32),
        "frame_index": frames,
        "episode_index": np.full(toss.frames, episode, dtype=np.int64),
        "index": first_index + frames,
        "task_index": np.zeros(toss.frames, dtype=np.int64),
    }


def frames_table(columns: Mapping[str, NDArray[Any]]) -> pa.Table:
    """The same as a table whose types are those of `FEATURES`."""
    return pa.table([_array(columns[name], about) for name, about in FEATURES.items()], names=list(FEATURES))


def _array(values: NDArray[Any], about: Mapping[str, Any]) -> pa.Array:
    flat = pa.array(values.ravel(), type=pa.from_numpy_dtype(about["dtype"]))
    width = about["shape"][0]
    return flat if width == 1 else pa.FixedSizeListArray.from_arrays(flat, width)
