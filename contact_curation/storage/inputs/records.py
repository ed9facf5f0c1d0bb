"""What reading inputs takes and gives."""

from collections.abc import Generator, Mapping
from dataclasses import dataclass, field

from contact_curation.errors import InvalidValueError
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.inputs.pose_source import PoseTopicConfig
from contact_curation.storage.provenance import TossProvenance


@dataclass(frozen=True)
class InputsConfig:
    """How inputs are read; gravity is the body's.

    Attributes:
        poses: which topics hold the body's poses.
        segmenter: when a motion is a toss.
        gates: what a toss must pass.
        rig: what tracked; it is applied to motions before the quality checks see them.
        as_stored: take ContactNets' files with the random heading and the even stamps that they are stored with. Otherwise
            both are undone (`motion.restored_toss`), so that the files give the tosses of the bag that is made of them.
    """

    poses: PoseTopicConfig = field(default_factory=PoseTopicConfig)
    segmenter: SegmenterConfig = field(default_factory=SegmenterConfig)
    gates: GateConfig = field(default_factory=GateConfig)
    rig: RigCalibration = NO_CORRECTION
    as_stored: bool = False

    def __post_init__(self) -> None:
        if self.as_stored and self.rig != NO_CORRECTION:
            raise InvalidValueError("rig", self.rig, "none here: tosses are taken as stored, with headings that no rig had")


@dataclass(frozen=True)
class Problem:
    """Something that was left out.

    Attributes:
        path: the input.
        what: one line: what was found, what was expected.
    """

    path: str
    what: str

    def __str__(self) -> str:
        return f"{self.path}: {self.what}"


@dataclass(frozen=True)
class InputSummary:
    """One input that was read to its end.

    Attributes:
        path: path as given.
        sha256: SHA-256 digest of its bytes; of several files, of what sha256sum prints for them.
        topic: the pose topic; empty where the input has none.
        first_stamp_ns: stamp [ns] of the body's poses; None where there are none, or no stamps.
        last_stamp_ns: likewise.
        counts: how many "tosses", "rejected", "poses", and poses left out by kind.
        losses: what could not be read of it, one line each.
    """

    path: str
    sha256: str
    topic: str
    first_stamp_ns: int | None
    last_stamp_ns: int | None
    counts: Mapping[str, int]
    losses: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Found:
    """A toss of an input, and where it came from.

    Attributes:
        outcome: the toss, accepted or rejected.
        origin: its recording.
    """

    outcome: Toss | Rejected
    origin: TossProvenance

    @property
    def toss(self) -> Toss:
        return self.outcome.toss if isinstance(self.outcome, Rejected) else self.outcome


InputReading = Generator[Found | Problem, None, InputSummary]
"""What is found in one input; its summary when it is through."""
