"""`make demo`: a recorded session replayed through the nodes on real DDS, and the same ranking from the library.

    bag ──player──> pose_ingest ──> fisher_scorer ──> curator            each a process, in a domain of its own on this machine

What the nodes find is read from their stores. With --data the ContactNets tosses in a folder are imported and replayed instead.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

from contact_curation.cli.demo_nodes import DemoFailedError, NodesRanking, Session, rank_by_nodes
from contact_curation.errors import ContactCurationError

GOLDEN_BAG = Path(__file__).resolve().parents[2] / "bags" / "golden.mcap"
LISTED = 10
"""Tosses that are printed."""


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the demo; returns its exit status."""
    parser = argparse.ArgumentParser(
        prog="contact_curation.cli.demo", description=__doc__.partition("\n")[0] if __doc__ else None
    )
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="replay the ContactNets tosses in this folder instead")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="FOLDER", help="(default out/demo)")
    arguments = parser.parse_args(argv)
    for ending in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, _interrupted)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as for the command line, see main.py
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix="contact-curation-demo-") as folder:
            show(_session(arguments, Path(folder)), arguments.out, Path(folder))
    except (ContactCurationError, OSError) as error:
        print(f"demo: error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("demo: interrupted", file=sys.stderr)
        return 130
    return 0


def show(session: Session, out: Path, folder: Path) -> None:
    """Ranks the session with the library and with the nodes, and compares.

    Args:
        session: what is shown.
        out: folder for manifest, figure and the nodes' logs.
        folder: for the nodes' stores.

    Raises:
        DemoFailedError: a node died or was silent for long, or the rankings differ.
    """
    begun = time.monotonic()
    print(f"1. The library ranks {session.bag.name}.")
    expected = _ranked_by_library(session, out)
    print(f"2. The nodes rank it: {session.bag.name} replayed at {session.rate:g} times its speed, on DDS.")
    (out / "nodes").mkdir(exist_ok=True)
    found = rank_by_nodes(session, expected["tosses"], out / "nodes", folder)
    print("3. What came out.")
    _print_ranking(found, expected)
    kept = [row["toss_id"] for row in expected["tosses"] if row["kept"]]
    rejected = {row["toss_id"]: row["reasons"] for row in expected["tosses"] if row["gated"]}
    if found.kept != kept or found.rejected != rejected:
        raise DemoFailedError(f"nodes and library disagree: found {found.kept}, expected {kept}; see {out / 'nodes'}")
    print(f"\nNodes and library agree: the same {len(kept)} tosses in the same order, the same {len(rejected)} kept back.")
    print(f"manifest: {expected['out']}\nfigure: {expected['figure']}\nlogs of the nodes: {out / 'nodes'}")
    print(f"{time.monotonic() - begun:.0f} s")


def _session(arguments: argparse.Namespace, folder: Path) -> Session:
    if arguments.data is None:
        return Session(GOLDEN_BAG, rate=5.0, top=8)
    bag = folder / "contactnets.mcap"
    print(f"0. The tosses in {arguments.data} become a bag.")
    _command("import", "contactnets", str(arguments.data), "--out", str(bag))
    return Session(bag, rate=20.0, top=32)


def _ranked_by_library(session: Session, out: Path) -> dict[str, Any]:
    """What `rank --json` says."""
    manifest = str(out / "manifest.parquet")
    output = _command("rank", str(session.bag), "--top", str(session.top), "--out", manifest, "--json")
    report: dict[str, Any] = json.loads(output)
    return report


def _command(*words: str) -> str:
    """What a command of ours prints.

    Raises:
        DemoFailedError: it fails.
    """
    done = subprocess.run(
        [sys.executable, "-m", "contact_curation.cli.main", *words], capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise DemoFailedError(done.stderr.strip().rpartition("\n")[2])
    return done.stdout


def _print_ranking(found: NodesRanking, expected: dict[str, Any]) -> None:
    """The best tosses and those that were kept back."""
    rows = {row["toss_id"]: row for row in expected["tosses"]}
    print(f"   {'rank':>4}  {'toss':<36}  {'gain':>8}  {'trace':>8}  {'time [s]':>8}")
    for place, toss_id in enumerate(found.kept[:LISTED], start=1):
        row = rows[toss_id]
        numbers = f"{row['marginal_gain']:>8.4g}  {found.traces[toss_id]:>8.4g}  {row['duration']:>8.2f}"
        print(f"   {place:>4}  {toss_id:<36}  {numbers}")
    for toss_id, reasons in found.rejected.items():
        print(f"   kept back  {toss_id}: {'; '.join(reasons)}")


def _interrupted(number: int, frame: Any) -> NoReturn:
    """SIGTERM and SIGHUP end the demo as Ctrl-C does, nodes included."""
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
