"""Each toss once: a repeated one is left out, and so is another toss of the same id.

One that was rejected, say because its recording was cut short, gives way to a whole one of the same id, whichever comes
first: the order of the recordings does not decide which toss is ranked.
"""

from typing import NamedTuple


class LeftOut(NamedTuple):
    """A toss that is left out.

    Attributes:
        where: its recording.
        why: one line: what was found, what was expected.
    """

    where: str
    why: str


class DuplicateCheck(NamedTuple):
    """The decision about a toss.

    Attributes:
        taken: whether it is the one of its id from now on.
        left_out: it, or the one whose place it takes; None for the first of its id.
    """

    taken: bool
    left_out: LeftOut | None = None


class _Known(NamedTuple):
    digest: str
    where: str
    whole: bool


class KnownTosses:
    """Remembers ids, contents and where they came from."""

    def __init__(self) -> None:
        self._known: dict[str, _Known] = {}

    def see(self, toss_id: str, digest: str, where: str, *, whole: bool) -> DuplicateCheck:
        """Takes note of a toss.

        Args:
            toss_id: its id.
            digest: digest of its content.
            where: its recording.
            whole: whether it is a toss; False for a rejected motion.
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
        why = f"found another one of that id in {first.where}, expected ids that tell tosses apart"
        return DuplicateCheck(False, _left_out(toss_id, where, why))


def _left_out(toss_id: str, where: str, why: str) -> LeftOut:
    return LeftOut(where, f"toss {toss_id} is left out: {why}")
