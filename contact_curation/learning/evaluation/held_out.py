"""Held-out tosses: neither selection nor training ever uses their motion.

A toss is held out by its number, by its id, or by a digest of its id. None of the three looks at the other tosses, so a toss
that comes later moves no other one across.

The number of a toss is the one that its file is named with, 417 for ContactNets' 417.pt; in a recording it is the toss's place,
from 0, and those that were rejected count too, so that no gate renumbers the others, unless the recording says of which file
it was made (`storage.inputs.recording_notes`): 400-569 are the same tosses in ContactNets' files and in a bag of some of them.

A motion can be in the data twice, under two headings of the board (docs/explanation/data.md). Duplicates are found by what no
heading changes: the heights, and the vertical as the body sees it. A training toss with a duplicate among the held-out ones is
left out of the training, and not the other way round: so the held-out set stays as published, and is never seen.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from math import floor
from typing import NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.toss import Toss

SAME_MOTION = 1e-6
"""Largest difference of duplicates, in m and in directions; the public ones differ by 1e-15, and all others by 0.1 or more."""


type Outline = tuple[float, ...]
"""The number of frames, and the means over the frames of what no heading changes. Duplicates have the same one, nearly."""


class NumberedToss(NamedTuple):
    """A toss and its number; see above."""

    toss: Toss
    number: int


class Duplicate(NamedTuple):
    """Two ids of one motion.

    Attributes:
        left_out: which would have been trained on.
        held_out: which is held out.
    """

    left_out: str
    held_out: str


@dataclass(frozen=True)
class HeldOutRule:
    """The tosses to hold out, named in any of these ways; the empty rule holds nothing out.

    Attributes:
        spans: first and last number, both included.
        ids: of tosses.
        share: of all possible ids, by their digest.
        name: of the option or parameter that says so, for messages.
    """

    spans: tuple[tuple[int, int], ...] = ()
    ids: frozenset[str] = frozenset()
    share: float = 0.0
    name: str = field(default="--held-out", compare=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.share < 1.0:
            raise InvalidValueError("share that is held out", self.share, "a number from 0, below 1")
        for first, last in self.spans:
            if not 0 <= first <= last:
                raise InvalidValueError("numbers that are held out", f"{first}-{last}", "FIRST-LAST with 0 <= FIRST <= LAST")

    def holds_out(self, one: NumberedToss) -> bool:
        """Whether a toss is held out."""
        return self.names(one.toss.toss_id, one.number)

    def names(self, toss_id: str, number: int) -> bool:
        """Whether the toss of an id and a number is held out."""
        return (
            any(first <= number <= last for first, last in self.spans) or toss_id in self.ids or _place_of(toss_id) < self.share
        )


@dataclass(frozen=True, eq=False)
class Split:
    """Training tosses and held-out tosses.

    Attributes:
        training: what selection and training may see.
        held_out: what they never see.
        duplicates: those that are on neither side, and why.
    """

    training: tuple[Toss, ...]
    held_out: tuple[Toss, ...]
    duplicates: tuple[Duplicate, ...] = ()


def toss_number(toss: Toss, place: int) -> int:
    """The number in the name of a toss's file, or its `place` in the recording."""
    name, _, ending = toss.source.rpartition(".")
    return int(name) if ending == "pt" and name.isdecimal() else place


def split(tosses: Sequence[NumberedToss], rule: HeldOutRule, with_duplicates: bool = False) -> Split:
    """Divides tosses; both sides keep their order.

    Args:
        tosses: all there are.
        rule: what is held out.
        with_duplicates: leave duplicates of held-out tosses in the training, as in published results.
    """
    held_out = tuple(one.toss for one in tosses if rule.holds_out(one))
    training = tuple(one.toss for one in tosses if not rule.holds_out(one))
    duplicates = () if with_duplicates else tuple(_duplicates(training, held_out))
    left_out = {duplicate.left_out for duplicate in duplicates}
    return Split(tuple(toss for toss in training if toss.toss_id not in left_out), held_out, duplicates)


def outline_of(toss: Toss) -> Outline:
    """The outline of a toss's motion."""
    q = toss.orientations_wxyz
    (_, wx, wy, _), (_, xx, _, xz), (_, _, yy, yz), _ = (q.T @ q / toss.frames).tolist()  # the means of products
    upwards = (2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy))  # in the body's frame
    return float(toss.frames), float(toss.positions[:, 2].mean()), *upwards


def possible_duplicates(training: Mapping[str, Outline], held_out: Mapping[str, Outline]) -> frozenset[str]:
    """Ids of all tosses, of both sides, whose outlines are those of duplicates; only these tosses have to be compared.

    Args:
        training: outlines by id.
        held_out: outlines by id.
    """
    largest = 2.0 * SAME_MOTION  # means differ by no more than frames, but for rounding
    by_cell: defaultdict[tuple[float, int], list[str]] = defaultdict(list)
    for toss_id, (frames, height, *_) in held_out.items():
        by_cell[frames, floor(height / largest)].append(toss_id)
    found = set[str]()
    for toss_id, own in training.items():
        frames, cell = own[0], floor(own[1] / largest)
        near = [other for k in (cell - 1, cell, cell + 1) for other in by_cell.get((frames, k), ())]
        alike = [other for other in near if all(abs(a - b) < largest for a, b in zip(own, held_out[other], strict=True))]
        found.update(alike, [toss_id] if alike else ())
    return frozenset(found)


def _place_of(toss_id: str) -> float:
    """A number from 0, below 1, that is the same for an id anywhere and as good as random."""
    return int.from_bytes(sha256(toss_id.encode()).digest()[:6]) / 2.0**48


def _duplicates(training: Iterable[Toss], held_out: Iterable[Toss]) -> Iterable[Duplicate]:
    by_frames: defaultdict[int, list[tuple[str, Array]]] = defaultdict(list)
    for toss in held_out:
        by_frames[toss.frames].append((toss.toss_id, _whatever_the_heading(toss)))
    for toss in training:
        duplicate = _duplicate_of(toss, by_frames.get(toss.frames, ()))
        if duplicate is not None:
            yield Duplicate(toss.toss_id, duplicate)


def _duplicate_of(toss: Toss, candidates: Iterable[tuple[str, Array]]) -> str | None:
    """The id of the first candidate of as many frames that is the same motion."""
    own = _whatever_the_heading(toss)
    return next((toss_id for toss_id, other in candidates if np.abs(own - other).max() < SAME_MOTION), None)


def _whatever_the_heading(toss: Toss) -> Array:
    """(T, 4) heights [m], and the direction upwards in the body's frame."""
    upwards = quaternions.rotate(quaternions.conjugate(toss.orientations_wxyz), np.array([0.0, 0.0, 1.0]))
    return np.concatenate([toss.positions[:, 2:], upwards], axis=1)
