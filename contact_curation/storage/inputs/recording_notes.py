"""Notes in a recording: the rules by which its tosses were cut, its tracker's noise, and the files from which it was made.

ContactNets' data need the rules: the cube rests 1.2 mm low, and a rest at 0.052 m or higher went unseen when its tosses were
cut (`motion.segmenter_config`). Another reader of the same bag gets the same tosses without further settings. Each number is
noted with the stamp at which the frames made of its file begin, so that a bag of some files still says which toss is the 417th.
"""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from contact_curation.errors import InvalidValueError
from contact_curation.motion.segmenter_config import SegmenterConfig

RULES_NOTE = "contact_curation.segmenter"
UNSET = SegmenterConfig()
"""Rules with default values, which a recording may replace: no rest height, frame period by stamps, noise by poses."""

NOTED = ("rest_height", "frame_period", "tracker_noise")


def note_of_rules(rules: SegmenterConfig) -> dict[str, str]:
    """Makes the note of a recording's rest height [m], frame period [s] and tracker's noise, if they are set."""
    known = {name: (getattr(rules, name), getattr(UNSET, name)) for name in NOTED}
    return {name: repr(value) for name, (value, unset) in known.items() if value != unset}


def with_recorded_rules(rules: SegmenterConfig, note: Mapping[str, str]) -> SegmenterConfig:
    """Completes `rules` with those of a recording; values that the user has set stay.

    Raises:
        InvalidValueError: the note does not contain positive numbers.
    """
    try:
        said = {name: float(value) for name, value in note.items()}
    except ValueError as error:
        raise InvalidValueError(f"note {RULES_NOTE} of the recording", dict(note), "numbers") from error
    taken: dict[str, Any] = {
        name: said[name] for name in NOTED if name in said and getattr(rules, name) == getattr(UNSET, name)
    }
    return replace(rules, **taken)


NUMBERS_NOTE = "contact_curation.numbers"


@dataclass(frozen=True)
class RecordedNumbers:
    """The stamps at which the frames of each file begin.

    Attributes:
        starts_ns: first stamps, ascending [ns].
        numbers: number of the file for each stamp.
    """

    starts_ns: tuple[int, ...] = ()
    numbers: tuple[int, ...] = ()

    def number_at(self, stamp_ns: int) -> int | None:
        """The number of the toss whose first frame has this stamp; None if the recording has no number for it."""
        place = bisect_right(self.starts_ns, stamp_ns) - 1
        return self.numbers[place] if place >= 0 else None

    def note(self) -> dict[str, str]:
        """The numbers as a note of a recording."""
        return {str(number): str(start) for number, start in zip(self.numbers, self.starts_ns, strict=True)}


def number_of_file(name: str) -> int | None:
    """417 for ContactNets' 417.pt; None for other names."""
    stem, _, ending = name.rpartition(".")
    return int(stem) if ending == "pt" and stem.isdecimal() else None


def recorded_numbers(note: Mapping[str, str]) -> RecordedNumbers:
    """Reads the numbers in a recording's note.

    Raises:
        InvalidValueError: the note does not contain stamps by number.
    """
    try:
        pairs = sorted((int(start), int(number)) for number, start in note.items())
    except ValueError as error:
        raise InvalidValueError(f"note {NUMBERS_NOTE} of the recording", "other words", "stamps by number") from error
    return RecordedNumbers(tuple(start for start, _ in pairs), tuple(number for _, number in pairs))
