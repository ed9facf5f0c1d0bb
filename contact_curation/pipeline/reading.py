"""Reading one recording: tosses that may be scored come out one after the other, what else was seen is noted."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from contact_curation.contact.body import Body
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.inputs.inputs import InputsConfig, Problem, open_inputs
from contact_curation.storage.provenance import TossProvenance


@dataclass(frozen=True, eq=False)
class ReadingConfig:
    """How recordings become tosses.

    Attributes:
        body: what was tossed.
        inputs: topics, rules of segmenting, gates.
        held_out: tosses that are kept back though they pass the gates: why, by id.
    """

    body: Body
    inputs: InputsConfig
    held_out: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class SeenToss:
    """What stays of a toss once it is forgotten.

    Attributes:
        toss_id: unique in its recording.
        digest: of its content.
        reasons: why it was kept back; empty when it may be scored.
        frames: how many.
        duration: [s].
        first_stamp_ns: of its first frame.
        last_stamp_ns: of its last frame.
        origin: the file it came from.
    """

    toss_id: str
    digest: str
    reasons: tuple[str, ...]
    frames: int
    duration: float
    first_stamp_ns: int
    last_stamp_ns: int
    origin: TossProvenance


@dataclass(frozen=True)
class Reading:
    """A recording that was read as far as it goes.

    Attributes:
        path: as given.
        sha256: of its bytes; empty when it could not be read to its end.
        seen: its tosses, in order.
        problems: what was left out, one line each, which names the file.
        losses: what could not be read of it, one line each.
        complete: whether it was read to its end.
    """

    path: str
    sha256: str
    seen: tuple[SeenToss, ...]
    problems: tuple[str, ...]
    losses: tuple[str, ...]
    complete: bool

    @property
    def warnings(self) -> tuple[str, ...]:
        """All that is wrong with it, one line each."""
        own = f"{Path(self.path).name}: "  # of a bag that is one file
        return (*self.problems, *(f"{self.path}: {line.removeprefix(own)}" for line in self.losses))


class InputReader:
    """Reads one recording once: iterate over `tosses` to the end, then ask for `reading`."""

    def __init__(self, path: Path, config: ReadingConfig) -> None:
        self._path = path
        self._inputs = open_inputs([path], config.body, config.inputs)
        self._held_out = config.held_out
        self._seen: dict[str, SeenToss] = {}
        self._problems: list[str] = []

    def tosses(self) -> Iterator[Toss]:
        """Those that passed the gates and are not held out."""
        for item in self._inputs:
            if isinstance(item, Problem):
                self._problems.append(str(item))
            elif isinstance(item, Rejected):
                self._note(item.toss, item.reasons)
            elif item.toss_id in self._held_out:
                self._note(item, (self._held_out[item.toss_id],))
            else:
                self._note(item, ())
                yield item

    def reading(self) -> Reading:
        """What was found, once `tosses` came to its end."""
        summary = self._inputs.summaries[0] if self._inputs.summaries else None
        return Reading(
            path=str(self._path),
            sha256=summary.sha256 if summary else "",
            seen=tuple(self._seen.values()),
            problems=tuple(self._problems),
            losses=summary.losses if summary else (),
            complete=summary is not None,
        )

    def _note(self, toss: Toss, reasons: tuple[str, ...]) -> None:
        """A toss of the same id that was kept back before is forgotten."""
        self._seen.pop(toss.toss_id, None)
        first, last = int(toss.stamps_ns[0]), int(toss.stamps_ns[-1])
        self._seen[toss.toss_id] = SeenToss(
            toss.toss_id, toss.digest(), reasons, toss.frames, toss.duration, first, last, self._inputs.origin
        )
