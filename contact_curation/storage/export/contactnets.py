"""Exports selected tosses in the format of ContactNets' repository: tosses_processed/N.pt, in the order of the ranking.

A file is one float64 tensor (1, T, 19) with the columns of `storage.datasets.contactnets`. A toss that came from such a file is
copied byte for byte, unless a rig calibration was applied. Any other toss is written in the frame in which it was tracked,
without a random heading.
"""

import shutil
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.restored_toss import JITTER
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.motion.transitions import states_of
from contact_curation.storage.datasets.contactnets import COLUMNS, CONTROL, FRAME_RATE, SUBFOLDER, of_tracked_frame
from contact_curation.storage.export.selected import SelectedToss

LARGEST_RATE_ERROR = 0.01
"""Largest relative error of a toss's frame rate; the files do not contain their rate, so all are read with the same one."""


def write_contactnets(tosses: Sequence[SelectedToss], body: Body, folder: Path, *, copied: bool = True) -> None:
    """Writes N.pt for the N-th toss, from 0.

    Args:
        tosses: tosses, best first.
        body: tossed body; its length scale is the files' unit of length.
        folder: folder to write to.
        copied: whether tosses that came from such files are copied; False if a calibration was applied.

    Raises:
        InvalidValueError: a toss has another frame rate than ContactNets' files, or its frames are not evenly spaced.
    """
    target = folder / SUBFOLDER
    target.mkdir()
    for number, selected in enumerate(tosses):
        file = target / f"{number}.pt"
        if copied and selected.origin.input.endswith(".pt"):
            shutil.copyfile(selected.origin.input, file)
        else:
            _write_rows(contactnets_rows(selected.toss, body), file)


def contactnets_rows(toss: Toss, body: Body) -> Array:
    """The rows (T, 19) of a toss, of the frame that a tracker follows, with lengths in the body's length scale.

    Raises:
        InvalidValueError: the toss has another frame rate than ContactNets' files, or its frames are not evenly spaced.
    """
    rate = 1.0 / toss.frame_period
    if abs(rate / FRAME_RATE - 1.0) > LARGEST_RATE_ERROR:
        expected = f"{FRAME_RATE:g} Hz, as which ContactNets' files are read; --format lerobot takes other rates"
        raise InvalidValueError(f"frame rate of toss {toss.toss_id}", f"{rate:.4g} Hz", expected)
    steps = FRAME_RATE * np.diff(toss.stamps_ns) / NANOSECONDS  # in frame periods
    if (off := np.abs(steps - 1.0)).max() > JITTER:
        found, expected = f"{steps[off.argmax()]:.3g} frame periods", "1: these files have no stamps; --format lerobot has them"
        raise InvalidValueError(f"time between frames of toss {toss.toss_id}", found, expected)
    states = states_of(of_tracked_frame(toss, body), body.length_scale)
    return np.concatenate([states, np.zeros((toss.frames, COLUMNS - CONTROL.start))], axis=1)


def _write_rows(rows: Array, file: Path) -> None:
    import torch  # here, because it takes over a second and other exports do not need it

    content = BytesIO()  # torch hides the system's error for a full disk
    torch.save(torch.from_numpy(rows[np.newaxis].copy()), content)
    file.write_bytes(content.getvalue())
