"""How reports count, list and serialise: pure functions that print nothing."""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from contact_curation.errors import InvalidValueError, NothingFoundError

MOST_CAUSES = 3
"""Of one error that fit a line."""

LISTED = 3
"""Ids that fit a line."""


def counted(count: int, thing: str) -> str:
    """``1 input``, ``2 inputs``."""
    return f"{count} {thing}{'' if count == 1 else 's'}"


def counted_tosses(count: int) -> str:
    """``1 toss``, ``2 tosses``."""
    return f"{count} toss{'' if count == 1 else 'es'}"


def listed(ids: Sequence[str]) -> str:
    """The first ids."""
    return ", ".join(ids[:LISTED]) + (", ..." if len(ids) > LISTED else "")


def in_brackets(reasons: Mapping[str, int]) -> str:
    """`` (2 gap; 1 end)``, the most frequent reason first; empty where there is none."""
    counts = "; ".join(f"{count} {name}" for name, count in Counter(reasons).most_common() if count)
    return f" ({counts})" if counts else ""


def json_line(content: Mapping[str, Any]) -> str:
    """One JSON object on one line, in ASCII, whatever files are called; numbers that JSON does not have become null."""
    return json.dumps(plain_json(content), allow_nan=False)


def nothing_found(paths: Sequence[Path | str], warnings: Sequence[str], found: str, expected: str) -> NothingFoundError:
    """The error for inputs without any toss: the cause for a single input, otherwise a summary with a warning for each cause.

    What was `found` stands behind it, too, where reasons are counted in brackets at its end.
    """
    if len(paths) == 1 and 1 <= len(warnings) <= MOST_CAUSES:
        others = [line.removeprefix(f"{paths[0]}: ") for line in warnings[1:]]
        counts = [f"found {found}"] if found.endswith(")") else []
        return NothingFoundError("; ".join([warnings[0], *others, *counts]))
    return NothingFoundError(str(InvalidValueError("inputs", found, expected)), warnings)


def plain_json(value: Any) -> Any:
    """Of mappings, lists, texts and numbers what JSON has: numbers that are not finite become None."""
    if isinstance(value, Mapping):
        return {str(name): plain_json(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain_json(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
