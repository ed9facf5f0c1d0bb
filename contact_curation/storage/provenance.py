"""Provenance of tosses and rankings: recordings with their digests, and how a ranking was made."""

from dataclasses import dataclass
from typing import Any

from contact_curation.learning.evaluation.held_out import Outline, outline_of, toss_number
from contact_curation.motion.toss import Toss


@dataclass(frozen=True)
class TossProvenance:
    """The recording from which a toss was cut.

    Attributes:
        input: path of the bag or file; empty for a live toss.
        input_sha256: SHA-256 digest of its bytes (`BagReader.sha256`); empty for a live toss.
        topic: the pose topic; empty if the input has none.
        number: number of the file from which the recording was made; None if it is not known.
    """

    input: str = ""
    input_sha256: str = ""
    topic: str = ""
    number: int | None = None


@dataclass(frozen=True, slots=True)
class SeenToss:
    """Summary of a toss whose poses are no longer in memory.

    Attributes:
        toss_id: id, unique in its recording.
        digest: digest of its content.
        reasons: why it was rejected; empty if it may be scored.
        frames: number of frames.
        duration: time from the first to the last frame [s].
        first_stamp_ns: stamp of its first frame [ns].
        last_stamp_ns: stamp of its last frame [ns].
        origin: its recording.
        number: by which it can be held out; -1 for a live toss, and for a toss of a recording until its place is known.
        outline: of its motion (`learning.evaluation.held_out`); empty for a live toss.
    """

    toss_id: str
    digest: str
    reasons: tuple[str, ...]
    frames: int
    duration: float
    first_stamp_ns: int
    last_stamp_ns: int
    origin: TossProvenance
    number: int = -1
    outline: Outline = ()


def seen_toss(toss: Toss, reasons: tuple[str, ...] = (), origin: TossProvenance | None = None) -> SeenToss:
    """Makes the summary of a toss."""
    first, last = int(toss.stamps_ns[0]), int(toss.stamps_ns[-1])
    where = origin or TossProvenance()
    number = toss_number(toss, -1) if where.number is None else where.number
    return SeenToss(
        toss.toss_id, toss.digest(), reasons, toss.frames, toss.duration, first, last, where, number, outline_of(toss)
    )


@dataclass(frozen=True)
class InputProvenance:
    """One recording that was read.

    Attributes:
        path: path as given.
        sha256: SHA-256 digest of its bytes, of several files that of their digests and names, on a server a digest of size and
            ETag; empty if it could not be read.
        losses: what could not be read, one line each.
    """

    path: str
    sha256: str
    losses: tuple[str, ...] = ()


@dataclass(frozen=True)
class RunProvenance:
    """How a ranking was made; with the inputs it is enough to repeat the ranking.

    Attributes:
        criterion: criterion of the ranking, e.g. "log-det".
        estimator: "empirical" or "gauss-newton"; empty if the criterion needs none.
        influence_bound: larger losses count as this value; inf for no bound.
        model: kind of the model, e.g. "polytope".
        parameters: source of the parameters: a file, or how they were set.
        parameters_version: digest of their values.
        seed: random seed.
        package_version: version of this package.
        command: the command line, word by word; empty if the library was called.
        inputs: the recordings, in the order in which they were read.
        body: tossed body, as `Body.to_mapping` gives it; None if it is not known.
        settings: of reading, loss and ranking, where they are not the defaults, as `--set` takes them; empty for a ranking by
            nodes.
    """

    criterion: str
    estimator: str
    influence_bound: float
    model: str
    parameters: str
    parameters_version: str
    seed: int
    package_version: str
    command: tuple[str, ...]
    inputs: tuple[InputProvenance, ...]
    body: dict[str, Any] | None = None
    settings: tuple[str, ...] = ()
