"""What goes on through BLAS, NumPy and torch gives the same selections and parameters on older CPUs."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact_curation.solver.compiled import usable_levels

SCRIPT = """
import json, sys
import contact_curation as cc
tosses = cc.read(sys.argv[1])
told = {}
for criterion in ("representative", "log-det", "trace"):
    for estimator in ("empirical", "gauss-newton"):
        ranking = cc.rank(tosses, top=6, criterion=criterion, estimator=estimator)
        rows = ranking.to_arrow().to_pylist()
        told[f"{criterion} {estimator}"] = [[row["toss_id"], row["score"]] for row in rows]
model = cc.train(cc.rank(tosses, top=6).selected, protocol="exact", held_out="none").model.geometry()
told["parameters"] = [model.vertices_normal.tolist(), model.normal.tolist(), model.tangents.tolist(), [model.height]]
print(json.dumps(told))
"""


def _with_avx512(found: list[str]) -> list[str]:
    return [one for one in found if "512" in one or one == "X86_V4"]


CPUS: dict[str, tuple[str, str, Callable[[list[str]], list[str]]]] = {
    "x86-64-v2": ("Nehalem", "default", list[str]),
    "x86-64-v3": ("Haswell", "avx2", _with_avx512),
}
"""By the kernel's level: the kind of CPU for OpenBLAS, torch's capability, and which of NumPy's found features are left out."""

OF_LARGEST = 1e-7
"""By so much of the largest score a score may differ: representative's are small differences of large quadratic forms."""


def told(recording: Path, settings: dict[str, str]) -> dict[str, Any]:
    """What the script prints in a process with these settings."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OPENBLAS_CORETYPE")}
    command = [sys.executable, "-c", SCRIPT, str(recording)]
    done = subprocess.run(command, env={**environment, **settings}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


@pytest.fixture(scope="module")
def here(golden_bag: Path) -> dict[str, Any]:
    return told(golden_bag, {})


@pytest.mark.slow
@pytest.mark.parametrize("level", [level for level in CPUS if level in usable_levels()[1:]])
def test_an_older_cpu_selects_the_same_tosses_and_learns_the_same_parameters(
    level: str, here: dict[str, Any], golden_bag: Path
) -> None:
    from numpy._core import _multiarray_umath as numpys  # type: ignore[attr-defined]

    kind, capability, left_out = CPUS[level]
    found = [one for one in numpys.__cpu_dispatch__ if numpys.__cpu_features__.get(one)]
    settings = {"CONTACT_CURATION_KERNEL": level, "OPENBLAS_CORETYPE": kind, "ATEN_CPU_CAPABILITY": capability}
    there = told(golden_bag, {**settings, "NPY_DISABLE_CPU_FEATURES": " ".join(left_out(found))})
    for name in here.keys() - {"parameters"}:
        assert [row[0] for row in there[name]] == [row[0] for row in here[name]], name
        ours, theirs = (np.array([row[1] for row in one[name]], dtype=float) for one in (here, there))  # NaN of a rejected toss
        np.testing.assert_allclose(theirs, ours, rtol=0.0, atol=OF_LARGEST * float(np.nanmax(np.abs(ours))))
    for one, other in zip(there["parameters"], here["parameters"], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
