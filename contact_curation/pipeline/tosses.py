"""Reads the tosses of several recordings into memory, each toss once.

A toss that is in several recordings belongs to the first that has it whole (`storage.inputs.known_tosses`). What
streams instead (`pipeline.scoring`, `score`) keeps only what it saw, and merges that by the same rule.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from os import PathLike, fspath
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.files import path_of
from contact_curation.geometry.numbers import shortened
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.held_out import NumberedToss
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.carried_body import GivenBody, body_of
from contact_curation.pipeline.reading import InputReader, Reading, ReadingConfig, numbered
from contact_curation.pipeline.wording import counted_tosses, in_brackets, listed, nothing_found
from contact_curation.pipeline.workers import Advance, each, unheard
from contact_curation.storage.addresses import Address, matching
from contact_curation.storage.inputs.known_tosses import KnownTosses
from contact_curation.storage.provenance import SeenToss, seen_toss

type Inputs = str | PathLike[str] | Sequence[str | PathLike[str]]
"""A recording, several, or a pattern such as ``"bags/*.mcap"``; each a path or an address such as ``"s3://lab/*.mcap"``."""


PATHS_EXPECTED = "paths of recordings, or what `read` gives; `Tosses.of(tosses, body)` is for tosses in memory"

CHECK_SAYS = "at least one; `contact-curation check` says what to do"
"""What is expected where recordings have no toss."""


SAME_PLACE = 7
"""Digits of a mean position [characteristic lengths]: tosses of one length that agree in them are one."""


class Taken(NamedTuple):
    """The toss that counts among those with the same id.

    Attributes:
        recording: its place among the recordings, from 0.
        seen: what is known of it.
    """

    recording: int
    seen: SeenToss


class EachOnce:
    """Decides which of several tosses with the same id counts, over several recordings.

    Attributes:
        taken: by id, in the order of the recordings.
        left_out: what came once more, one line each.
    """

    def __init__(self) -> None:
        self.taken: dict[str, Taken] = {}
        self.left_out: list[str] = []
        self._known = KnownTosses()
        self._recordings = 0

    def takes(self, toss_id: str, digest: str, where: str, *, whole: bool = True) -> bool:
        """Whether a toss is the one of its id from now on; see `KnownTosses.see`."""
        duplicate = self._known.see(toss_id, digest, where, whole=whole)
        if duplicate.left_out:
            self.left_out.append(f"{duplicate.left_out.where}: {duplicate.left_out.why}")
        return duplicate.taken

    def add(self, reading: Reading) -> tuple[str, ...]:
        """Takes note of a recording; returns the lines that `left_out` grew by."""
        before = len(self.left_out)
        for seen in reading.seen:
            if self.takes(seen.toss_id, seen.digest, reading.path, whole=not seen.reasons):
                self.taken.pop(seen.toss_id, None)
                self.taken[seen.toss_id] = Taken(self._recordings, seen)
        self._recordings += 1
        return tuple(self.left_out[before:])


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording that was read into memory.

    Args:
        found: its tosses that count.
        read: what is known of it.
    """

    found: tuple[Toss, ...]
    read: Reading

    def tosses(self) -> Iterator[Toss]:
        """The same as in `InputReader`."""
        return iter(self.found)

    def reading(self) -> Reading:
        """The same as in `InputReader`."""
        return self.read


