"""A finding: one thing that evidence shows, how bad it is, and what to do. A diagnosis asks every finding in turn."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from contact_curation.motion.calibration import RigCalibration
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.wording import counted


class Severity(IntEnum):
    """How bad it is: with a fault nothing should be learned from the recordings as they are."""

    FACT = 0
    WARNING = 1
    FAULT = 2


@dataclass(frozen=True)
class Finding:
    """What was found.

    Attributes:
        severity: how bad.
        what: one line: what was found, and where it is a fault what was expected.
        remedy: what to do, one line; empty where nothing is to be done.
        rig: corrects poses; None where that does not mend it.
        settings: other `--set` options that mend it.
        options: of the command that is to be typed next, e.g. ``("--board-frame", "")``.
        other_poses: whether poses are others once it is mended: then no other settings are said, and recordings are to be
            checked again.
    """

    severity: Severity
    what: str
    remedy: str = ""
    rig: RigCalibration | None = None
    settings: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    other_poses: bool = False

    @property
    def line(self) -> str:
        """What was found and what to do."""
        between = " " if self.what.endswith("?") else ": "
        return f"{self.what}{between}{self.remedy}" if self.remedy else self.what


type Find = Callable[[Evidence], Finding | None]
"""Looks for one thing."""


def of_recordings(evidence: Evidence, found: dict[str, str]) -> str:
    """What was found by recording: the line of the first, and how many others have the like."""
    name, line = next(iter(found.items()))
    if len(evidence.recordings) == 1:
        return line
    others = f" (and {counted(len(found) - 1, 'other recording')})" if len(found) > 1 else ""
    return f"{name}{others}: {line}"


def by_recording(evidence: Evidence, line_of: Callable[[Recording], str]) -> dict[str, str]:
    """By name, the lines of those recordings that have one."""
    return {one.name: line for one in evidence.recordings if (line := line_of(one))}
