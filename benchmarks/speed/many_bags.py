"""`contact-curation rank` over many bags: processes of this machine, Ray, and an index, compared in one run.

    python -m benchmarks.speed.many_bags [--bags N] [--recording BAG.mcap] [--engines local ray] [--json]

Each bag holds the tosses of one recording, by default of the repository's golden bag, with later stamps, so that every toss has
an id of its own. Manifests are compared: all must be the same but for the command. What is worth something are the ratios
within the run.

Memory is looked at twice a second: that of the command itself, of the largest worker that it started (a process of the
pool, or a worker of Ray), and what all its processes together hold for themselves, those of Ray's cluster included.
"""

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.writer import BagWriter

GOLDEN = Path(__file__).resolve().parents[2] / "bags" / "golden.mcap"
SHIFT_NS = 100_000_000_000_000
"""From bag to bag."""

LOOK = 0.5
"""Seconds between two looks at the memory of processes."""

STAMP_AT = {"nav_msgs/msg/Odometry": 4, "tf2_msgs/msg/TFMessage": 8}
"""Bytes of CDR before the first stamp, by type; seconds and nanoseconds."""


@dataclass(frozen=True)
class Measurement:
    """One command.

    Attributes:
        what: engine and index.
        bags: how many inputs.
        tosses: in them.
        seconds: from process start to manifest.
        ratio: to the local engine without an index.
        cpu_seconds: of the command and the processes that it waited for; those of Ray's cluster are not among them.
        megabytes: most memory of the command itself.
        worker_megabytes: most memory of a worker; 0 where there is none.
        all_megabytes: most memory that the command and all that it started held together, without what they share.
    """

    what: str
    bags: int
    tosses: int
    seconds: float
    ratio: float
    cpu_seconds: float
    megabytes: float
    worker_megabytes: float
    all_megabytes: float


@dataclass
class Memory:
    """The most memory of a command and of the processes below it, as far as it was looked at [MB]."""

    worker: float = 0.0
    together: float = 0.0

    def watch(self, command: int, ended: threading.Event) -> None:
        """Looks every now and then until the command has ended."""
        while not ended.wait(LOOK):
            self.look(command)

    def look(self, command: int) -> None:
        """Looks at all processes now."""
        parents = {int(one.name): parent for one in Path("/proc").glob("[0-9]*") if (parent := parent_of(one))}
        below = [command]
        for process in below:
            below += [one for one, parent in parents.items() if parent == process]
        states = [state for process in below if (state := state_of(Path("/proc", str(process))))]
        self.worker = max([self.worker, *(most for works, most, _ in states if works)])
        self.together = max(self.together, sum(private for *_, private in states))