@dataclass(frozen=True, eq=False)
class Tosses:
    """The tosses of some recordings, each once.

    `len` counts the accepted tosses, and iterating gives them.

    Attributes:
        accepted: those that may be learned from, in the order of the recordings, or best first where they were selected.
        rejected: motions that failed a gate, with the reasons, in the order of the recordings.
        config: how they were read; `config.body` is what was tossed.
        readings: what is known of each recording.
        duplicates: what came once more, one line each.
        warnings: all that is wrong with the recordings, duplicates included, one line each.
        taken: by id, where the accepted and the rejected ones come from.
    """

    accepted: tuple[Toss, ...]
    rejected: tuple[Rejected, ...]
    config: ReadingConfig
    readings: tuple[Reading, ...]
    duplicates: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    taken: Mapping[str, Taken] = field(default_factory=dict)

    @staticmethod
    def of(tosses: Iterable[Toss], body: GivenBody) -> "Tosses":
        """Tosses that came from no recording, such as live ones.

        Args:
            tosses: themselves.
            body: the tossed object, or its file.

        Raises:
            InvalidValueError: no toss, one of another body, or an id twice.
        """
        tosses, body = checked_tosses("tosses", tosses), body_of(body)
        for toss in tosses:
            if toss.body != body.name:
                raise InvalidValueError(f"body of toss {toss.toss_id}", toss.body, body.name)
        ids = [toss.toss_id for toss in tosses]
        if len(set(ids)) < len(ids):
            raise InvalidValueError("tosses", f"{next(i for i in ids if ids.count(i) > 1)} twice", "each once")
        once = EachOnce()
        reading = Reading("", "", numbered(seen_toss(toss) for toss in tosses))
        once.add(reading)
        return Tosses(tosses, (), ReadingConfig(body), (reading,), taken=once.taken)

    @property
    def body(self) -> Body:
        """What was tossed."""
        return self.config.body

    @property
    def ids(self) -> tuple[str, ...]:
        """Of the accepted tosses."""
        return tuple(self.by_id)

    @property
    def by_id(self) -> Mapping[str, Toss]:
        """The accepted tosses by their ids."""
        return MappingProxyType(self._by_id)

    @cached_property
    def _by_id(self) -> dict[str, Toss]:
        return {toss.toss_id: toss for toss in self.accepted}

    @property
    def reasons(self) -> Counter[str]:
        """How many were rejected, by the first reason of each."""
        return Counter(one.reasons[0].partition(":")[0] for one in self.rejected)

    @property
    def paths(self) -> tuple[str, ...]:
        """Of the recordings."""
        return tuple(reading.path for reading in self.readings)

    @property
    def numbered(self) -> list[NumberedToss]:
        """The accepted tosses with their numbers, in the order of their ids."""
        return [NumberedToss(toss, self.taken[toss_id].seen.number) for toss_id, toss in sorted(self.by_id.items())]

    @property
    def in_order_of_ids(self) -> tuple[Toss, ...]:
        """The accepted tosses."""
        return tuple(self.by_id[toss_id] for toss_id in sorted(self.by_id))

    def only(self, ids: Iterable[str]) -> "Tosses":
        """Those of some ids, each once, in the order of the ids.

        Raises:
            InvalidValueError: one is not among the accepted tosses.
        """
        ids = tuple(dict.fromkeys(ids))
        absent = [toss_id for toss_id in ids if toss_id not in self.by_id]
        if absent:
            raise InvalidValueError("tosses", f"no {listed(absent)}", f"ids among the {counted_tosses(len(self))} accepted")
        wanted = set(ids)
        readings = tuple(
            replace(reading, seen=tuple(seen for seen in reading.seen if seen.toss_id in wanted)) for reading in self.readings
        )
        return replace(self, accepted=tuple(self.by_id[toss_id] for toss_id in ids), rejected=(), readings=readings)

    def recordings(self) -> tuple[Recording, ...]:
        """The accepted tosses by the recordings that they count in."""
        found: list[list[Toss]] = [[] for _ in self.readings]
        for toss in self.accepted:
            found[self.taken[toss.toss_id].recording].append(toss)
        return tuple(Recording(tuple(own), reading) for own, reading in zip(found, self.readings, strict=True))

    def check_some(self, found: str) -> "Tosses":
        """The same.

        Raises:
            NothingFoundError: no toss was accepted; the message is what a diagnosis says first, or `found` and the reasons.
        """
        if not self.accepted:
            error = nothing_found(self.paths, self.warnings, f"{found}{in_brackets(self.reasons)}", CHECK_SAYS)
            from contact_curation.pipeline.diagnosis.explained import explained  # a diagnosis needs many modules

            raise explained(error, self.paths, self.config)
        return self

    def __len__(self) -> int:
        return len(self.accepted)

    def __iter__(self) -> Iterator[Toss]:
        return iter(self.accepted)

    def __repr__(self) -> str:
        rejected = f", {len(self.rejected)} rejected{in_brackets(self.reasons)}" if self.rejected else ""
        return f"<{counted_tosses(len(self))} of {self.body.name}{rejected}, {len(self.warnings)} warnings>"


