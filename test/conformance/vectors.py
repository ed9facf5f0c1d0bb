"""The test vectors, as the tests read them; the scripts beside them are imported from their folder, which is no package."""

import importlib.util
import sys
from functools import cache
from types import ModuleType
from typing import Any

from test.conftest import REPOSITORY

FOLDER = REPOSITORY / "conformance"
GROUPS = sorted(path.stem for path in (FOLDER / "problems").glob("*.json"))


@cache
def script(name: str) -> ModuleType:
    """A script of the folder, such as "check" or "runners/run_contact_curation"."""
    known = name.rpartition("/")[2]
    spec = importlib.util.spec_from_file_location(known, FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[known] = module  # dataclasses look for their module there
    spec.loader.exec_module(module)
    return module


@cache
def problems() -> dict[str, dict[str, Any]]:
    """All of them by id."""
    found: dict[str, dict[str, Any]] = script("check").problems_of(FOLDER / "problems")
    return found
