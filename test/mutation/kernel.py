"""Mutants of the kernel: single operators and numbers of its sources changed, one at a time, and what notices.

    python -m test.mutation.kernel --count 40 --seed 0

A mutant is compiled with setup.py's own flags for one level and dies where the outputs of the golden calls have other bytes
(`test/kernel/golden.py`), where it crashes or does not end, or else where a test fails that is given with `--tests`. What does
not compile is no mutant. Each is one line, and survivors are shown with what was changed; the sample follows from the seed.
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from contact_curation.solver.compiled import CHOICE
from test.kernel.builds import REPOSITORY, setup_module

SWAPS = {
    "+": "-", "-": "+", "*": "/", "/": "*", "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==",
    "&&": "||", "||": "&&", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "true": "false", "false": "true",
}  # fmt: skip
SITE = re.compile(
    r"(?<= )(?:[-+*/]=?|[<>]=?|[=!]=|&&|\|\|)(?= )"  # operators with room around them: no signs, addresses or templates
    r"|\b(?:true|false)\b|(?<![\w.])\d+\.\d+(?:e-?\d+)?(?![\w.])|(?<![\w.])\d(?![\w.])"
)
FASTER = "-O1"
"""The same bytes, compiled in a fraction of the time."""
LONGEST = 300.0
"""[s] that the golden calls of a mutant may take, which take a second."""
GOLDEN = """
import json
from contact_curation.solver.compiled import load_kernel
from test.kernel.golden import DIGESTS, digests
raise SystemExit(digests(load_kernel()) != json.loads(DIGESTS.read_text())["outputs"])
"""


class Mutant(NamedTuple):
    """One change.

    Attributes:
        path: of the source, relative to the repository.
        line: from 1.
        start: where in the line it begins.
        old: what stands there.
        new: what takes its place.
    """

    path: str
    line: int
    start: int
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}:{self.start + 1}: {self.old} becomes {self.new}"


def main() -> int:
    """Tries a sample; the exit status is 1 where fewer die than 90 %."""
    parser = argparse.ArgumentParser(description="mutants of the kernel, and whether the tests notice them")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--tests", nargs="*", default=[], help="tests for those that the golden calls do not notice")
    parser.add_argument(
        "--out", type=Path, help="file that takes each outcome as a line of JSON; those in it are not tried again"
    )
    arguments = parser.parse_args()
    setup = setup_module()
    mutants = [one for source in sorted({*setup.kernel_sources(), *_headers()}) for one in mutants_of(source)]
    order = np.random.default_rng(arguments.seed).permutation(len(mutants))
    print(f"{len(mutants)} mutants; a sample of {arguments.count} by seed {arguments.seed}", flush=True)
    if outcome_of(None, arguments.tests) != "survived":
        raise SystemExit("the kernel as it is does not give the bytes in the repository")
    known = _known(arguments.out)
    outcomes: Counter[str] = Counter()
    for place in order:
        mutant = mutants[int(place)]
        outcome = known.get(str(mutant)) or outcome_of(mutant, arguments.tests)
        if arguments.out and str(mutant) not in known:
            with arguments.out.open("a") as file:
                file.write(json.dumps([str(mutant), outcome]) + "\n")
        outcomes[outcome] += 1
        print(f"{outcome:>14}  {mutant}", flush=True)
        if outcomes.total() - outcomes["not compiled"] == arguments.count:
            break
    tried = outcomes.total() - outcomes["not compiled"]
    share = 1.0 - outcomes["survived"] / tried
    print(f"{dict(outcomes)}; {100.0 * share:.1f} % of {tried} died")
    return 0 if share >= 0.9 else 1


def mutants_of(source: str) -> Iterator[Mutant]:
    """Every one of a source; comments, preprocessor lines and template heads are left alone."""
    for number, line in enumerate((REPOSITORY / source).read_text().splitlines(), 1):
        code = line.partition("//")[0]
        if code.lstrip().startswith(("#", "*", "/*", "template", "static_assert", "using", "namespace")) or '"' in code:
            continue
        for found in SITE.finditer(code):
            old = found.group()
            yield Mutant(source, number, found.start(), old, SWAPS.get(old) or _other_number(old))


def outcome_of(mutant: Mutant | None, tests: list[str]) -> str:
    """What became of it; None for the kernel as it is."""
    setup = setup_module()
    level, flags = next(iter(setup.kernel_levels(platform.machine()).items()))
    with TemporaryDirectory(prefix="contact-curation-mutant-") as folder:
        for kernel in setup.KERNEL_FOLDERS:
            copytree(REPOSITORY / kernel, Path(folder, kernel))
        if mutant:
            change(Path(folder, mutant.path), mutant)
        library = Path(folder, f"{level}.so")
        command = setup.kernel_command([os.environ.get("CXX", "c++")], [*flags, FASTER], setup.kernel_sources(), library)
        command = [
            word.replace(str(REPOSITORY / "contact_curation"), str(Path(folder, "contact_curation"))) for word in command
        ]
        if subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode:
            return "not compiled"
        return _judged(library, [[sys.executable, "-c", GOLDEN], *([_pytest(tests)] if tests else [])])


def change(source: Path, mutant: Mutant) -> None:
    """Makes a copy of a source the mutant."""
    lines = source.read_text().splitlines(keepends=True)
    line = lines[mutant.line - 1]
    lines[mutant.line - 1] = line[: mutant.start] + mutant.new + line[mutant.start + len(mutant.old) :]
    source.write_text("".join(lines))


def _judged(library: Path, judges: list[list[str]]) -> str:
    environment = os.environ | {CHOICE: str(library), "PYTHONPATH": str(REPOSITORY)}
    for judge in judges:
        try:
            done = subprocess.run(judge, cwd=REPOSITORY, env=environment, capture_output=True, timeout=LONGEST, check=False)
        except subprocess.TimeoutExpired:
            return "does not end"
        if done.returncode:
            return "crashed" if done.returncode < 0 else "died"
    return "survived"


def _pytest(tests: list[str]) -> list[str]:
    return [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]


def _headers() -> list[str]:
    folders = setup_module().KERNEL_FOLDERS
    return [str(path.relative_to(REPOSITORY)) for folder in folders for path in sorted((REPOSITORY / folder).glob("*.hpp"))]


def _other_number(text: str) -> str:
    return repr(float(text) + 1.0) if "." in text else str(int(text) + 1)


def _known(path: Path | None) -> dict[str, str]:
    """Outcomes of an earlier run."""
    return dict(json.loads(line) for line in path.read_text().splitlines()) if path and path.exists() else {}


if __name__ == "__main__":
    sys.exit(main())
