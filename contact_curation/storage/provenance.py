"""Where a toss and a ranking came from, byte for byte."""

from dataclasses import dataclass
from typing import Any

from contact_curation.motion.toss import Toss


@dataclass(frozen=True)
class TossProvenance:
    """The recording a toss was cut from.

    Attributes:
        input: path of the bag or file; empty for a toss that came live.
        input_sha256: SHA-256 digest of its bytes (`BagReader.sha256`); empty for a toss that came live.
        topic: the pose topic; empty where the input has none.
        number: number of the file that the recording was made of; None where it does not say.
    """

    input: str = ""
    input_sha256: str = ""
    topic: str = ""
    number: int | None = None


@dataclass(frozen=True, slots=True)
class SeenToss:
    """What stays of a toss once it is forgotten.

    Attributes:
        toss_id: unique in its recording.
        digest: digest of its content.
        reasons: why it was rejected; empty when it may be scored.
        frames: how many.
        duration: [s].
        first_stamp_ns: stamp [ns] of its first frame.
        last_stamp_ns: stamp [ns] of its last frame.
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


def seen_toss(toss: Toss, reasons: tuple[str, ...] = (), origin: TossProvenance | None = None) -> SeenToss:
    """What stays of a toss."""
    first, last = int(toss.stamps_ns[0]), int(toss.stamps_ns[-1])
    where = origin or TossProvenance()
    return SeenToss(toss.toss_id, toss.digest(), reasons, toss.frames, toss.duration, first, last, where)


@dataclass(frozen=True)
class InputProvenance:
    """One recording that was read.

    Attributes:
        path: path as given.
        sha256: SHA-256 digest of its bytes.
        losses: what could not be read of it, one line each (`BagReader.losses`).
    """

    path: str
    sha256: str
    losses: tuple[str, ...] = ()


@dataclass(frozen=True)
class RunProvenance:
    """How a ranking was made: with the inputs, enough to make it again.

    Attributes:
        criterion: criterion of the ranking, e.g. "log-det".
        estimator: "empirical" or "gauss-newton"; empty where the criterion needs none.
        influence_bound: losses above this were scaled down to it; inf when unbounded.
        model: what the parameters parameterise, e.g. "polytope".
        parameters: where they came from: a file, or how they were set.
        parameters_version: digest of their values.
        seed: random seed.
        package_version: version of this package.
        command: the command line, word by word; empty when the library was called.
        inputs: the recordings, in the order they were read.
        body: what was tossed, as `Body.to_mapping` gives it; None where that is not known.
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
