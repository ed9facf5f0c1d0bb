"""When throws have stopped coming: an arm that stopped itself waits to be armed, which here only a new start does."""

from contact_curation.session.supervisor import ProgramFailedError

LONGEST_PAUSE = 180.0
"""[s] between two throws, beyond the time that the designer gives a throw's toss: images may take minutes to be rendered."""

MOST_STARTS = 3
"""Of the arm, without a throw in between."""


class Standstill:
    """Remembers when the last throw came.

    Args:
        now: a steady clock [s].
        toss_timeout: so long the designer waits for a throw's toss before it commands the next [s].
    """

    def __init__(self, now: float, toss_timeout: float) -> None:
        self._pause = LONGEST_PAUSE + toss_timeout
        self._throws = 0
        self._since = now
        self._starts = 0

    def found(self, throws: int, now: float, complaint: str = "") -> bool:
        """Whether the arm should be started again; asked often.

        Args:
            throws: made so far.
            now: the clock.
            complaint: why the designer has commanded none since the last throw; empty where that is not why.

        Raises:
            ProgramFailedError: that has not helped, or cannot.
        """
        if throws != self._throws:
            self._throws, self._since, self._starts = throws, now, 0
        if now - self._since < self._pause:
            return False
        if complaint:
            raise ProgramFailedError(f"found no throw for {self._pause:.0f} s after {throws} throws: {complaint}")
        if self._starts == MOST_STARTS:
            waited = self._pause * (MOST_STARTS + 1)
            raise ProgramFailedError(
                f"found no throw for {waited:.0f} s after {throws} throws, though sim_arm was started again {MOST_STARTS} "
                "times; see the logs of sim_arm and throw_designer"
            )
        self._since = now
        self._starts += 1
        return True
