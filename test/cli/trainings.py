"""What the tests of `train` share: a short training on the fixture `folder`, and what it leaves behind."""

import json
from pathlib import Path
from typing import Any

from contact_curation.learning.checkpoints.safetensors_bytes import unpack

SHORT = ("--steps", "12", "--set", "training.evaluation_steps=4", "--held-out", "5,6")


def numbers(path: Path) -> dict[str, bytes]:
    """All arrays of a checkpoint, to the last bit."""
    return {name: array.tobytes() for name, array in unpack(path.read_bytes(), path).arrays.items()}


def events(path: Path) -> list[dict[str, Any]]:
    """The lines of a file of metrics."""
    return [json.loads(line) for line in path.read_text().splitlines()]
