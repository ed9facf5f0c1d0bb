"""Coverage-guided fuzzing of every reader, by atheris (libFuzzer) in a process of its own each.

    make fuzz SECONDS=60 [TARGETS="mcap theta"]

A process ends at an error that is not of this package, at 5 s of processor time for one input (or two minutes, which a hang
takes), at a gigabyte asked for at once or two in all, and at a file that is touched. Such an input is put into
test/fuzz/found/TARGET, where the default tests read it; the process is started again for the rest of its time. What was found
interesting stays in build/fuzz/corpus, so that the next run goes on from there. Printed are the executions and findings of each
target, and its executions in all runs.
"""

import hashlib
import re
import resource
import subprocess
import sys
import time
from argparse import ArgumentParser
from pathlib import Path

from test.fuzz.kernel import kernel_command
from test.fuzz.targets import TARGETS

HERE = Path(__file__).parent
REPOSITORY = HERE.parents[1]
BUILD = REPOSITORY / "build" / "fuzz"
HANGS = 120
"""[s] for one input: so long a busy machine does not make a quick one."""
LIMITS = (f"-timeout={HANGS}", f"-report_slow_units={HANGS}", "-rss_limit_mb=2500", "-malloc_limit_mb=1000")
SEARCH = ("-reload=0", "-len_control=0")
FINDINGS = ("crash-", "timeout-", "oom-", "slow-unit-")
KERNEL = "kernel"


def fuzz(target: str, seconds: float) -> tuple[int, int]:
    """Executions and new findings of a target in so many seconds."""
    corpus, artifacts = BUILD / "corpus" / target, BUILD / "artifacts" / target
    for folder in (corpus, artifacts):
        folder.mkdir(parents=True, exist_ok=True)
    own = [str(folder) for folder in (HERE / "corpus" / target, HERE / "found" / target) if folder.is_dir()]
    longest = 1 << 12 if target == KERNEL else TARGETS[target].longest
    command = kernel_command(BUILD) if target == KERNEL else [sys.executable, "-m", "test.fuzz.one", target]
    executions, end = 0, time.monotonic() + seconds
    while (left := int(end - time.monotonic())) > 0:
        options = (f"-max_total_time={left}", f"-max_len={longest}", f"-artifact_prefix={artifacts}/", "-print_final_stats=1")
        log = BUILD / f"{target}.log"
        with log.open("w") as said:
            whole = [*command, *LIMITS, *SEARCH, *options, str(corpus), *own]
            subprocess.run(whole, stderr=said, stdout=said, check=False, cwd=REPOSITORY)
        counts = re.findall(r"^(?:#|stat::number_of_executed_units: )(\d+)", log.read_text(errors="replace"), re.MULTILINE)
        executions += max(map(int, counts), default=0)
        if not counts:
            print(log.read_text(errors="replace")[-2000:])
            break
    found = [path for path in artifacts.iterdir() if path.name.startswith(FINDINGS)]
    return executions, sum(_keep(target, path) for path in found)


def _keep(target: str, path: Path) -> bool:
    """Moves a finding to where the tests read it; whether it is new."""
    data = path.read_bytes()
    path.unlink()
    place = HERE / "found" / target / hashlib.sha256(data).hexdigest()[:12]
    new = not place.exists()
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(data)
    return new


def _processor_time() -> float:
    """[s] Of the fuzzers that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _count(target: str, executions: int) -> int:
    """Adds to the executions of a target; returns how many they are in all runs."""
    place = BUILD / "executions" / target
    place.parent.mkdir(parents=True, exist_ok=True)
    in_all = executions + (int(place.read_text()) if place.exists() else 0)
    place.write_text(f"{in_all}\n")
    return in_all


def main() -> int:
    """The command line; the exit status is 1 if anything was found."""
    parser = ArgumentParser(description="Fuzzes the readers.")
    parser.add_argument("targets", nargs="*", default=[*TARGETS, KERNEL], metavar="TARGET")
    parser.add_argument("--seconds", type=float, default=60.0, help="for each target")
    options = parser.parse_args()
    bad = 0
    for target in options.targets:
        began = _processor_time()
        executions, findings = fuzz(target, options.seconds)
        took, in_all = _processor_time() - began, _count(target, executions)
        print(
            f"{target:16} {executions:9} executions, {executions / took:6.0f} in a second of processor time, "
            f"{in_all:10} in all runs; {findings} found",
            flush=True,
        )
        bad += findings
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
