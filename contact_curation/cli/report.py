"""What every verb prints in the same way: one JSON object on stdout, warnings on stderr."""

import argparse
import json
import math
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from contact_curation.errors import ContactCurationError, InvalidValueError

MOST_CAUSES = 3
"""Of one error that fit a line."""

LEFT_OUT = re.compile(r"^(.*?: )toss (\S+) is left out(: .*)$")
"""A line about a toss that cannot be taken: its recording, its id, the reason."""


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Adds `--json`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else on standard output")


def print_json(content: Mapping[str, Any]) -> None:
    """One JSON object on one line; numbers that JSON does not have become null."""
    print(json_line(content), flush=True)


def json_line(content: Mapping[str, Any]) -> str:
    """The same as text without its line break, in ASCII, whatever files are called and a terminal can show."""
    return json.dumps(_plain(content), allow_nan=False)


def counted(count: int, thing: str) -> str:
    """``1 input``, ``2 inputs``."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def counted_tosses(count: int) -> str:
    """``1 toss``, ``2 tosses``."""
    return f"{count} toss{'' if count == 1 else 'es'}"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def warn(lines: Sequence[str]) -> None:
    """Lines of warning on stderr; tosses that are left out of one recording for one reason are one line where they are many."""
    for line in _condensed(lines):
        print(f"contact-curation: warning: {line}", file=sys.stderr, flush=True)


def _condensed(lines: Sequence[str]) -> list[str]:
    """The same lines, in the order of the first of each kind."""
    alike: dict[str, list[str]] = {}
    for line in lines:
        alike.setdefault(LEFT_OUT.sub(r"\1\3", line), []).append(line)
    return [line for group in alike.values() for line in (group if len(group) <= MOST_CAUSES else [_of_many(group)])]


def _of_many(lines: Sequence[str]) -> str:
    return LEFT_OUT.sub(rf"\g<1>{len(lines)} tosses are left out, the first one \g<2>\g<3>", lines[0])


def nothing_found(paths: Sequence[Path], warnings: Sequence[str], found: str, expected: str) -> ContactCurationError:
    """The error where no input gave anything: what went wrong with the only one, or a summary behind a line for each cause.

    What was `found` stands behind it, too, where reasons are counted in brackets at its end.
    """
    if len(paths) == 1 and 1 <= len(warnings) <= MOST_CAUSES:
        others = [line.removeprefix(f"{paths[0]}: ") for line in warnings[1:]]
        counts = [f"found {found}"] if found.endswith(")") else []
        return ContactCurationError("; ".join([warnings[0], *others, *counts]))
    warn(warnings)
    return InvalidValueError("inputs", found, expected)
