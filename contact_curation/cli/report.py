"""Output that all verbs print in the same way: one JSON object on stdout, warnings on stderr."""

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from contact_curation.pipeline.wording import MOST_CAUSES, json_line

LEFT_OUT = re.compile(r"^(.*?: )toss (\S+) is left out(: .*)$")
"""A line about a toss that is left out: its recording, its id, the reason."""


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Adds `--json`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else on standard output")


def print_json(content: Mapping[str, Any]) -> None:
    """Prints one JSON object on one line; NaN and infinite numbers become null."""
    print(json_line(content), flush=True)


def warn(lines: Sequence[str]) -> None:
    """Prints warnings on stderr; several tosses of a recording that are left out for the same reason get one line."""
    for line in _condensed(lines):
        print(f"contact-curation: warning: {line}", file=sys.stderr, flush=True)


def _condensed(lines: Sequence[str]) -> list[str]:
    """Joins lines of the same kind, in the order of the first line of each kind."""
    alike: dict[str, list[str]] = {}
    for line in lines:
        alike.setdefault(LEFT_OUT.sub(r"\1\3", line), []).append(line)
    return [line for group in alike.values() for line in (group if len(group) <= MOST_CAUSES else [_of_many(group)])]


def _of_many(lines: Sequence[str]) -> str:
    return LEFT_OUT.sub(rf"\g<1>{len(lines)} tosses are left out, the first one \g<2>\g<3>", lines[0])
