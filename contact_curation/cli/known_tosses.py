"""Each toss once: one that came before is left out, and so is another of the same id, which nobody could tell from it."""


class KnownTosses:
    """Remembers ids, contents and where they came from."""

    def __init__(self) -> None:
        self._first: dict[str, tuple[str, str]] = {}

    def why_not(self, toss_id: str, digest: str, where: str) -> str:
        """Why a toss is left out, in one line; empty for a new one, which is known from now on."""
        if toss_id not in self._first:
            self._first[toss_id] = (digest, where)
            return ""
        known, first = self._first[toss_id]
        if known == digest:
            return f"toss {toss_id} is left out: found the same one in {first}, expected each once"
        return f"toss {toss_id} is left out: found another one of that id in {first}, expected ids to tell tosses apart"
