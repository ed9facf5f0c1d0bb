"""ContactNets' tosses for the benchmarks, from CONTACTNETS_DATA or a `shared` folder beside the repository, and their split."""

import os
import sys
from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.learning.evaluation.held_out import HeldOutRule, NumberedToss, Split, split, toss_number
from contact_curation.motion.toss import Toss
from contact_curation.storage.inputs.inputs import open_inputs

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data" / "contactnets"

HELD_OUT = HeldOutRule(spans=((400, 569),))
"""For evaluation only."""


def contactnets_folder() -> Path | None:
    """The folder with the N.pt files; None, and a line on stderr, where there is none."""
    folder = Path(os.environ.get("CONTACTNETS_DATA", BESIDE)) / "tosses_processed"
    if folder.is_dir():
        return folder
    print(
        f"skipped: no ContactNets data in {folder}: set CONTACTNETS_DATA to the folder with tosses_processed/", file=sys.stderr
    )
    return None


def training_and_held_out(folder: Path) -> Split:
    """The tosses below 400 that no duplicate of is held out, and those from 400 on."""
    found = [one for one in open_inputs([folder], CONTACTNETS_CUBE) if isinstance(one, Toss)]
    return split([NumberedToss(one, toss_number(one, place)) for place, one in enumerate(found)], HELD_OUT)
