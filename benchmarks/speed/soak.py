"""The whole loop for long, faster than real time, with nodes killed on the way: what grows, what gets lost, what comes out.

    python -m benchmarks.speed.soak --throws 1000 --folder soak [--minutes M]

Every ten throws one of the nine nodes is killed with SIGKILL; the seed says in which order they come. A run that is stopped
(Ctrl-C, SIGTERM, or after M minutes) is gone on with by the same command; fewer throws than were made end it there. At the end:

- memory and descriptors of each process that lives long enough, late against early (throw 50, or 20 throws after its start);
- disk: what each toss took in stores, recordings and logs;
- nothing lost: every toss that pose_ingest stored is in the scorer's and the curator's store at the last theta, and was
  recorded; so was every pose that sim_camera published, once and in order; what the recorder itself says that it missed;
- the buffer: that of fresh, undisturbed nodes fed with the recorded poses at the session's last theta, and that of `rank`.

The exit status is 1 where one of these does not hold, and 3 where throws are left to be made.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from contact_curation.nodes.ros.health import node_of
from contact_curation.stages.records import BufferRecord, load_record
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.tosses import TossStore
from test.graph.parts.processes import spawn_node

NODES = (
    "pose_ingest", "fisher_scorer", "curator", "trainer", "throw_designer", "sim_arm", "sim_camera", "dashboard",
    "session_recorder",
)  # fmt: skip
EVERY = 10
"""Throws between two kills."""
POSES, STATIC = "/tagslam/odom/body_cube", "/tf_static"
BUDGETS = """
/**/trainer:
  ros__parameters: {protocol: budgeted, steps: 100, settling_rounds: 1}
/**/throw_designer:
  ros__parameters:
    design: {pool: 48, reference: 32}
    refinement: {generations: 4}
    readiness: {least_agreement: 0.0}
    toss_timeout: 3.0
    retry_period: 0.5
"""
EARLY, SETTLING = 50, 20
"""Throws of the session, and of a process, after which its memory is taken for the first time."""
ALLOWED_GROWTH = 0.01
"""Of a process's memory in a hundred throws."""
PERIOD = 1.0
"""[s] between samples."""
PATIENCE = 300.0
"""[s] that the undisturbed nodes get."""
DOMAIN = 91
UNFINISHED = 3
"""Exit status where throws are left."""


class Sample(NamedTuple):
    """Resident memory [bytes] and open descriptors of a process after so many throws."""

    throws: int
    node: str
    pid: int
    resident: int
    descriptors: int


