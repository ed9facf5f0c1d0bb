"""Selections and parameters as a lesser CPU makes them: libraries for matrices and sines have other last digits there.

OpenBLAS, MKL, torch and NumPy choose their code by the CPU; told to do without AVX, they work as on a CPU that has none.
"""

import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from contact_curation.learning.checkpoints.safetensors_bytes import unpack
from contact_curation.solver.compiled import CHOICE, usable_levels
from test.conftest import GOLDEN

pytestmark = [pytest.mark.slow, pytest.mark.skipif(platform.machine() != "x86_64", reason="names features of x86")]

COMMAND = (sys.executable, "-W", "ignore", "-m", "contact_curation.cli.main")


@pytest.fixture(scope="module")
def lesser() -> dict[str, str]:
    """The environment that hides AVX from the libraries."""
    features = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return {
        CHOICE: usable_levels()[-1],
        "OPENBLAS_CORETYPE": "Nehalem",
        "MKL_ENABLE_INSTRUCTIONS": "SSE4_2",
        "ATEN_CPU_CAPABILITY": "default",
        "NPY_DISABLE_CPU_FEATURES": " ".join(features),
    }


def run(environment: dict[str, str], *words: str | Path) -> None:
    done = subprocess.run(
        [*COMMAND, *map(str, words)], env=os.environ | environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("criterion", ["representative", "log-det", "min-eig", "orthogonal", "trace"])
def test_the_same_tosses_are_selected_in_the_same_order(lesser: dict[str, str], tmp_path: Path, criterion: str) -> None:
    tosses = []
    for name, environment in (("own", {}), ("lesser", lesser)):
        path = tmp_path / f"{name}.json"
        run(environment, "rank", GOLDEN, "--criterion", criterion, "--top", "8", "--out", path)
        tosses.append(json.loads(path.read_text())["tosses"])
    own, other = ([{key: toss[key] for key in ("toss_id", "rank", "selected")} for toss in each] for each in tosses)
    assert own == other
    assert sum(bool(toss["selected"]) for toss in own) == 8


def test_the_same_parameters_are_learned_to_one_in_a_thousand_million(lesser: dict[str, str], tmp_path: Path) -> None:
    learned = []
    for name, environment in (("own", {}), ("lesser", lesser)):
        path = tmp_path / f"{name}.safetensors"
        run(environment, "train", GOLDEN, "--model", "polytope", "--protocol", "exact", "--out", path)
        learned.append(unpack(path.read_bytes(), path).arrays)
    own, other = learned
    assert own.keys() == other.keys()
    for name, values in own.items():
        np.testing.assert_allclose(other[name], values, rtol=1e-9, atol=1e-9, err_msg=name)
