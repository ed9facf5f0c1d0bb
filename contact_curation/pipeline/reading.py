"""Reads one recording as a stream of motions, and remembers a summary of each one."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from contact_curation.configs import field_of, kind_in_words, truth_value, with_fields
from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.numbers import shortened
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.storage.inputs.inputs import InputsConfig, Problem, open_inputs
from contact_curation.storage.provenance import SeenToss, seen_toss


@dataclass(frozen=True, eq=False)
class ReadingConfig:
    """How recordings become tosses.

    Attributes:
        body: what was tossed.
        inputs: topics, rules of segmenting, gates.
    """

    body: Body
    inputs: InputsConfig = field(default_factory=InputsConfig)


def inputs_config(given: InputsConfig | Mapping[str, object] | None) -> InputsConfig:
    """The configuration, the default one for None, or that with some fields changed by their paths, as `--set` names them.

    Raises:
        InvalidValueError: it is something else, or a path or a value is not accepted.
    """
    if given is None or isinstance(given, InputsConfig):
        return given or InputsConfig()
    if not isinstance(given, Mapping):
        raise InvalidValueError("config", shortened(repr(given)), "settings such as {'gates.depth': 0.01}, or an InputsConfig")
    config = InputsConfig()
    values = {field_of(config, path).path: tuple(value) if isinstance(value, list) else value for path, value in given.items()}
    for path, value in values.items():
        default = field_of(config, path).default
        if isinstance(default, str) and not isinstance(value, str):
            raise InvalidValueError(path, shortened(repr(value)), "a text")
        if isinstance(default, bool):
            values[path] = truth_value(path, value)
        elif isinstance(default, Enum):
            values[path] = _choice(path, type(default), value)
    try:
        return with_fields(config, values)
    except (TypeError, ValueError, OverflowError) as error:
        raise InvalidValueError("config", shortened(given), "values of the types that docs/ros/reference.md has") from error


def _choice(path: str, kind: type[Enum], value: object) -> Enum:
    """The member of an enumeration that a value is, or is the name of, as `--set` takes it."""
    try:
        return kind(value)
    except ValueError as error:
        raise InvalidValueError(path, shortened(repr(value)), kind_in_words(kind)) from error


@dataclass(frozen=True)
class Reading:
    """Summary of a recording that was read as far as possible.

    Attributes:
        path: as given; empty for tosses that came from no recording.
        sha256: of its bytes; empty when it could not be read to its end.
        seen: its tosses, in order.
        problems: what was left out, one line each, which names the file.
        losses: what could not be read of it, one line each.
        complete: whether it was read to its end.
    """

    path: str
    sha256: str
    seen: tuple[SeenToss, ...]
    problems: tuple[str, ...] = ()
    losses: tuple[str, ...] = ()
    complete: bool = True

    @property
    def warnings(self) -> tuple[str, ...]:
        """The problems of the recording, one line each."""
        own = f"{Path(self.path).name}: "  # of a bag that is one file
        return (*self.problems, *(f"{self.path}: {line.removeprefix(own)}" for line in self.losses))

    def without(self, reasons: Mapping[str, str]) -> "Reading":
        """The same, but accepted tosses that have a reason are rejected for it.

        Args:
            reasons: by id.
        """
        seen = (
            replace(one, reasons=(reasons[one.toss_id],)) if one.toss_id in reasons and not one.reasons else one
            for one in self.seen
        )
        return replace(self, seen=tuple(seen))


class InputReader:
    """Reads one recording once: iterate over `outcomes` or `tosses` to the end, then ask for `reading`."""

    def __init__(self, path: Path, config: ReadingConfig) -> None:
        self._path = path
        self._inputs = open_inputs([path], config.body, config.inputs)
        self._seen: dict[str, SeenToss] = {}
        self._problems: list[str] = []

    def outcomes(self) -> Iterator[Toss | Rejected]:
        """Iterates over all motions; a second one with the same id replaces the first."""
        for item in self._inputs:
            if isinstance(item, Problem):
                self._problems.append(str(item))
                continue
            toss, reasons = (item.toss, item.reasons) if isinstance(item, Rejected) else (item, ())
            self._seen.pop(toss.toss_id, None)
            self._seen[toss.toss_id] = seen_toss(toss, reasons, self._inputs.origin)
            yield item

    def tosses(self) -> Iterator[Toss]:
        """Iterates over the tosses that passed the gates."""
        return (item for item in self.outcomes() if isinstance(item, Toss))

    def reading(self) -> Reading:
        """The summary of the recording, available after the last toss."""
        summary = self._inputs.summaries[0] if self._inputs.summaries else None
        return Reading(
            path=str(self._path),
            sha256=summary.sha256 if summary else "",
            seen=numbered(self._seen.values()),
            problems=tuple(self._problems),
            losses=summary.losses if summary else (),
            complete=summary is not None,
        )


def numbered(seen: Iterable[SeenToss]) -> tuple[SeenToss, ...]:
    """The motions of a recording; the number of one that has none is its place, from 0."""
    return tuple(replace(one, number=place) if one.number < 0 else one for place, one in enumerate(seen))


def settings_of(rig: RigCalibration) -> str:
    """A rig's calibration in the words of `--set`, to 1e-5 and a tenth of a millimetre; nothing where nothing is corrected.

    Angles of the marker are in radians; what is as by default is left out, but for the board, which is said whole.
    """
    said: list[str] = []
    if (rig.normal, rig.centre, rig.scale) != (NO_CORRECTION.normal, NO_CORRECTION.centre, NO_CORRECTION.scale):
        said += [f"normal={_numbers(rig.normal, 5)}", f"centre={_numbers(rig.centre, 4)}", f"scale={rig.scale:.5f}"]
    if rig.height:
        said.append(f"height={rig.height:.5f}")
    if any(rig.marker_turn):
        said.append(f"marker_turn={_numbers(rig.marker_turn, 5)}")
    if any(rig.marker_offset):
        said.append(f"marker_offset={_numbers(rig.marker_offset, 5)}")
    return " ".join(f"--set rig.{each}" for each in said)


def center_of_mass_option(center: Sequence[float] | Array) -> str:
    """The option that says where the centre of mass (3,) is [m]: one word, as its first number may be negative."""
    return f"--center-of-mass={_numbers(center, 4)}"


def _numbers(values: Sequence[float] | Array, digits: int) -> str:
    return ",".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values)
