"""Configuration and results of reading inputs."""

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
        poses: which topics contain the body's poses.
        segmenter: when a motion is a toss.
        gates: quality checks that a toss must pass.
        rig: rig calibration; it is applied to motions before the quality checks.
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
        what: one line that says what was found and what was expected.
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
        sha256: SHA-256 digest of its bytes; for several files that of sha256sum's output.
        topic: the pose topic; empty if the input has none.
        first_stamp_ns: first stamp of the body's poses [ns]; None if there are no poses or stamps.
        last_stamp_ns: last stamp of the body's poses [ns]; None if there are no poses or stamps.
        counts: numbers of "tosses", "rejected", "poses", and of poses that were left out by kind.
        losses: what could not be read, one line each.
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
    """A toss of an input, and its recording.

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
