"""Mutants of solver, contact, information and gates: a sample of the changes that mutmut makes, and which of them tests notice.

    pip install mutmut==3.8.1            in an environment that has the package's own dependencies
    python -m test.mutation.library --count 300 --seed 0

mutmut works in a copy of the tree (`--folder`). It runs the tests of these parts once to learn which of them reach which
function, and then for each mutant those that do, in a fork of a process in which everything is imported. What survives is tried
again with all tests of the files that these tests stand in. The sample follows from the seed; what is known of an earlier run
stays. The exit status is 1 where fewer die than 90 %.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from contact_curation.solver.compiled import KERNEL_FOLDER

REPOSITORY = Path(__file__).resolve().parents[2]
PARTS = {
    "contact_curation/solver/*.py": ["test/solver", "test/kernel/test_interface.py"],
    "contact_curation/contact/*.py": ["test/contact", "test/learning/training/test_single_steps.py"],
    "contact_curation/information/*.py": ["test/information"],
    "contact_curation/motion/gates.py": ["test/motion/gates"],
    "contact_curation/motion/gate_config.py": ["test/motion/gates"],
}
"""What is changed, and the tests that have to notice."""
OUTCOMES = {
    0: "survived",
    2: "not tried",
    5: "no test reaches it",
    33: "no test reaches it",
    34: "skipped",
    36: "does not end",
    None: "not tried",
}
"""By mutmut's exit codes; all others are deaths."""
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
"""In which the copy's modules come first."""
DEATHS = ("died", "does not end")
COPIED = ("bags", "benchmarks", "examples", "msg_defs", "setup.py", "package.xml", "CONTRIBUTING.md")
SCRATCH = "*test_own_criterion*"
"""Tests that work in a copy of their own, which holds no mutant."""
NOTHING = "contact_curation.of_no_name"


def main() -> int:
    """Tries a sample."""
    parser = argparse.ArgumentParser(description="mutants of the library, and whether the tests notice them")
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--parts", nargs="*", default=list(PARTS), choices=list(PARTS), metavar="PATTERN", help="of PARTS")
    parser.add_argument("--folder", type=Path, default=REPOSITORY / "build" / "mutants")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has mutmut")
    parser.add_argument("--children", type=int, default=1, help="mutants at a time")
    arguments = parser.parse_args()
    if not arguments.folder.exists():
        copy_tree(arguments.folder, arguments.parts)
    command = [arguments.python, "-m", "mutmut", "run", "--max-children", str(arguments.children)]
    reached = arguments.folder / "mutants" / "mutmut-stats.json"
    if not reached.exists():
        shutil.rmtree(reached.parent, ignore_errors=True)  # an interrupted run leaves files half written
        making = [*command, NOTHING]  # makes all and tries none
        done = subprocess.run(making, cwd=arguments.folder, env=ENVIRONMENT, capture_output=True, text=True, check=False)
        if not reached.exists():
            raise SystemExit(f"no mutants: `{' '.join(making)}` in {arguments.folder} ended with\n{done.stdout[-3000:]}")
    names = sorted(known(arguments.folder))
    order = np.random.default_rng(arguments.seed).permutation(len(names))[: arguments.count]
    sample = [names[int(place)] for place in order]
    print(f"{len(names)} mutants; a sample of {len(sample)} by seed {arguments.seed}", flush=True)
    untried = [name for name in sample if known(arguments.folder)[name] is None]
    if untried:
        subprocess.run([*command, *untried], cwd=arguments.folder, stdout=subprocess.DEVNULL, env=ENVIRONMENT, check=False)
    codes = known(arguments.folder)
    survivors = [name for name in untried if codes[name] == 0]
    if survivors:
        narrow = reached.read_text()
        reached.write_text(json.dumps(widened(json.loads(narrow))))
        subprocess.run([*command, *survivors], cwd=arguments.folder, stdout=subprocess.DEVNULL, env=ENVIRONMENT, check=False)
        reached.write_text(narrow)
    return report(sample, known(arguments.folder))


def copy_tree(folder: Path, parts: list[str]) -> None:
    """The tracked files and the built kernel, with mutmut's settings."""
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, text=True, check=True).stdout
    for name in tracked.split("\0"):
        if name and (REPOSITORY / name).is_file():
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(REPOSITORY / name, target)
    for library in KERNEL_FOLDER.glob("_kernel_*"):
        shutil.copy(library, folder / KERNEL_FOLDER.relative_to(REPOSITORY))
    settings = {
        "source_paths": ["contact_curation"],
        "only_mutate": parts,
        "also_copy": list(COPIED),
        "pytest_add_cli_args": ["-p", "no:cacheprovider", f"--ignore-glob={SCRATCH}"],
        "pytest_add_cli_args_test_selection": sorted({test for part in parts for test in PARTS[part]}),
    }
    with (folder / "pyproject.toml").open("a") as file:
        file.write("\n[tool.mutmut]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in settings.items()))


def widened(stats: dict[str, Any]) -> dict[str, Any]:
    """mutmut's record of which tests reach which function, with all tests of a file where one does.

    What a fixture or a cache computes once for a file counts for the first test that asks for it, while another may be the one
    that looks at it.
    """
    by_file: dict[str, list[str]] = {}
    for test in stats["duration_by_test"]:
        by_file.setdefault(test.partition("::")[0], []).append(test)
    reaching = stats["tests_by_mangled_function_name"]
    for function, tests in reaching.items():
        reaching[function] = sorted(each for file in {test.partition("::")[0] for test in tests} for each in by_file[file])
    return stats


def known(folder: Path) -> dict[str, int | None]:
    """Every mutant, and the exit code of its tests where it was tried."""
    found: dict[str, int | None] = {}
    for path in sorted((folder / "mutants").rglob("*.meta")):
        found |= json.loads(path.read_text())["exit_code_by_key"]
    return found


def report(sample: list[str], codes: dict[str, int | None]) -> int:
    """Says what became of the sample; returns the exit status."""
    outcomes = {name: OUTCOMES.get(codes[name], "died") for name in sample}
    by_part: dict[str, Counter[str]] = {}
    for name, outcome in outcomes.items():
        by_part.setdefault(".".join(name.split(".")[1:3]), Counter())[outcome] += 1
        if outcome not in DEATHS:
            print(f"{outcome:>20}  {name}")
    for part, counted in sorted(by_part.items()):
        print(f"{part:>30}  {dict(counted)}")
    total = Counter(outcomes.values())
    tried = total.total() - total["not tried"] - total["skipped"]
    died = sum(total[outcome] for outcome in DEATHS)
    print(f"{died} of {tried} died ({100.0 * died / max(tried, 1):.1f} %)")
    return 0 if tried and died >= 0.9 * tried else 1


if __name__ == "__main__":
    sys.exit(main())
