"""`contact-curation rank` from process start to manifest: seconds and memory, for the 570 real tosses and for many more.

    python -m benchmarks.speed.rank [--json] [--full] [--repeats N]

The tosses are found through CONTACTNETS_DATA. Larger pools are the same tosses imported again with later stamps, a bag each, so
that every toss has an id of its own. With `--full` up to 100 times as many.
"""

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks._data import contactnets_folder

SHIFT = 100_000
"""Seconds from bag to bag; a bag of all tosses lasts some 1,000 s."""

TARGET_SECONDS, TARGET_MEGABYTES = 12.0, 1500.0
"""For one bag."""


@dataclass(frozen=True)
class Measurement:
    """One command.

    Attributes:
        bags: how many inputs.
        jobs: processes that read them.
        options: of `rank`, other than inputs and output.
        tosses: in them.
        seconds: from process start to end, the best of the repetitions.
        milliseconds_per_toss: the same by toss.
        megabytes: most memory that any of its processes held.
    """

    bags: int
    jobs: int
    options: str
    tosses: int
    seconds: float
    milliseconds_per_toss: float
    megabytes: float


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--full", action="store_true", help="up to 100 bags: needs 600 MB of disk and many minutes")
    parser.add_argument("--repeats", type=int, default=3, help="repetitions of the smallest case (default 3)")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is None:
        return 0
    with TemporaryDirectory(prefix="contact-curation-bench-") as made:
        rows = measured(folder, Path(made), arguments.full, max(1, arguments.repeats))
    if arguments.json:
        print(json.dumps({"measurements": [asdict(row) for row in rows]}, indent=2))
    else:
        print_table(rows)
    return 0


def measured(source: Path, folder: Path, full: bool, repeats: int) -> list[Measurement]:
    """All cases; the bags stay from one to the next."""
    processors = os.cpu_count() or 1
    bags: list[Path] = []
    rows = []
    for count in (1, 10, 100) if full else (1, 10):
        bags += imported(source, folder, range(len(bags), count))
        again = repeats if count == 1 else 1
        rows.append(measure(bags, min(processors, count), (), again))
        if count == 10:
            rows.append(measure(bags, 1, (), 1))
        if count <= 10:
            rows.append(measure(bags, min(processors, count), ("--bound-influence",), again))
    return rows


def imported(source: Path, folder: Path, numbers: Sequence[int]) -> list[Path]:
    """All tosses as bags, each later than those before."""
    bags = [folder / f"{number}.mcap" for number in numbers]
    # In processes of their own: Linux counts what this one holds as the largest memory of the commands that it starts.
    with multiprocessing.get_context("spawn").Pool(os.cpu_count()) as makers:
        makers.starmap(import_later, [(source, bag, number * SHIFT) for number, bag in zip(numbers, bags)])
    return bags


def import_later(source: Path, bag: Path, seconds: int) -> None:
    """Imports all tosses with stamps that are so much later."""
    from contact_curation.storage.datasets.tagslam_bag import TagslamRig, import_contactnets

    usual = TagslamRig()
    import_contactnets(source, bag, rig=replace(usual, epoch_ns=usual.epoch_ns + seconds * 1_000_000_000))


def measure(bags: Sequence[Path], jobs: int, options: Sequence[str], repeats: int) -> Measurement:
    """Runs `rank` over the bags."""
    manifest = bags[0].with_name("manifest.parquet")
    command = [sys.executable, "-m", "contact_curation.cli.main", "rank", *map(str, bags), "--out", str(manifest)]
    command += ["--jobs", str(jobs), "--json", *options]
    best, megabytes, tosses = float("inf"), 0.0, 0
    for _ in range(repeats):
        begin = time.perf_counter()
        with TemporaryDirectory() as folder:
            output = Path(folder) / "report.json"
            with output.open("wb") as out:
                process = subprocess.Popen(command, stdout=out, stderr=subprocess.DEVNULL)
                _, status, usage = os.wait4(process.pid, 0)
            best = min(best, time.perf_counter() - begin)
            if status != 0:
                raise SystemExit(f"{' '.join(command)} ended with status {os.waitstatus_to_exitcode(status)}")
            tosses = len(json.loads(output.read_text())["tosses"])
        megabytes = max(megabytes, usage.ru_maxrss / 1024.0)
    return Measurement(len(bags), jobs, " ".join(options), tosses, best, 1e3 * best / tosses, megabytes)


def print_table(rows: Sequence[Measurement]) -> None:
    """For people."""
    print(f"{os.cpu_count()} processors; target for one bag: {TARGET_SECONDS:g} s, {TARGET_MEGABYTES:g} MB\n")
    print("bags  jobs  tosses  seconds  ms per toss  MB (largest process)  options")
    for row in rows:
        timing = f"{row.seconds:7.1f}  {row.milliseconds_per_toss:11.2f}  {row.megabytes:20.0f}"
        print(f"{row.bags:4d}  {row.jobs:4d}  {row.tosses:6d}  {timing}  {row.options}")


if __name__ == "__main__":
    sys.exit(main())
