"""Selections as JSON and back."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from math import isnan, nan
from typing import Any

from contact_curation.learning.training.reranking import Selected, Trigger

FIRST_NAMES = {"kept": "toss_ids", "canaries": "monitored"}
"""What checkpoints of version 0.1 called these keys, and their names now."""

FIRST_TRIGGERS = {"canary": Trigger.STALE}
"""The same for triggers."""


def document_of(selected: Selected) -> dict[str, Any]:
    """The selection as JSON values, with null for NaN."""
    values = asdict(selected)
    return {name: None if isinstance(value, float) and isnan(value) else value for name, value in values.items()}


def document_of_selections(selections: Sequence[Selected]) -> str:
    """Several selections as JSON text."""
    return json.dumps([document_of(one) for one in selections])


def selections_of(text: str) -> tuple[Selected, ...]:
    """The inverse of `document_of_selections`.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: a text of another form.
    """
    return tuple(_selected_of(entry) for entry in json.loads(text))


def _selected_of(entry: dict[str, Any]) -> Selected:
    entry = {FIRST_NAMES.get(name, name): value for name, value in entry.items()}
    ids = {name: tuple(str(toss_id) for toss_id in entry[name]) for name in ("toss_ids", "monitored", "not_scored")}
    shares = {name: nan if entry[name] is None else float(entry[name]) for name in ("spearman", "overlap", "retained")}
    return Selected(
        gradient_steps=int(entry["gradient_steps"]),
        epochs=int(entry["epochs"]),
        trigger=FIRST_TRIGGERS.get(entry["trigger"]) or Trigger(entry["trigger"]),
        toss_ids=ids["toss_ids"],
        monitored=ids["monitored"],
        spearman=shares["spearman"],
        overlap=shares["overlap"],
        retained=shares["retained"],
        not_scored=ids["not_scored"],
    )
