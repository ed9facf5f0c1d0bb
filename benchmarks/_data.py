"""Where the benchmarks find ContactNets' tosses: CONTACTNETS_DATA, or a `shared` folder beside the repository."""

import os
import sys
from pathlib import Path

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data" / "contactnets"


def contactnets_folder() -> Path | None:
    """The folder with the N.pt files; None, and a line on stderr, where there is none."""
    folder = Path(os.environ.get("CONTACTNETS_DATA", BESIDE)) / "tosses_processed"
    if folder.is_dir():
        return folder
    print(
        f"skipped: no ContactNets data in {folder}: set CONTACTNETS_DATA to the folder with tosses_processed/", file=sys.stderr
    )
    return None
