"""The tosses of several recordings, each once and with its number, before they are divided by what is held out."""

from collections import Counter
from collections.abc import Mapping, Sequence

from contact_curation.cli.report import counted_tosses
from contact_curation.errors import InvalidValueError
from contact_curation.learning.evaluation.held_out import HeldOutRule, NumberedToss, toss_number
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.reading import Reading
from contact_curation.storage.inputs.known_tosses import KnownTosses

LISTED = 3
"""Ids that fit a line."""


class NumberedPool:
    """Tosses, and what was wrong with the others.

    Attributes:
        warnings: one line each.
    """

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self._known = KnownTosses()
        self._tosses: dict[str, NumberedToss] = {}
        self._reasons: dict[str, str] = {}

    @property
    def tosses(self) -> list[NumberedToss]:
        """Those that passed the gates, in the order of their ids."""
        return sorted(self._tosses.values(), key=lambda one: one.toss.toss_id)

    @property
    def reasons(self) -> Counter[str]:
        """How many were kept back, by reason."""
        return Counter(reason for toss_id, reason in self._reasons.items() if toss_id not in self._tosses)

    def add(self, found: Mapping[str, Toss], reading: Reading) -> None:
        """One recording more."""
        self.warnings += reading.warnings
        for place, seen in enumerate(reading.seen):
            standing = self._known.see(seen.toss_id, seen.digest, reading.path, whole=not seen.reasons)
            if standing.left_out:
                self.warnings.append(f"{standing.left_out.where}: {standing.left_out.why}")
            if standing.taken and seen.reasons:
                self._reasons[seen.toss_id] = seen.reasons[0].partition(":")[0]
            elif standing.taken:
                toss = found[seen.toss_id]
                said = seen.origin.number
                self._tosses[seen.toss_id] = NumberedToss(toss, toss_number(toss, place) if said is None else said)


def check_something_is_held_out(rule: HeldOutRule, held_out: int, of: int) -> None:
    """InvalidValueError when a rule that a user gave holds nothing out of so many tosses."""
    if not held_out and rule != HeldOutRule():
        raise InvalidValueError("--held-out", f"none of {counted_tosses(of)}", "at least one")


def unknown_ids(rule: HeldOutRule, tosses: Sequence[NumberedToss]) -> list[str]:
    """A line about ids that a rule names and that are not there, or none."""
    there = {one.toss.toss_id for one in tosses}
    unknown = [toss_id for toss_id in sorted(rule.ids) if toss_id not in there]
    if not unknown:
        return []
    return [f"--held-out: {len(unknown)} of {len(rule.ids)} ids are not among the tosses: {listed(unknown)}"]


def listed(ids: Sequence[str]) -> str:
    """The first ids."""
    return ", ".join(ids[:LISTED]) + (", ..." if len(ids) > LISTED else "")
