"""Takes each toss once: a repeated toss is left out, and so is another toss with the same id.

A rejected toss, for example from a recording that was cut short, is replaced by a whole one with the same id, whichever comes
first, so that the order of the recordings does not decide which toss is ranked.
"""

from typing import NamedTuple


class LeftOut(NamedTuple):
    """A toss that is left out.

    Attributes:
        where: its recording.
        why: one line that says what was found and what was expected.
    """

    where: str
    why: str


class DuplicateCheck(NamedTuple):
    """The decision about a toss.

    Attributes:
        taken: whether this toss is the one with its id from now on.
        left_out: this toss, or the one that it replaces; None for the first toss with its id.
    """

    taken: bool
    left_out: LeftOut | None = None


class _Known(NamedTuple):
    digest: str
    where: str
    whole: bool


class KnownTosses:
    """Remembers ids, contents and recordings of tosses."""

    def __init__(self) -> None:
        self._known: dict[str, _Known] = {}

    def see(self, toss_id: str, digest: str, where: str, *, whole: bool) -> DuplicateCheck:
        """Notes a toss, and decides whether it is taken.

        Args:
            toss_id: its id.
            digest: digest of its content.
            where: its recording.
            whole: whether it is an accepted toss; False for a rejected motion.
        """
        seen, first = _Known(digest, where, whole), self._known.get(toss_id)
        if first is None:
            self._known[toss_id] = seen
            return DuplicateCheck(True)
        if seen.whole != first.whole:
            worse, better = (first, seen) if seen.whole else (seen, first)
            self._known[toss_id] = better
            why = f"found it rejected here and accepted in {better.where}, expected each once"
            return DuplicateCheck(seen.whole, _left_out(toss_id, worse.where, why))
        if seen.digest == first.digest:
            return DuplicateCheck(False, _left_out(toss_id, where, f"found the same one in {first.where}, expected each once"))
        told = "header stamps, or names of .pt files, must differ"
        why = f"found another one of that id in {first.where}, expected ids that tell tosses apart: {told}"
        return DuplicateCheck(False, _left_out(toss_id, where, why))


def _left_out(toss_id: str, where: str, why: str) -> LeftOut:
    return LeftOut(where, f"toss {toss_id} is left out: {why}")
