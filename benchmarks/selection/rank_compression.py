"""What keeping less of a factor does to rankings of the 570 real tosses: single precision, and fewer rows.

python -m benchmarks.selection.rank_compression [--json]; the tosses are found through CONTACTNETS_DATA.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from unittest.mock import patch

import numpy as np
from numpy.typing import DTypeLike

from benchmarks._data import contactnets_folder
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.information import scoring
from contact_curation.information.factors import Compression
from contact_curation.information.ranker import RankingConfig, rank
from contact_curation.information.ranking import top_overlap
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.storage.inputs.inputs import open_inputs

CRITERIA = ("log-det", "leverage", "min-eig")
"""Those that look at factors."""

TOP = 32
ROWS, WAYS = 24, (("float32", 24), ("float32", 20), ("float32", 16), ("float32", 8), ("float64", 52))
"""The default's rows, in double precision the reference; and what is compared with it."""


@dataclass(frozen=True)
class Effect:
    """What changed against double precision and 24 rows.

    Attributes:
        estimator: of the Fisher matrices.
        criterion: of the ranking.
        numbers: dtype of the factors' numbers.
        rows: kept of each factor.
        selected_in_common: share of the 32 selected tosses.
        moved: how many of all tosses stand in another place.
    """

    estimator: str
    criterion: str
    numbers: str
    rows: int
    selected_in_common: float
    moved: int


def main() -> int:
    """Prints a table, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is None:
        return 0
    tosses = [item for item in open_inputs([folder], CONTACTNETS_CUBE) if isinstance(item, Toss)]
    effects = [effect for estimator in Estimator for effect in effects_on(tosses, estimator)]
    if arguments.json:
        print(json.dumps({"effects": [asdict(effect) for effect in effects]}, indent=2))
        return 0
    print(f"{'estimator':<13}{'criterion':<10}{'numbers':<9}rows  selected in common  moved of {len(tosses)}")
    for one in effects:
        print(
            f"{one.estimator:<13}{one.criterion:<10}{one.numbers:<9}{one.rows:>4}{one.selected_in_common:>16.0%}{one.moved:>14}"
        )
    return 0


def effects_on(tosses: Sequence[Toss], estimator: Estimator) -> Iterator[Effect]:
    """The effects on rankings at the true cube."""
    full = scored(tosses, estimator)
    for criterion in CRITERIA:
        config = RankingConfig(criterion, top=TOP, certificate_steps=0)
        reference = rank(compressed(full, "float64", ROWS), config)
        for numbers, rows in WAYS:
            found = rank(compressed(full, numbers, rows), config)
            moved = sum(one != other for one, other in zip(found.ids, reference.ids, strict=True))
            yield Effect(estimator.value, criterion, numbers, rows, top_overlap(found, reference, TOP), moved)


def scored(tosses: Sequence[Toss], estimator: Estimator) -> list[TossInformation]:
    """Information with factors in full."""
    config = ScoringConfig(estimator, compression=Compression(max_rows=52))
    with patch.object(scoring, "STORED", np.float64):  # no option: nobody else may round otherwise than the others
        found = Scorer(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, config).score(tosses)
    return [one for one in found if isinstance(one, TossInformation)]


def compressed(infos: Sequence[TossInformation], numbers: DTypeLike, rows: int) -> list[TossInformation]:
    """The same information; rows are orthogonal and the strongest come first, so the first are the best."""
    return [replace(info, factor=info.factor[:rows].astype(numbers)) for info in infos]


if __name__ == "__main__":
    sys.exit(main())
