"""Ranks ContactNets' tosses from their files and from the bag that `import contactnets` writes: are the same tosses selected?

    python -m benchmarks.data.import_parity [--json]

Three pools: the files; the files, each turned back by its yaw (`motion.restored_toss`); the bag, read and segmented as any.
The bag against the files turned back shows what the way over the bag does to a ranking. Against the files themselves, places
change for other reasons:

- a tilt of the ground has a direction, which the files' random yaw has mixed up; the bag's tosses lie on the rig's own board:
  this moves log-det, min-eig, orthogonal and leverage, and leaves the trace alone;
- `longest` knows true durations, where the files only have frames, and ties of those go by id;
- some public tosses are one recording twice; they tie, and `trace` sorts them by the last bit.

Tosses are named after their files here: by the bag's own ids `random` shuffles other names, and ties go another way. The tosses
are found through CONTACTNETS_DATA.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks._data import contactnets_folder
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.evaluation import Estimator
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.geometry.quaternions import Array
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig, criterion_names, rank_particles
from contact_curation.information.ranking import Ranking
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.restored_toss import restored
from contact_curation.motion.toss import Toss
from contact_curation.storage.datasets.contactnets import read_contactnets
from contact_curation.storage.datasets.tagslam_bag import import_contactnets
from contact_curation.storage.inputs.inputs import open_inputs

TOP = 32
SAME_SCORE = 1e-6
"""Scores that differ less are equal (relative to the largest); stamps are rounded to nanoseconds."""


@dataclass(frozen=True)
class Velocities:
    """How near the bag's velocities are to the files', turned back; of each frame, relative to its speed.

    Attributes:
        tosses: how many.
        frames: of the tosses.
        steps: between frames.
        timed_steps: whose true period is certain.
        linear: 50, 99, 99.9 and 100 % of the frames are at most this far off.
        angular: likewise.
        within: share of the frames within 1e-6 in both.
    """

    tosses: int
    frames: int
    steps: int
    timed_steps: int
    linear: tuple[float, ...]
    angular: tuple[float, ...]
    within: float


@dataclass(frozen=True)
class Parity:
    """Two rankings' selected sets.

    Attributes:
        estimator: of the information.
        criterion: of the ranking.
        compared: what the bag's is compared with.
        common: tosses that both select, of `TOP`.
        same_order: whether the selected tosses are in the same order.
        ties_only: whether all places that differ are swaps of equal scores.
        first_other: the first place that differs, None if none does.
        score_difference: largest relative difference of two scores of one toss.
    """

    estimator: str
    criterion: str
    compared: str
    common: int
    same_order: bool
    ties_only: bool
    first_other: int | None
    score_difference: float


def main() -> int:
    """Prints tables, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    arguments = parser.parse_args()
    folder = contactnets_folder()
    if folder is None:
        return 0
    tosses = sources(folder)
    velocities, rows = compared_velocities(tosses), parities(tosses)
    if arguments.json:
        print(json.dumps({"velocities": asdict(velocities), "rankings": [asdict(row) for row in rows]}, indent=2))
    else:
        print_tables(velocities, rows)
    return 0


@dataclass(frozen=True, eq=False)
class Sources:
    """The same tosses from three places, each named after its file's number.

    Attributes:
        files: as they are.
        turned: the files' velocities on the rig's board, with the true stamps.
        bag: out of the imported bag.
        steps: between frames.
        timed_steps: whose true period is certain.
    """

    files: tuple[Toss, ...]
    turned: tuple[Toss, ...]
    bag: tuple[Toss, ...]
    steps: int
    timed_steps: int


def sources(folder: Path) -> Sources:
    """Reads the files, imports them, and reads the bag.

    The bag's tosses come in the order of the files, and are named after them: ties of a ranking go by id.
    """
    files = [item for item in read_contactnets(folder) if isinstance(item, Toss)]
    with TemporaryDirectory(prefix="contact-curation-bench-") as made:
        report = import_contactnets(folder, Path(made) / "tosses.mcap")
        bag = [item for item in open_inputs([Path(made) / "tosses.mcap"], CONTACTNETS_CUBE) if isinstance(item, Toss)]
    named = (replace(toss, toss_id=file.toss_id) for toss, file in zip(bag, files, strict=True))
    turned = (restored(file).toss for file in files)
    return Sources(tuple(files), tuple(turned), tuple(named), report.steps, report.timed_steps)