def parent_of(process: Path) -> int:
    """Number of a process's parent; 0 where it has ended."""
    try:
        return int((process / "stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


def state_of(process: Path) -> tuple[bool, float, float] | None:
    """Whether a process is a worker, its most memory and what it holds for itself [MB]; None where it ends."""
    try:
        words, lines = (process / "cmdline").read_bytes(), (process / "status").read_text().splitlines()
    except OSError:
        return None
    values = dict(line.split(":\t", 1) for line in lines if ":\t" in line)
    if "VmHWM" not in values:
        return None
    most, private = (int(values[name].split()[0]) / 1024.0 for name in ("VmHWM", "RssAnon"))
    return words.startswith(b"ray::") or b"spawn_main" in words, most, private


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--bags", type=int, default=20, help="how many (default 20)")
    parser.add_argument("--recording", type=Path, default=GOLDEN, help="an MCAP file (default: the golden bag)")
    parser.add_argument("--engines", nargs="+", default=["local", "ray"], help="which (default: local ray)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    with TemporaryDirectory(prefix="contact-curation-bench-") as folder:
        made = ((Path(folder) / f"{number:04d}.mcap", number * SHIFT_NS) for number in range(arguments.bags))
        bags = [later(arguments.recording, *each) for each in made]
        if arguments.json:
            print(json.dumps({"measurements": [asdict(row) for row in measured(bags, arguments.engines)]}, indent=2))
            return 0
        print(
            f"{os.cpu_count()} processors\n\nbags  tosses  seconds  ratio   cpu s  MB: command  worker     all  what",
            flush=True,
        )
        for row in measured(bags, arguments.engines):
            numbers = f"{row.bags:4d}  {row.tosses:6d}  {row.seconds:7.1f}  {row.ratio:5.2f}  {row.cpu_seconds:6.1f}"
            memory = f"{row.megabytes:11.0f}  {row.worker_megabytes:6.0f}  {row.all_megabytes:6.0f}"
            print(f"{numbers}  {memory}  {row.what}", flush=True)
    return 0


def later(source: Path, bag: Path, shift_ns: int) -> Path:
    """The same bag with later stamps."""
    with BagReader(source) as reader, BagWriter(bag) as writer:
        for name, values in reader.notes.items():
            if not name.endswith("numbers"):  # those are of the stamps as they were
                writer.note(name, values)
        for one in reader.raw_messages():
            at = STAMP_AT[one.type]
            seconds, nanoseconds = (int.from_bytes(one.data[place : place + 4], "little") for place in (at, at + 4))
            stamp = seconds * 1_000_000_000 + nanoseconds + shift_ns
            words = b"".join(part.to_bytes(4, "little") for part in divmod(stamp, 1_000_000_000))
            data = one.data[:at] + words + one.data[at + 8 :]
            writer.write_raw(one.topic, one.type, one.schema, data, one.log_time_ns + shift_ns, type_hash=one.type_hash)
    return bag


def measured(bags: Sequence[Path], engines: Sequence[str]) -> Iterator[Measurement]:
    """Each engine without and with an index, then with all of the index there, and with all but a tenth of the bags."""
    index = bags[0].with_name("index")
    fewer = bags[: len(bags) - max(1, len(bags) // 10)]
    local = ["--engine", "local"]
    cases = [(f"{engine}, no index", bags, ["--engine", engine]) for engine in engines]
    cases += [
        (f"local, new index, {len(fewer)} bags", fewer, [*local, "--index", str(index)]),
        ("local, the same index, all bags", bags, [*local, "--index", str(index)]),
        ("local, full index", bags, [*local, "--index", str(index)]),
        ("local, full index, other parameters", bags, [*local, "--index", str(index), "--estimator", "empirical"]),
    ]
    base, whole = 0.0, None
    for what, inputs, options in cases:
        seconds, cpu_seconds, megabytes, memory, manifest = ranked(inputs, options)
        base = base or seconds
        tosses, held = len(manifest["tosses"]), (megabytes, memory.worker, memory.together)
        yield Measurement(what, len(inputs), tosses, seconds, seconds / base, cpu_seconds, *held)
        if len(inputs) == len(bags) and "empirical" not in options:
            whole = whole or manifest
            if manifest != whole:
                raise SystemExit(f"{what}: another manifest than that of {cases[0][0]}")


def ranked(bags: Sequence[Path], options: Sequence[str]) -> tuple[float, float, float, Memory, Any]:
    """Runs `rank`; seconds by the clock and the processor, memory, and the manifest but for its command."""
    out = bags[0].with_name("manifest.json")
    command = [sys.executable, "-m", "contact_curation.cli.main", "rank", *map(str, bags), "--no-figure", "--out", str(out)]
    begin, memory = time.perf_counter(), Memory()
    process = subprocess.Popen([*command, *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    ended = threading.Event()
    watcher = threading.Thread(target=memory.watch, args=(process.pid, ended))
    watcher.start()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - begin
    ended.set()
    watcher.join()
    if status != 0:
        raise SystemExit(f"{' '.join([*command, *options])} ended with status {os.waitstatus_to_exitcode(status)}")
    manifest = json.loads(out.read_text())
    manifest.pop("command")
    return seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0, memory, manifest


if __name__ == "__main__":
    sys.exit(main())
