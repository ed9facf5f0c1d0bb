"""`contact-curation rank` from process start to manifest: seconds and memory, for the 570 real tosses and for many more.

    python -m benchmarks.speed.rank [--json] [--full] [--repeats N] [--recording BAG.mcap]

The tosses are found through CONTACTNETS_DATA, or are those of a bag that `contact-curation import contactnets` made; then only
that bag is ranked. In the same run its chunks are unpacked, and its tosses scored, without anything else: the limits. Larger
pools are the same tosses imported again with later stamps, a bag each, so that every toss has an id of its own. With `--full`
up to 100 times as many.
"""

import argparse
import json
import math
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import batched
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks._data import contactnets_folder

SHIFT = 100_000
"""Seconds from bag to bag; a bag of all tosses lasts some 1,000 s."""

TARGET_SECONDS, TARGET_MEGABYTES = 1.5, 600.0
"""To the manifest of one bag; of any number of them."""

NO_FIGURE = ("--no-figure",)


@dataclass(frozen=True)
class Measurement:
    """One command.

    Attributes:
        bags: how many inputs.
        jobs: processes that read them.
        options: of `rank`, other than inputs and output.
        tosses: in them.
        seconds: from process start to end, the best of the repetitions.
        cpu_seconds: of all its processes, likewise; a busy machine disturbs it less.
        milliseconds_per_toss: the same by toss.
        megabytes: most memory that any of its processes held.
    """

    bags: int
    jobs: int
    options: str
    tosses: int
    seconds: float
    cpu_seconds: float
    milliseconds_per_toss: float
    megabytes: float


@dataclass(frozen=True)
class Limits:
    """What ranking a bag cannot be faster than, on one thread [s].

    Attributes:
        unpacking: reading and decompressing its chunks.
        scoring: impulses, scores and Fisher matrices of its tosses.
    """

    unpacking: float
    scoring: float


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument("--full", action="store_true", help="up to 100 bags: needs 600 MB of disk and many minutes")
    parser.add_argument("--repeats", type=int, default=3, help="repetitions of the smallest case (default 3)")
    parser.add_argument("--recording", type=Path, help="rank this MCAP file only (default: bags of the public tosses)")
    arguments = parser.parse_args()
    folder = arguments.recording or contactnets_folder()
    if folder is None:
        return 0
    repeats = max(1, arguments.repeats)
    with TemporaryDirectory(prefix="contact-curation-bench-") as made:
        if arguments.recording:
            bag = Path(made) / "0.mcap"
            bag.symlink_to(arguments.recording.resolve())
            rows = [measure([bag], 1, NO_FIGURE, repeats), measure([bag], 1, (), repeats)]
        else:
            rows = measured(folder, Path(made), arguments.full, repeats)
        limits = limits_of(Path(made) / "0.mcap", repeats)
    if arguments.json:
        print(json.dumps({"limits": asdict(limits), "measurements": [asdict(row) for row in rows]}, indent=2))
    else:
        print_table(rows, limits)
    return 0


def limits_of(bag: Path, repeats: int) -> Limits:
    """Measures the limits of a bag, the best of some repetitions."""
    from contact_curation.contact.body import CONTACTNETS_CUBE
    from contact_curation.information.scoring import ScoringConfig
    from contact_curation.pipeline.reading import ReadingConfig
    from contact_curation.pipeline.scoring import BATCH, PoolConfig
    from contact_curation.pipeline.theta import thetas_of
    from contact_curation.pipeline.tosses import read_tosses

    reading = ReadingConfig(CONTACTNETS_CUBE)
    thetas = thetas_of("polytope", (), CONTACTNETS_CUBE)
    (scorer,) = PoolConfig(reading, thetas, ScoringConfig()).scorers([math.inf], jobs=os.cpu_count() or 1)
    batches = list(batched(read_tosses([bag], reading).accepted, BATCH))
    scoring = min(seconds_of(lambda: [scorer.score(tosses) for tosses in batches]) for _ in range(repeats))
    return Limits(min(seconds_of(lambda: unpack_chunks(bag)) for _ in range(repeats)), scoring)


def unpack_chunks(bag: Path) -> None:
    """Reads and decompresses all chunks of an MCAP file."""
    from contact_curation.storage.bags.file import BagFile, BagLimits
    from contact_curation.storage.bags.formats.chunks import chunk_data
    from contact_curation.storage.bags.formats.mcap import chunk_at
    from contact_curation.storage.bags.formats.mcap_records import McapDeclarations, read_summary

    file, bounds = BagFile(bag), BagLimits()
    summary = read_summary(file, McapDeclarations(), bounds)
    if summary is None:
        raise SystemExit(f"{bag}: found no index, expected one")
    for offset in summary.chunk_offsets:
        chunk_data(file, chunk_at(file, offset), bounds)
    file.close()


def seconds_of(call: Callable[[], object]) -> float:
    """How long a call takes."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def measured(source: Path, folder: Path, full: bool, repeats: int) -> list[Measurement]:
    """All cases; the bags stay from one to the next."""
    processors = os.cpu_count() or 1
    bags: list[Path] = []
    rows = []
    for count in (1, 10, 100) if full else (1, 10):
        bags += imported(source, folder, range(len(bags), count))
        again = repeats if count == 1 else 1
        rows.append(measure(bags, min(processors, count), NO_FIGURE, again))
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
    # An installed command has its bytecode; without it, compiling the modules takes longer than reading a bag.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    best, cpu, megabytes, tosses = float("inf"), float("inf"), 0.0, 0
    for _ in range(repeats):
        begin = time.perf_counter()
        with TemporaryDirectory() as folder:
            output = Path(folder) / "report.json"
            with output.open("wb") as out:
                process = subprocess.Popen(command, stdout=out, stderr=subprocess.DEVNULL, env=environment)
                _, status, usage = os.wait4(process.pid, 0)
            best, cpu = min(best, time.perf_counter() - begin), min(cpu, usage.ru_utime + usage.ru_stime)
            if status != 0:
                raise SystemExit(f"{' '.join(command)} ended with status {os.waitstatus_to_exitcode(status)}")
            tosses = len(json.loads(output.read_text())["tosses"])
        megabytes = max(megabytes, usage.ru_maxrss / 1024.0)
    return Measurement(len(bags), jobs, " ".join(options), tosses, best, cpu, 1e3 * best / tosses, megabytes)


def print_table(rows: Sequence[Measurement], limits: Limits) -> None:
    """For people."""
    print(f"{os.cpu_count()} processors; target for one bag, without a figure: {TARGET_SECONDS:g} s, {TARGET_MEGABYTES:g} MB")
    least = limits.unpacking + limits.scoring
    print(f"one bag: unpacking alone {limits.unpacking:.2f} s, scoring alone {limits.scoring:.2f} s, one thread")
    print(f"one bag, without a figure: {rows[0].seconds / least:.1f} times both together\n")
    print("bags  jobs  tosses  seconds  cpu s  ms per toss  MB (largest process)  options")
    for row in rows:
        timing = f"{row.seconds:7.1f}  {row.cpu_seconds:5.1f}  {row.milliseconds_per_toss:11.2f}  {row.megabytes:20.0f}"
        print(f"{row.bags:4d}  {row.jobs:4d}  {row.tosses:6d}  {timing}  {row.options}")


if __name__ == "__main__":
    sys.exit(main())
