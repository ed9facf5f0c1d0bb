"""What every verb prints in the same way: one JSON object on stdout, warnings on stderr."""

import argparse
import json
import math
import sys
from collections.abc import Mapping
from typing import Any


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Adds `--json`."""
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else on standard output")


def print_json(content: Mapping[str, Any]) -> None:
    """One JSON object on one line; numbers that JSON does not have become null."""
    print(json.dumps(_plain(content), ensure_ascii=False, allow_nan=False))


def counted(count: int, thing: str) -> str:
    """``1 input``, ``2 inputs``."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def warn(line: str) -> None:
    """One line of warning on stderr."""
    print(f"contact-curation: warning: {line}", file=sys.stderr, flush=True)
