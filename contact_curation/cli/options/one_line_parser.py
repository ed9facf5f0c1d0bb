"""The parser of all verbs: bad usage gives one line that suggests a similar name, and the help ends with examples."""

import argparse
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from itertools import takewhile
from pathlib import Path
from typing import Any, Never

from contact_curation.errors import did_you_mean

BAD_USAGE = 2

LETTERS = {
    "--body": "-b",
    "--criterion": "-c",
    "--jobs": "-j",
    "--model": "-m",
    "--out": "-o",
    "--params": "-p",
    "--throws": "-n",
    "--top": "-k",
}
"""The letters of options, the same in all verbs."""

RENAMED = {"--canary": "--rerank-when-stale", "--warm-up": "--exploration-throws"}
"""Names of options in version 0.1, and their present names."""

EXAMPLES = "examples:"


class OneLineParser(argparse.ArgumentParser):
    """Accepts whole names or letters of options only, so that a new option never changes the meaning of an old command."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **{"allow_abbrev": False, "formatter_class": _HelpLines, **kwargs})

    def set_examples(self, *commands: str) -> None:
        """Sets the example commands at the end of the help, one per line."""
        self.epilog = "\n".join([EXAMPLES, *(f"  {command}" for command in commands)])

    def add_letters(self) -> None:
        """Adds the letters to options, here and in the subparsers; call it once, after all options were added."""
        for action in self._actions:
            for letter in (LETTERS[name] for name in action.option_strings if name in LETTERS):
                action.option_strings = [letter, *action.option_strings]
                self._option_string_actions[letter] = action
            if isinstance(action, argparse._SubParsersAction):
                for below in action.choices.values():
                    below.add_letters()

    def error(self, message: str) -> Never:
        """Prints the message and ends the process with exit status 2."""
        line = " ".join(message.split())
        self.exit(BAD_USAGE, f"{self.prog}: error: {line} (usage: {self.prog} --help)\n")

    def exit(self, status: int = 0, message: str | None = None) -> Never:
        """Ends the process as argparse does; that nobody reads the help is noticed here, not while the interpreter ends."""
        sys.stdout.flush()
        super().exit(status, message)

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Parses as argparse does; for an unknown option the verb's own parser suggests a similar one.

        Unknown options are reported before other errors: after `--hlep` a user does not want to read that an input is missing.
        """
        words = list(takewhile(lambda word: word != "--", sys.argv[1:] if args is None else args))
        slips = [word for word in words if word.startswith("--") and word.partition("=")[0] not in self._option_string_actions]
        if slips and self._subparsers is None and not {"-h", "--help"} & set(words):
            self.error(self._unknown(slips))
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(self._unknown(unknown))
        return known, unknown

    def _unknown(self, words: Sequence[str]) -> str:
        options = [name for action in self._actions for name in action.option_strings if name.startswith("--")]
        name = next((word.partition("=")[0] for word in words if word.startswith("-")), "")
        if not name:
            if "--set" in options and "=" in words[0]:
                return f"found {words[0]} without an option, expected --set {words[0]}: each setting has a --set of its own"
            return f"found {' '.join(words)} after the last input, expected options before it or nothing"
        near = [RENAMED[name]] if RENAMED.get(name) in options else get_close_matches(name, options, 1)
        return f"unknown option {name}" + (f": did you mean {near[0]}?" if near else f": {self.prog} --help lists its options")

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        """Converts a value as argparse does; no word is no path, though Python takes it for the current folder."""
        if not text and action.type is Path:
            raise argparse.ArgumentError(action, "found '', expected a path")
        return super()._get_value(action, text)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Checks a value as argparse does; the message suggests a similar word."""
        if action.choices is not None and value not in action.choices:
            raise argparse.ArgumentError(action, f"unknown {value}: {did_you_mean(str(value), map(str, action.choices))}")


class _HelpLines(argparse.HelpFormatter):
    """Formats the help: names of an option in one row, followed by its value once; examples stay unchanged."""

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        value = self._format_args(action, self._get_default_metavar_for_optional(action))
        return f"{', '.join(action.option_strings)} {value}"

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if text.startswith(EXAMPLES) else super()._fill_text(text, width, indent)
