"""Manifests as JSON: one object, a toss per line. Its head is also what the other formats carry beside their table."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from typing import Any

from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from contact_curation.storage.provenance import InputProvenance, RunProvenance

FORMAT = "contact_curation_manifest"
VERSION = 1
ROWS = "tosses"
NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
"""JSON has no such numbers: they are written as these strings."""
FLOATS = {field.name for field in fields(ManifestRow) if field.type in (float, float | None)}


def head_of(manifest: Manifest) -> dict[str, Any]:
    """Everything but the rows, as JSON values."""
    head = {FORMAT: VERSION, **asdict(manifest.run), "diagnostics": dict(manifest.diagnostics)}
    return {name: _with_strings(value) for name, value in head.items()}


def manifest_of(head: Mapping[str, Any], rows: tuple[ManifestRow, ...]) -> Manifest:
    """The manifest of a head and its rows.

    Raises:
        ValueError: the head is of a newer version or of something else.
        KeyError: it lacks something.
    """
    if head[FORMAT] != VERSION:
        raise ValueError(f"it is of version {head[FORMAT]}, this package knows version {VERSION}")
    run = {field.name: head[field.name] for field in fields(RunProvenance)}
    inputs = tuple(InputProvenance(**{**entry, "losses": tuple(entry["losses"])}) for entry in head["inputs"])
    run.update(command=tuple(head["command"]), inputs=inputs, influence_bound=_with_numbers(head["influence_bound"]))
    return Manifest(RunProvenance(**run), rows, _with_numbers(head["diagnostics"]))


def to_json(manifest: Manifest) -> bytes:
    """The same manifest always gives the same bytes."""
    head = json.dumps(head_of(manifest), indent=2, ensure_ascii=False, allow_nan=False)
    rows = [json.dumps(_with_strings(asdict(row)), ensure_ascii=False, allow_nan=False) for row in manifest.rows]
    listed = ",\n    ".join(rows)
    return f'{head[:-2]},\n  "{ROWS}": [\n    {listed}\n  ]\n}}\n'.encode()


def from_json(data: bytes) -> Manifest:
    """Reads what `to_json` wrote.

    Raises:
        ValueError, KeyError, TypeError: it is something else.
    """
    content = json.loads(data)
    return manifest_of(content, tuple(row_of(_with_floats(row)) for row in content[ROWS]))


def row_of(values: Mapping[str, Any]) -> ManifestRow:
    """A row of its values by name."""
    return ManifestRow(**{**values, "reasons": tuple(values["reasons"])})


def _with_strings(value: Any) -> Any:
    def leaf(number: Any) -> Any:
        if isinstance(number, float) and not math.isfinite(number):
            return next(name for name, meant in NOT_FINITE.items() if str(meant) == str(number))
        return number

    return _mapped(value, leaf)


def _with_floats(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _with_numbers(value) if name in FLOATS else value for name, value in row.items()}


def _with_numbers(value: Any) -> Any:
    return _mapped(value, lambda text: NOT_FINITE.get(text, text) if isinstance(text, str) else text)


def _mapped(value: Any, leaf: Callable[[Any], Any]) -> Any:
    """`value` with `leaf` applied to all that is neither list nor dict in it."""
    if isinstance(value, Mapping):
        return {name: _mapped(part, leaf) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_mapped(part, leaf) for part in value]
    return leaf(value)
