"""`check`: one line of verdict, the reasons, the settings that mend what was found, and the command to type next."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from contact_curation.configs import whole_number
from contact_curation.errors import InvalidValueError
from contact_curation.files import as_word
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.pipeline.diagnosis.evidence import Evidence
from contact_curation.pipeline.diagnosis.finding import Finding, Severity
from contact_curation.pipeline.diagnosis.findings import FINDINGS
from contact_curation.pipeline.diagnosis.recording import Recording, read_recording
from contact_curation.pipeline.reading import ReadingConfig, settings_of
from contact_curation.pipeline.workers import Advance, each, unheard

MOST_MESSAGES = 20_000
"""With the object's pose, of all recordings together: some 135 s at 148 Hz, and a few seconds of work."""

FEWEST_MESSAGES = 2_000
"""Of each recording, however many there are."""

COMMAND = "contact-curation"

MOST_SHOWN = 8
"""Inputs that the next command names; of more it says INPUTS."""


@dataclass(frozen=True)
class Diagnosis:
    """A diagnosis of recordings. `print` shows it, `document()` gives it to programs.

    Attributes:
        verdict: one line: what is wrong first of all, or that nothing is.
        ok: whether tosses can be learned from as the recordings are.
        reasons: all that was found, one line each, faults first.
        settings: `--set` options that mend what settings can mend; empty where there are none.
        next: the command to type next; empty where no recording can be read.
        warnings: what was assumed, one line each; no part of the document.
    """

    verdict: str
    ok: bool
    reasons: tuple[str, ...]
    settings: str
    next: str
    warnings: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """For programs."""
        found = {**asdict(self), "reasons": list(self.reasons)}
        del found["warnings"]
        return found

    def __repr__(self) -> str:
        return f"<{self.verdict}>"

    def __str__(self) -> str:
        mends = [f"settings: {self.settings}"] if self.settings else []
        commands = [f"next: {self.next}"] if self.next else []
        return "\n".join([self.verdict, *(f"  {line}" for line in self.reasons), *mends, *commands])


def diagnose(
    paths: Sequence[Path],
    config: ReadingConfig,
    *,
    words: Sequence[str] = (),
    given: Sequence[object] = (),
    most_messages: int = MOST_MESSAGES,
    advance: Advance = unheard,
) -> Diagnosis:
    """Reads recordings, as far as `most_messages` goes, and says what is wrong with them.

    Args:
        paths: at least one.
        config: how they are read, the gates included.
        words: options that were given, for the next command.
        given: what was given for the paths, for the next command: perhaps patterns.
        most_messages: with the object's pose, in all; of each recording at least `FEWEST_MESSAGES`.
        advance: told of each recording that was read.

    Raises:
        InvalidValueError: there is no recording, or `most_messages` is no whole number of at least 1.
    """
    if not paths:
        raise InvalidValueError("inputs", "none", "at least one recording")
    whole_number("most_messages", most_messages, 1)
    share = min(max(FEWEST_MESSAGES, most_messages // len(paths)), sys.maxsize)
    recordings = tuple(each(partial(_read, config, share), list(paths), 1, advance))
    return concluded(Evidence(config, recordings), words, given)


def _read(config: ReadingConfig, most_messages: int, path: Path, advance: Advance) -> Recording:
    found = read_recording(path, config, most_messages)
    advance(1)
    return found


def concluded(evidence: Evidence, words: Sequence[str] = (), given: Sequence[object] = ()) -> Diagnosis:
    """What the findings of some evidence come to; `words` and `given` as of `diagnose`."""
    found = [one for find in FINDINGS if (one := find(evidence)) is not None]
    ordered = sorted(found, key=lambda one: -one.severity)  # stable: causes stand before what follows from them
    worst = ordered[0]
    ok = worst.severity < Severity.FAULT
    settings = _settings([worst] if worst.other_poses else ordered, evidence.config.inputs.rig)
    verdict = worst.line if worst.severity == Severity.FAULT else _sound(evidence, worst)
    reasons = tuple(one.line for one in ordered if one is not worst or ok)
    paths = given or [one.path for one in evidence.recordings]
    readable = any(not one.unreadable for one in evidence.recordings)
    command = _next(ordered, ok, paths, words, settings) if readable else ""
    return Diagnosis(_one_line(verdict), ok, tuple(map(_one_line, reasons)), settings, command)


def _sound(evidence: Evidence, worst: Finding) -> str:
    count = f"{len(evidence.tosses)} of {len(evidence.outcomes)}" if evidence.rejected else f"all {len(evidence.tosses)}"
    said = f"ok: {count} motions are sound tosses of {evidence.body.name}"
    return f"{said}, but {worst.line}" if worst.severity == Severity.WARNING else said


def _settings(found: Sequence[Finding], current: RigCalibration) -> str:
    """All `--set` options; those of the rig only where no correction is in use already, which they would replace."""
    rigs = [one.rig for one in found if one.rig is not None]
    said = [settings_of(rigs[0])] if rigs and current == NO_CORRECTION else []
    said += [f"--set {setting}" for one in found for setting in one.settings]
    return " ".join(dict.fromkeys(part for part in said if part))


def _next(found: Sequence[Finding], ok: bool, paths: Sequence[object], words: Sequence[str], settings: str) -> str:
    """What to type: rank what is sound or can be mended, check again what has another remedy."""
    faults = [one for one in found if one.severity == Severity.FAULT]
    mended = bool(faults) and all((one.rig is not None or one.settings) and not one.other_poses for one in faults[:1])
    options = next((one.options for one in faults or found if one.options), ())
    verb = ["rank"] if ok or (mended and not options) else ["check"]
    shown = [as_word(path) for path in paths] if len(paths) <= MOST_SHOWN else ["INPUTS"]
    end = ["--out", "ranked.csv"] if verb == ["rank"] else []
    line = shlex.join([COMMAND, *verb, *shown, *words, *options])
    return " ".join(part for part in (line, settings, shlex.join(end)) if part)


def _one_line(text: str) -> str:
    return " ".join(text.split())