class Session:
    """A running session, seen through its folder."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "events.jsonl"
        self._read = 0
        self.throws = 0
        self.pids: dict[str, int] = {}
        self.events: list[dict[str, Any]] = []
        self.look()
        self.pids.clear()  # of an earlier run

    @property
    def exists(self) -> bool:
        """Whether there is one already."""
        return self._path.exists()

    def look(self) -> None:
        """Reads what was added to the events."""
        if not self.exists:
            return
        with self._path.open() as file:
            file.seek(self._read)
            for line in iter(file.readline, ""):
                if not line.endswith("\n"):
                    break
                self._read += len(line.encode())
                self._take(json.loads(line))

    def _take(self, event: dict[str, Any]) -> None:
        self.events.append(event)
        if event["event"] in ("started", "restarted"):
            self.pids[event["node"]] = event["pid"]
        elif event["event"] in ("died", "stopped"):
            self.pids.pop(event["node"], None)
        self.throws += event["event"] == "throw"


class Kills:
    """Kills on the way, each node once in nine of them, in an order that the seed and its number give.

    Args:
        path: file that has a line for each; gone on with.
        seed: of the order.
    """

    def __init__(self, path: Path, seed: int) -> None:
        self._path, self._seed = path, seed
        self.made = len(path.read_text().splitlines()) if path.exists() else 0

    def due(self, throws: int) -> bool:
        """Whether the next one is."""
        return throws >= EVERY * (self.made + 1)

    def kill(self, session: Session) -> None:
        """The next node, once it runs."""
        order = np.random.default_rng((self._seed, self.made // len(NODES))).permutation(NODES)
        victim = str(order[self.made % len(NODES)])
        if victim in session.pids:
            os.kill(session.pids[victim], signal.SIGKILL)
            self.made += 1
            with self._path.open("a") as file:
                file.write(f"throw {session.throws}: {victim}\n")


def main() -> int:
    """Runs the soak, or goes on with it; returns the exit status."""
    parser = argparse.ArgumentParser(description="a long session whose nodes are killed now and then")
    parser.add_argument("--throws", type=int, default=200)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop after so long; the same command goes on")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("soak"))
    arguments = parser.parse_args()
    folder = arguments.folder
    session = soak(folder, arguments.throws, arguments.seed, 60.0 * arguments.minutes)
    kills = Kills(folder / "kills.txt", arguments.seed).made
    print(f"{session.throws} throws, {kills} kills")
    if session.throws < arguments.throws:
        print("not finished: the same command goes on; --throws with fewer than were made ends it")
        return UNFINISHED
    told = json.loads((folder / "session.json").read_text())
    print(f"{told['summary']['seconds']:.0f} s; restarts: {told['summary']['restarts']}")
    samples = [Sample(*json.loads(line)) for line in (folder / "samples.jsonl").read_text().splitlines()]
    findings = [
        *growth(samples),
        *disk(folder, told["summary"]["tosses"]),
        *lost(folder, session, told),
        *buffers(folder, told),
    ]
    for sound, line in findings:
        print(f"{'ok ' if sound else 'NOT'}  {line}")
    return 0 if all(sound for sound, _ in findings) else 1


def soak(folder: Path, throws: int, seed: int, seconds: float) -> Session:
    """Runs the session, or goes on with it, and kills."""
    folder.mkdir(parents=True, exist_ok=True)
    budgets = folder / "budgets.yaml"
    budgets.write_text(BUDGETS)
    session, kills = Session(folder), Kills(folder / "kills.txt", seed)
    command = [sys.executable, "-m", "contact_curation.cli.main", "online", "--throws", str(throws), "--rate", "0"]
    command += ["--top", "16", "--seed", str(seed), "--params-file", str(budgets), "--record", str(folder)]
    command += ["--resume"] if session.exists else []
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    end = time.monotonic() + seconds
    with (
        (folder / "online.log").open("ab") as log,
        (folder / "samples.jsonl").open("a") as samples,
        subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True) as online,
    ):
        try:
            while online.poll() is None and time.monotonic() < end:
                time.sleep(PERIOD)
                session.look()
                for node, pid in session.pids.items():
                    resident, descriptors = held(pid)
                    if resident:
                        samples.write(json.dumps(Sample(session.throws, node, pid, resident, descriptors)) + "\n")
                if kills.due(session.throws) and session.throws < throws:
                    kills.kill(session)
        except KeyboardInterrupt:
            print("stopping the session")
        finally:
            if online.poll() is None:
                online.terminate()
            status = online.wait()
    session.look()
    if status not in (0, 128 + signal.SIGINT):
        raise SystemExit(f"the session failed: {(folder / 'online.log').read_text().strip().rpartition(chr(10))[2]}")
    return session


def held(pid: int) -> tuple[int, int]:
    """Resident memory [bytes] and number of descriptors of a process; zeros once it is gone."""
    process = Path(f"/proc/{pid}")
    try:
        pages = int((process / "statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE"), len(list((process / "fd").iterdir()))
    except (FileNotFoundError, ProcessLookupError, IndexError):
        return 0, 0


def growth(samples: list[Sample]) -> Iterator[tuple[bool, str]]:
    """Of each node: its memory at the beginning and the end of the session, and the growth of its processes."""
    for node in NODES:
        lives: dict[int, list[Sample]] = {}
        for one in samples:
            if one.node == node:
                lives.setdefault(one.pid, []).append(one)
        grown = [found for found in map(_grown, lives.values()) if found]
        if not grown:
            continue
        first, last, percent = grown[0], grown[-1], float(np.median([one.percent for one in grown]))
        sizes = f"{first.before / 1e6:.0f} MB after {first.throws} throws, {last.after / 1e6:.0f} MB at the end"
        yield (
            percent <= 100.0 * ALLOWED_GROWTH,
            f"memory of {node}: {percent:+.1f} % in 100 throws (median of {len(grown)} lives), {sizes}",
        )
        more = max(one.descriptors for one in grown)
        yield more <= 0, f"descriptors of {node}: {more:+g} in a life at most"


class Growth(NamedTuple):
    """Of a process: throws at the beginning, memory then and at its end [bytes], share in 100 throws, more descriptors."""

    throws: int
    before: float
    after: float
    percent: float
    descriptors: float


def _grown(life: list[Sample]) -> Growth | None:
    """None for a process that did not live long enough."""
    first = max(EARLY, life[0].throws + SETTLING)
    early = [one for one in life if first <= one.throws < first + SETTLING // 2]
    late = [one for one in life if one.throws >= max(life[-1].throws - SETTLING // 2, first + SETTLING)]
    if not (early and late):
        return None
    before, after = (float(np.median([one.resident for one in part])) for part in (early, late))
    throws = float(np.median([one.throws for one in late])) - float(np.median([one.throws for one in early]))
    few, many = (float(np.median([one.descriptors for one in part])) for part in (early, late))
    return Growth(first, before, after, (after / before - 1.0) * 100.0 / throws, many - few)


def disk(folder: Path, tosses: int) -> Iterator[tuple[bool, str]]:
    """What was written for a toss, by kind."""
    kinds = {"stores": folder / "stores", "logs": folder / "logs"}
    sizes = {name: sum(path.stat().st_size for path in inside.rglob("*") if path.is_file()) for name, inside in kinds.items()}
    sizes["recordings"] = sum(path.stat().st_size for path in folder.glob("session.*") if path.suffix in (".mcap", ".rrd"))
    parts = ", ".join(f"{name} {size / max(tosses, 1) / 1e3:.0f} kB" for name, size in sizes.items())
    yield True, f"disk for each of {tosses} tosses: {parts}"


def lost(folder: Path, session: Session, told: dict[str, Any]) -> Iterator[tuple[bool, str]]:
    """What is somewhere and not elsewhere."""
    summary, stores = told["summary"], folder / "stores"
    with TossStore(stores / "pose_ingest.sqlite") as tosses:
        stored = {one.toss.toss_id for one in tosses.after(0, 1 << 20)}
        rejected = {one.rejected.toss.toss_id for one in tosses.rejected_after(0, 1 << 20)}
    version = summary["parameters_version"]
    for node in ("fisher_scorer", "curator"):
        with InformationStore(stores / f"{node}.sqlite") as informations:
            known = {one.information.toss_id for one in informations.all_of(version)}
        yield known == stored, f"{node} knows {len(known & stored)} of {len(stored)} tosses at the last theta"
    with BagReader(folder / "session.mcap") as bag:
        announced = {one.message.toss_id for one in bag.messages(["/toss"])}
        announced_rejected = {one.message.toss_id for one in bag.messages(["/toss_rejected"])} if rejected else set()
        health = list(bag.messages(["/diagnostics"]))
        poses = [(one.publish_time_ns, one.log_time_ns) for one in bag.raw_messages([POSES])]
        stamps = [one.message.header.stamp for one in bag.messages([POSES])]
        yield not bag.losses, f"the bag is whole {list(bag.losses) or ''}"
    yield announced == stored, f"{len(announced & stored)} of {len(stored)} tosses were recorded as announced"
    yield (
        announced_rejected == rejected,
        f"{len(announced_rejected & rejected)} of {len(rejected)} rejected motions were recorded as announced",
    )
    times = [stamp.sec * 10**9 + stamp.nanosec for stamp in stamps]
    yield bool(np.all(np.diff(times) > 0)), f"stamps of {len(times)} recorded poses increase"
    yield from _poses_of_lives([sent for sent, _ in poses], session, health)
    missed = [int(value) for message in health for value in _values(message, "/session_recorder", "lost")]
    yield not any(missed), f"the recorder missed {max(missed, default=0)} messages"


def _poses_of_lives(sent_ns: list[int], session: Session, health: list[Any]) -> Iterator[tuple[bool, str]]:
    """What sim_camera said that it published, life by life, against what was recorded of it."""
    starts = [event["wall_time"] for event in session.events if event.get("node") == "sim_camera" and "tart" in event["event"]]
    for number, (begin, end) in enumerate(zip(starts, [*starts[1:], float("inf")])):
        recorded = sum(begin <= time_ns / 1e9 < end for time_ns in sent_ns)
        said = [
            int(value)
            for message in health
            if begin <= message.log_time_ns / 1e9 < end
            for value in _values(message, "/sim_camera", "told")
        ]
        last = number == len(starts) - 1
        told = max(said, default=0)
        sound = recorded == told if last else recorded >= told
        yield sound, f"poses of sim_camera, life {number + 1}: {told} published as it last said, {recorded} recorded"


def _values(message: Any, node: str, key: str) -> list[str]:
    return [
        pair.value
        for status in message.message.status
        if node_of(status.name) == node
        for pair in status.values
        if pair.key == key
    ]


def buffers(folder: Path, told: dict[str, Any]) -> Iterator[tuple[bool, str]]:
    """The same buffer, from undisturbed nodes and from `rank`."""
    summary = told["summary"]
    yield summary["settled"], "the session came to rest"
    yield summary["same"], f"{summary['replay']}"
    selected = replayed(folder, folder / "replay", len(summary["selected"]), summary["tosses"])
    yield selected == summary["selected"], f"undisturbed nodes select the same {len(selected)} tosses in the same order"


def replayed(folder: Path, own: Path, top: int, tosses: int) -> list[str]:
    """Selected ids of fresh nodes that hear the recorded poses, at the session's last theta."""
    own.mkdir()
    parameters: dict[str, dict[str, Any]] = {
        "pose_ingest": {},
        "fisher_scorer": {"params": folder / "checkpoint.safetensors"},
        "curator": {"top": 16},
        "player": {"bag": folder / "session.mcap", "topics": [POSES, STATIC], "as_fast_as_possible": True, "stay": True,
                   "wait_for": 30.0},
    }  # fmt: skip
    nodes = []
    try:
        for name, values in parameters.items():
            store = {} if name == "player" else {"store": own / f"{name}.sqlite"}
            nodes.append(spawn_node(name, {**values, **store}, DOMAIN, own / f"{name}.log"))
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            time.sleep(PERIOD)
            found, ranked = _buffer(own)
            if ranked >= tosses and len(found) == top:
                time.sleep(2 * PERIOD)
                return _buffer(own)[0]
        return _buffer(own)[0]
    finally:
        for node in nodes:
            node.ask_to_end()
        for node in nodes:
            node.stop()


def _buffer(own: Path) -> tuple[list[str], int]:
    """Selected ids, and how many tosses were ranked."""
    store = own / "curator.sqlite"
    if not store.exists():
        return [], 0
    with InformationStore(store) as informations:
        buffer = load_record(informations.states.load, BufferRecord) or BufferRecord()
        return list(buffer.selected), informations.count(buffer.version) if buffer.version else 0


if __name__ == "__main__":
    sys.exit(main())