def read_tosses(
    paths: Sequence[Path],
    config: ReadingConfig,
    jobs: int = 1,
    advance: Advance = unheard,
    only: Collection[str] | None = None,
    meant: Mapping[str, str] = MappingProxyType({}),
) -> Tosses:
    """Reads recordings.

    Args:
        paths: perhaps none.
        config: how recordings become tosses.
        jobs: how many processes.
        advance: told how many tosses more were read.
        only: ids of the tosses whose frames are wanted; None for all.
        meant: by id the digest of the recording whose toss is meant, as of a ranking; where one of these recordings has it,
            tosses with that id in others are as if they were not there.
    """
    once, readings, warnings = EachOnce(), list[Reading](), list[str]()
    outcomes: list[dict[str, Toss | Rejected]] = []
    wanted = None if only is None else frozenset(only)
    for own, reading in each(partial(_read, config, wanted), paths, jobs, advance):
        outcomes.append(own)
        readings.append(reading)
    counts = _counting(readings, meant)
    for reading in readings:
        warnings += (*reading.warnings, *once.add(replace(reading, seen=tuple(filter(counts, reading.seen)))))
    found = [outcomes[one.recording].get(toss_id) for toss_id, one in once.taken.items()]
    accepted = tuple(one for one in found if isinstance(one, Toss))
    rejected = tuple(one for one in found if isinstance(one, Rejected))
    return Tosses(accepted, rejected, config, tuple(readings), tuple(once.left_out), tuple(warnings), once.taken)


def _counting(readings: Sequence[Reading], meant: Mapping[str, str]) -> Callable[[SeenToss], bool]:
    """Whether a toss counts; see `read_tosses`."""
    there = {seen.origin.input_sha256 for reading in readings for seen in reading.seen}

    def counts(seen: SeenToss) -> bool:
        digest = meant.get(seen.toss_id, "")
        return digest == seen.origin.input_sha256 or digest not in there

    return counts


def copies_in_words(places: Iterable[tuple[str, int, Array]]) -> tuple[str, ...]:
    """A line on tosses that are there again under another id, as of a recording with other stamps, and count twice, or none.

    Args:
        places: of each toss its id, its length [frames] and its mean position (3,) [characteristic lengths].
    """
    seen: dict[tuple[int, tuple[float, ...]], str] = {}
    again: list[str] = []
    for toss_id, frames, place in places:
        first = seen.setdefault((frames, tuple(np.round(place, SAME_PLACE).tolist())), toss_id)
        again += [f"{toss_id} of {first}"] * (first != toss_id)
    if not again:
        return ()
    which = f"{counted_tosses(len(again))} {'is a copy' if len(again) == 1 else 'are copies'} under another id, {again[0]}"
    return (f"{which}{', ...' if len(again) > 1 else ''}: they count twice; give each recording once",)


def copies_among(tosses: Iterable[Toss], body: Body) -> tuple[str, ...]:
    """A line where some of these tosses are copies of others, or none."""
    return copies_in_words((toss.toss_id, toss.frames, toss.positions.mean(axis=0) / body.length_scale) for toss in tosses)


def evaluation_tosses(name: str, paths: Sequence[Path], config: ReadingConfig) -> tuple[Toss, ...]:
    """The tosses of recordings that a model is evaluated on; none without recordings.

    Raises:
        InvalidValueError: there is no toss in them; `name` is of the parameter or option that gave the recordings.
    """
    read = read_tosses(paths, config)
    if paths and not read.accepted:
        why = read.warnings[0] if read.warnings else f"no toss in {', '.join(map(str, paths))}{in_brackets(read.reasons)}"
        raise InvalidValueError(name, why, "recordings of tosses")
    return read.accepted


def input_paths(inputs: Inputs) -> tuple[Path, ...]:
    """The recordings that are meant; a pattern stands for what matches it, by name. Errors as of `storage.addresses.matching`.

    Raises:
        UnreadableInputError: nothing matches a pattern.
        InvalidValueError: one is no path, or has no name, which would be the current folder.
    """
    several = list(inputs) if isinstance(inputs, Iterable) and not isinstance(inputs, str | PathLike) else [inputs]
    for one in several:
        path_of("inputs", one, PATHS_EXPECTED)
    return tuple(path for one in several for path in ([one] if isinstance(one, Address) else matching(fspath(one))))


def checked_tosses(name: str, given: object) -> tuple[Toss, ...]:
    """The tosses that a user gives; InvalidValueError where something else is among them."""
    several = tuple(given) if isinstance(given, Iterable) else (given,)
    if not all(isinstance(one, Toss) for one in several):
        raise InvalidValueError(name, shortened(repr(given)), "tosses, such as those of `read`")
    return several


def _read(
    config: ReadingConfig, wanted: frozenset[str] | None, path: Path, advance: Advance
) -> tuple[dict[str, Toss | Rejected], Reading]:
    reader = InputReader(path, config)
    found: dict[str, Toss | Rejected] = {}
    for outcome in reader.outcomes():
        rejected = isinstance(outcome, Rejected)
        toss_id = outcome.toss.toss_id if isinstance(outcome, Rejected) else outcome.toss_id
        if wanted is None or toss_id in wanted:
            found[toss_id] = outcome
        advance(0 if rejected else 1)
    return found, reader.reading()
