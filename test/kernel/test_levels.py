"""Every level of the kernel gives the same bytes: the ones in the repository."""

import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from contact_curation.solver.compiled import KERNEL_FOLDER, Kernel, choose_kernel, load_kernel, usable_levels
from test.kernel.golden import DIGESTS, digests, golden_calls, replayed

LEVELS = usable_levels()
FUSED = re.compile(r"\t(vfn?m(add|sub|addsub|subadd)\w+|fn?m(add|sub|la|ls)|fcmla)\b")
"""Instructions that round a product and a sum once: x86's and aarch64's."""


@pytest.mark.parametrize("level", LEVELS)
def test_a_level_gives_the_bytes_in_the_repository(level: str) -> None:
    expected = json.loads(DIGESTS.read_text())
    assert digests(Kernel(choose_kernel(KERNEL_FOLDER, LEVELS, level))) == expected["outputs"]


def test_the_kernel_that_is_loaded_gives_the_bytes_in_the_repository() -> None:
    assert digests(load_kernel()) == json.loads(DIGESTS.read_text())["outputs"]


def test_the_golden_inputs_are_those_in_the_repository() -> None:
    assert hashlib.sha256(replayed(golden_calls())).hexdigest() == json.loads(DIGESTS.read_text())["inputs"]


@pytest.mark.parametrize("path", sorted(KERNEL_FOLDER.glob("_kernel_*.so")), ids=lambda path: path.stem)
def test_no_level_fuses_a_product_and_a_sum(path: Path) -> None:
    disassembler = shutil.which("objdump")
    if disassembler is None:
        pytest.skip("objdump was not found: apt install binutils")
    code = subprocess.run(
        [disassembler, "-d", "--no-show-raw-insn", str(path)], capture_output=True, text=True, check=True
    ).stdout
    assert "ret" in code
    assert FUSED.findall(code) == []
