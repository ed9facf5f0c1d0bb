"""The manifest of a ranking: every toss with its rank and the evidence for it, or with the reason why it has none."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from contact_curation.errors import InvalidValueError
from contact_curation.storage.provenance import RunProvenance

type Diagnostic = bool | int | float | str | list[Diagnostic] | dict[str, Diagnostic] | None


@dataclass(frozen=True, slots=True)
class ManifestRow:
    """One toss.

    Attributes:
        toss_id: id, unique in the manifest.
        selected: whether it is one of the best k.
        rejected: whether a quality check rejected it, or it was held out, so that it was not ranked.
        reasons: why it was rejected, held out or not scored, one line each.
        rank: place in the ranking, from 1; None if it was not ranked.
        score: score of the toss alone, by the criterion; None if it was not ranked.
        marginal_gain: gain when it was picked, or the gain of adding it to the selected ones; None if it was not ranked.
        trace: trace of its Fisher matrix; None if it was not scored.
        mean_loss: mean loss of its scored transitions; None if it was not scored.
        transitions: number of its transitions; None if it was not scored.
        not_scored: number of its transitions without a certified impulse; None if it was not scored.
        frames: number of its poses.
        duration: time from the first to the last frame [s].
        input: path of its recording.
        input_sha256: SHA-256 digest of the recording.
        topic: its pose topic; empty if the input has none.
        first_stamp_ns: header stamp of its first frame [ns].
        last_stamp_ns: header stamp of its last frame [ns].
    """

    toss_id: str
    selected: bool
    rejected: bool
    reasons: tuple[str, ...]
    rank: int | None
    score: float | None
    marginal_gain: float | None
    trace: float | None
    mean_loss: float | None
    transitions: int | None
    not_scored: int | None
    frames: int
    duration: float
    input: str
    input_sha256: str
    topic: str
    first_stamp_ns: int
    last_stamp_ns: int

    def __post_init__(self) -> None:
        if self.selected and (self.rejected or self.rank is None):
            raise InvalidValueError(
                f"selected of toss {self.toss_id}", "True", "False for a toss that is rejected or has no rank"
            )
        if (self.rejected or self.rank is None) and not self.reasons:
            raise InvalidValueError(f"reasons of toss {self.toss_id}", "none", "at least one for a toss that was not ranked")


@dataclass(frozen=True)
class Manifest:
    """All tosses of the inputs, also those that were rejected.

    Attributes:
        run: how the ranking was made.
        rows: one row per toss, by rank, and then those without one in the order in which they were read.
        diagnostics: properties of the selection by name: epsilon, smallest sufficient k, efficiency certificate, block shares.
    """

    run: RunProvenance
    rows: tuple[ManifestRow, ...]
    diagnostics: Mapping[str, Diagnostic] = field(default_factory=dict)

    def __post_init__(self) -> None:
        counts = Counter(row.toss_id for row in self.rows)
        if len(counts) != len(self.rows):
            raise InvalidValueError("manifest", f"toss {counts.most_common(1)[0][0]} twice", "each toss once")

    @cached_property
    def selected(self) -> tuple[ManifestRow, ...]:
        """The selected tosses, best first."""
        return tuple(sorted((row for row in self.rows if row.selected), key=lambda row: row.rank or 0))

    def given_input(self, row: ManifestRow) -> str:
        """The recording of a toss as it was given: for one of ContactNets' files perhaps the folder that it is in."""
        if row.input in self._given:
            return row.input
        return next((folder for folder in map(str, Path(row.input).parents) if folder in self._given), row.input)

    @cached_property
    def _given(self) -> frozenset[str]:
        return frozenset(one.path for one in self.run.inputs)