def compared_velocities(tosses: Sources) -> Velocities:
    """The bag's against the files', turned back."""
    linear = relative_differences(tosses, "linear_velocities")
    angular = relative_differences(tosses, "angular_velocities")
    shares = (50, 99, 99.9, 100)
    return Velocities(
        tosses=len(tosses.bag),
        frames=len(linear),
        steps=tosses.steps,
        timed_steps=tosses.timed_steps,
        linear=tuple(float(value) for value in np.percentile(linear, shares)),
        angular=tuple(float(value) for value in np.percentile(angular, shares)),
        within=float(np.mean((linear <= 1e-6) & (angular <= 1e-6))),
    )


def relative_differences(tosses: Sources, field: str) -> Array:
    """Per frame: the difference over the speed; where both are zero, zero."""
    ours, theirs = (np.concatenate([getattr(toss, field) for toss in pool]) for pool in (tosses.bag, tosses.turned))
    speeds = np.linalg.norm(theirs, axis=1)
    off = np.linalg.norm(ours - theirs, axis=1)
    return np.asarray(np.divide(off, speeds, out=off, where=speeds > 0.0))


def parities(tosses: Sources) -> list[Parity]:
    """Every criterion and estimator."""
    rows = []
    for estimator in Estimator:
        pools = {name: scored(getattr(tosses, name), estimator) for name in ("files", "turned", "bag")}
        for criterion in criterion_names():
            config = RankingConfig(criterion, top=TOP, certificate_steps=0)
            rankings = {name: rank_particles([pool], config) for name, pool in pools.items()}
            rows += [
                parity(rankings["bag"], rankings[name], estimator, criterion, label)
                for name, label in (("turned", "files, turned back"), ("files", "files"))
            ]
    return rows


def scored(tosses: Iterable[Toss], estimator: Estimator) -> Pool:
    """A pool at the true cube."""
    scorer = Scorer(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, ScoringConfig(estimator))
    infos = [info for info in scorer.score(tuple(tosses)) if isinstance(info, TossInformation)]
    return pool_of(infos)


def parity(ours: Ranking, theirs: Ranking, estimator: Estimator, criterion: str, compared: str) -> Parity:
    """What is the same in two rankings."""
    pairs = list(zip(ours.selected_ids, theirs.selected_ids, strict=True))
    other = next((place for place, (one, another) in enumerate(pairs, 1) if one != another), None)
    scores = {entry.toss_id: entry.score for entry in theirs.entries}
    largest = max(abs(score) for score in scores.values())
    off = max(abs(entry.score - scores[entry.toss_id]) for entry in ours.entries) / largest
    common = len(set(ours.selected_ids) & set(theirs.selected_ids))
    ties = all(abs(scores[one] - scores[another]) <= SAME_SCORE * largest for one, another in pairs) and common == TOP
    return Parity(estimator.value, criterion, compared, common, other is None, ties, other, off)


def print_tables(velocities: Velocities, rows: Sequence[Parity]) -> None:
    """For people."""
    certain = f"{velocities.timed_steps} of {velocities.steps} periods certain"
    print(f"{velocities.tosses} tosses, {velocities.frames} frames; {certain}")
    print("velocities of the bag against the files', relative to the speed: 50, 99, 99.9, 100 % of the frames within")
    for name in ("linear", "angular"):
        print(f"  {name:8} " + "  ".join(f"{value:.1e}" for value in getattr(velocities, name)))
    print(f"  {100.0 * velocities.within:.2f} % of the frames within 1e-6 in both\n")
    head = f"{'the bag against':19} {'estimator':13} {'criterion':11}"
    print(f"{head} selected by both, of {TOP}   order         largest difference of a score")
    for row in sorted(rows, key=lambda one: one.compared, reverse=True):
        order = "same" if row.same_order else "ties" if row.ties_only else f"other from {row.first_other}"
        print(
            f"{row.compared:19} {row.estimator:13} {row.criterion:11} {row.common:20d}   {order:13} {row.score_difference:.1e}"
        )


if __name__ == "__main__":
    sys.exit(main())
