"""The numbers of the files that a bag was made of, kept in the bag itself.

A bag of some files only still says which toss is the 417th: each number with the stamp at which the frames made of its file
begin. A toss has the number of the last file that began before it.
"""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass

from contact_curation.errors import InvalidValueError

NUMBERS_NOTE = "contact_curation.numbers"


@dataclass(frozen=True)
class RecordedNumbers:
    """Where the frames of each file begin.

    Attributes:
        starts_ns: stamps, ascending.
        numbers: of the files, one each.
    """

    starts_ns: tuple[int, ...] = ()
    numbers: tuple[int, ...] = ()

    def number_at(self, stamp_ns: int) -> int | None:
        """The number of a toss whose first frame has this stamp; None where the recording says nothing of it."""
        place = bisect_right(self.starts_ns, stamp_ns) - 1
        return self.numbers[place] if place >= 0 else None

    def note(self) -> dict[str, str]:
        """The note that says it."""
        return {str(number): str(start) for number, start in zip(self.numbers, self.starts_ns, strict=True)}


def number_of_file(name: str) -> int | None:
    """417 for ContactNets' 417.pt; None for other names."""
    stem, _, ending = name.rpartition(".")
    return int(stem) if ending == "pt" and stem.isdecimal() else None


def recorded_numbers(note: Mapping[str, str]) -> RecordedNumbers:
    """What a recording's note says.

    Raises:
        InvalidValueError: the note does not hold stamps by number.
    """
    try:
        pairs = sorted((int(start), int(number)) for number, start in note.items())
    except ValueError as error:
        raise InvalidValueError(f"note {NUMBERS_NOTE} of the recording", "other words", "stamps by number") from error
    return RecordedNumbers(tuple(start for start, _ in pairs), tuple(number for _, number in pairs))
