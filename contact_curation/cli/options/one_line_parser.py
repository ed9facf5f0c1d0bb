"""Bad usage as one line: what was found, what was expected, and where the options are listed."""

import argparse
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, Never

BAD_USAGE = 2


class OneLineParser(argparse.ArgumentParser):
    """Takes options by their whole names only, so that a new option never changes what an old command means."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **{"allow_abbrev": False, **kwargs})

    def error(self, message: str) -> Never:
        """Ends with exit status 2."""
        line = " ".join(message.split())
        self.exit(BAD_USAGE, f"{self.prog}: error: {line} (usage: {self.prog} --help)\n")

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """As argparse does, but each verb's own parser says what it does not know, with the option that was perhaps meant."""
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"found {' '.join(unknown)}, expected options and inputs of {self.prog}{self._perhaps(unknown)}")
        return known, unknown

    def _perhaps(self, unknown: Sequence[str]) -> str:
        options = [name for action in self._actions for name in action.option_strings]
        near = [name for word in unknown for name in get_close_matches(word.partition("=")[0], options, 1)]
        return f"; did you mean {near[0]}?" if near else ""
