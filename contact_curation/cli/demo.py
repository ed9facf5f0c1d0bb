"""`make demo`: twelve throws by the simulated arm in a closed loop; or, with --data, a recording through the nodes.

Without --data it runs `contact-curation online` with the settings of config/demo.yaml, which are for two cores. One throw is
tracked with many outliers and must be rejected. The table of throws is the same in every run, at any load. With --data a
recording, or the ContactNets tosses in a folder, are replayed, and the nodes' result is compared with the library's:

    bag ──player──> pose_ingest ──> fisher_scorer ──> curator            each a process, in a separate domain on this machine
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from contact_curation.cli.main import NAME
from contact_curation.cli.main import main as command_line
from contact_curation.errors import ContactCurationError
from contact_curation.files import temporary_folder
from contact_curation.session.config import SessionFolder
from contact_curation.session.parameter_files import read_node_parameters
from contact_curation.session.replay import NodesRanking, Recording, rank_by_nodes
from contact_curation.session.supervisor import ProgramFailedError
from contact_curation.storage.inputs.inputs import is_contactnets

GOLDEN_BAG = Path(__file__).resolve().parents[2] / "bags" / "golden.mcap"
BUDGETS = Path(__file__).resolve().parents[1] / "config" / "demo.yaml"
THROWS, SELECTED = 12, 8
LISTED = 10
"""Number of tosses that are printed."""


class DemoFailedError(ContactCurationError):
    """The demo did not give the expected result."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the demo; returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="contact_curation.cli.demo", description=__doc__.partition("\n")[0] if __doc__ else None
    )
    parser.add_argument(
        "--data", type=Path, metavar="INPUT", help="replay this recording, or the ContactNets tosses of a folder"
    )
    parser.add_argument("--dashboard", action="store_true", help="keep serving the dashboard until Ctrl-C")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="FOLDER", help="(default out/demo)")
    arguments = parser.parse_args(argv)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as for the command line, see main.py
    if arguments.data is None:
        try:
            return throw(arguments.out / "session", stay=arguments.dashboard)
        except DemoFailedError as error:
            print(f"demo: error: {error}", file=sys.stderr)
            return 1
    for ending in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, _interrupted)
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        with temporary_folder("demo") as folder:
            show(_recording(arguments, folder), arguments.out, folder)
    except (ContactCurationError, OSError) as error:
        print(f"demo: error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("demo: interrupted", file=sys.stderr)
        return 130
    return 0


def throw(record: Path, *, stay: bool) -> int:
    """Runs the closed loop; the session of an earlier demo is removed.

    Args:
        record: folder of the session.
        stay: whether the dashboard is served until Ctrl-C.

    Raises:
        DemoFailedError: the throw with outliers was not rejected.
    """
    folder = SessionFolder(record)
    if folder.events.exists():
        shutil.rmtree(record)
    words = ["online", "--throws", str(THROWS), "--rate", "0", "--top", str(SELECTED), "--record", str(record)]
    words += ["--evaluate-on", str(GOLDEN_BAG), "--params-file", str(BUDGETS), "--stay" if stay else "--dashboard"]
    print(f"{THROWS} throws: designed, made by a simulated arm, tracked, scored, curated, and learned from.")
    print(f"Poses of {_spoilt()} are spoilt on purpose ({BUDGETS.name}): it has to be rejected.", flush=True)
    status = command_line(words)
    if status == 0:
        _conclude(json.loads(folder.summary.read_bytes())["summary"])
    if status == 0 and not stay:
        print("\nThe dashboard was served until now. `make demo DASHBOARD=1` keeps serving it;")
        print(f"`{Path(sys.executable).with_name('rerun')} {folder.recording}` shows this session again.")
    return status


def _spoilt() -> str:
    """Name of the throw with outliers."""
    return str(read_node_parameters(BUDGETS)["sim_camera"]["noise.spoilt_throw"])


def _conclude(summary: dict[str, Any]) -> None:
    """Prints the conclusion: that the spoilt throw was rejected, and what was learned from the others."""
    spoilt = next((one for one in summary["throws"] if one["throw"] == _spoilt()), None)
    if spoilt is None or not spoilt["outcome"].startswith("rejected"):
        found = spoilt["outcome"] if spoilt else "no such throw"
        raise DemoFailedError(f"{_spoilt()}: found {found}, expected that its spoilt poses are rejected")
    print(f"\nThrow {spoilt['number']}, spoilt on purpose, was {spoilt['outcome']}.")
    print(f"Learned: {summary['learned_sentence']}.")


def show(recording: Recording, out: Path, folder: Path) -> None:
    """Ranks the recording with the library and with the nodes, and compares.

    Args:
        recording: recording to rank.
        out: folder for manifest, figure and the nodes' logs.
        folder: folder for the nodes' stores.

    Raises:
        DemoFailedError: the nodes sent nothing for too long, or the rankings differ.
        ProgramFailedError: a command fails, or a node cannot be kept running.
    """
    begun = time.monotonic()
    print(f"1. The library ranks {recording.bag.name}.")
    expected = _ranked_by_library(recording, out)
    print(f"2. The nodes rank it: {recording.bag.name} replayed at {recording.rate:g} times its speed, on DDS.")
    (out / "nodes").mkdir(exist_ok=True)
    selected = [row["toss_id"] for row in expected["tosses"] if row["selected"]]
    found = rank_by_nodes(recording, len(expected["tosses"]), selected, out / "nodes", folder, _say)
    print("3. What came out.")
    _print_ranking(found, expected)
    rejected = {row["toss_id"]: tuple(row["reasons"]) for row in expected["tosses"] if row["rejected"]}
    if list(found.selected) != selected or found.rejected != rejected:
        raise DemoFailedError(f"nodes and library disagree: found {found.selected}, expected {selected}; see {out / 'nodes'}")
    print(f"\nNodes and library agree: the same {len(selected)} tosses in the same order, the same {len(rejected)} rejected.")
    print(f"manifest: {expected['out']}\nfigure: {expected['figure']}\nlogs of the nodes: {out / 'nodes'}")
    print(f"{time.monotonic() - begun:.0f} s")


def _recording(arguments: argparse.Namespace, folder: Path) -> Recording:
    """The input itself, or the bag that is made from a folder of ContactNets' files."""
    if not is_contactnets(arguments.data):
        return Recording(arguments.data, rate=5.0, top=SELECTED)
    bag = folder / "contactnets.mcap"
    print(f"0. The tosses in {arguments.data} become a bag.")
    verb_output("import", "contactnets", str(arguments.data), "--out", str(bag))
    return Recording(bag, rate=20.0, top=32)


def _ranked_by_library(recording: Recording, out: Path) -> dict[str, Any]:
    """The output of `rank --json`."""
    manifest = str(out / "manifest.parquet")
    output = verb_output("rank", str(recording.bag), "--top", str(recording.top), "--out", manifest, "--json")
    report: dict[str, Any] = json.loads(output)
    return report


def verb_output(*words: str) -> str:
    """Runs a verb and returns its standard output.

    Raises:
        ProgramFailedError: the verb fails; the message contains its error.
    """
    command = [sys.executable, "-P", "-m", "contact_curation.cli.main", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ProgramFailedError(done.stderr.strip().rpartition("\n")[2].removeprefix(f"{NAME}: error: "))
    return done.stdout


def _say(line: str) -> None:
    """Prints the nodes' progress."""
    print(f"   {line}", flush=True)


def _print_ranking(found: NodesRanking, expected: dict[str, Any]) -> None:
    """Prints the best tosses and the rejected ones."""
    rows = {row["toss_id"]: row for row in expected["tosses"]}
    print(f"   {'rank':>4}  {'toss':<36}  {'gain':>8}  {'trace':>8}  {'time [s]':>8}")
    for place, toss_id in enumerate(found.selected[:LISTED], start=1):
        row = rows[toss_id]
        numbers = f"{row['marginal_gain']:>8.4g}  {found.traces[toss_id]:>8.4g}  {row['duration']:>8.2f}"
        print(f"   {place:>4}  {toss_id:<36}  {numbers}")
    for toss_id, reasons in found.rejected.items():
        print(f"   rejected  {toss_id}: {'; '.join(reasons)}")


def _interrupted(number: int, frame: Any) -> NoReturn:
    """Ends the demo and its nodes on SIGTERM and SIGHUP, as on Ctrl-C."""
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
