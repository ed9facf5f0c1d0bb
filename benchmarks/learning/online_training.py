"""Held-out error while a real recording plays through five processes: the selected tosses are trained on, and ranks again.

ContactNets' tosses 0 to 399 are played as one bag; 400 to 569 are held out, and training tosses that are duplicates of held-out
ones are left out. Scorer and trainer begin at the same random theta (method.md 1.1), so that nobody knows the cube beforehand.

    python -m benchmarks.learning.online_training [--criteria representative longest random] [--seeds 2] [--top 16] [--rate 20]
                                         [--rows docs/results/online_training.csv] [--json]

`make figures` draws the rows.
"""

import argparse
import csv
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks._data import contactnets_folder, training_and_held_out
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel, initial_geometry
from contact_curation.contact.parameter_form import Form
from contact_curation.learning.evaluation.evaluation import EvaluationConfig, evaluate_model
from contact_curation.learning.evaluation.held_out import toss_number
from contact_curation.motion.toss import Toss
from contact_curation.session.free_domain import free_domain
from contact_curation.storage.checkpoint_file import save_model
from contact_curation.storage.datasets.tagslam_bag import import_contactnets
from contact_curation.storage.inputs.inputs import open_inputs
from test.graph.parts.graph import Graph, until

POSITION, ROTATION, LOSS = "position", "rotation", "loss"
COLUMNS = ("rule", "seed", "tosses", POSITION, ROTATION, LOSS)
TRUE_CUBE = "true cube"


@dataclass(frozen=True)
class Run:
    """One recording, played once.

    Attributes:
        criterion, seed: of the run.
        tosses: (N,) that had been recorded when each round of training ended.
        seconds: (N,) since the start of the recording.
        position, rotation, loss: (N,) means over the held-out tosses after each round; before the first the untrained model's.
        rounds: of training.
    """

    criterion: str
    seed: int
    tosses: tuple[int, ...]
    seconds: tuple[float, ...]
    position: tuple[float, ...]
    rotation: tuple[float, ...]
    loss: tuple[float, ...]
    rounds: int

    def rows(self) -> list[tuple[str, int, int, float, float, float]]:
        """As `COLUMNS` say; untrained it was from the start."""
        places = (0, *self.tosses[1:])
        return [(self.criterion, self.seed, *row) for row in zip(places, self.position, self.rotation, self.loss, strict=True)]


def folders(source: Path, into: Path) -> tuple[Path, Path]:
    """Links to what is played and to what is held out."""
    parts = training_and_held_out(source)
    made = []
    for name, chosen in (("played", parts.training), ("held_out", parts.held_out)):
        folder = into / name
        folder.mkdir()
        for toss in chosen:
            number = f"{toss_number(toss, 0)}.pt"
            (folder / number).symlink_to(source / number)
        made.append(folder)
    return made[0], made[1]


def random_model(seed: int) -> PolytopeModel:
    """ContactNets' initialisation; the board's centre as the pivot."""
    theta = initial_geometry(CONTACTNETS_CUBE, Form.PHYSICAL, np.zeros(3), np.random.default_rng(seed))
    return PolytopeModel(theta, CONTACTNETS_CUBE, Form.PHYSICAL)


def played(bag: Path, held_out: Path, criterion: str, seed: int, top: int, rate: float) -> Run:
    """Plays the bag once."""
    with TemporaryDirectory() as folder, free_domain() as domain, Graph(Path(folder), domain) as graph:
        statuses, buffers, parameters, tosses = graph.statuses(), graph.buffers(), graph.parameters(), graph.tosses()
        theta = Path(folder) / "theta.safetensors"
        save_model(theta, random_model(seed))
        graph.start("pose_ingest", rules_of=bag)
        graph.start("fisher_scorer", params=theta)
        graph.start("curator", top=top, criterion=criterion, seed=seed)
        trainer = graph.start("trainer", protocol="budgeted", params=theta, held_out=[held_out], seed=seed)
        until(
            lambda: graph.listener.node.count_publishers("/training_status") or trainer.status is not None, 60.0, "the trainer"
        )
        player = graph.start("player", bag=bag, rate=rate, wait_for=30.0, stay=True)
        moments: list[tuple[float, int]] = []
        start = time.monotonic()
        while not at_rest(player.log(), statuses, buffers, parameters):
            time.sleep(0.05)
            moments += [(time.monotonic() - start, len(tosses))] * (len(statuses) - len(moments))
            if trainer.status is not None:
                raise SystemExit(f"the trainer ended:\n{trainer.log()}")
        moments += [(time.monotonic() - start, len(tosses))] * (len(statuses) - len(moments))
        heard = list(statuses)
    return Run(
        criterion,
        seed,
        tuple(recorded for _, recorded in moments),
        tuple(seconds for seconds, _ in moments),
        tuple(status.position_error for status in heard),
        tuple(status.rotation_error for status in heard),
        tuple(status.held_out_loss for status in heard),
        len(heard) - 1,
    )


def at_rest(log: str, statuses: Sequence[Any], buffers: Sequence[Any], parameters: Sequence[Any]) -> bool:
    """Whether the recording is over, everything was curated at the newest theta, and nothing is left to train."""
    if "played" not in log or not statuses or not parameters:
        return False
    newest = buffers[-1].parameters_version == parameters[-1].version == statuses[-1].parameters_version
    return bool(newest and statuses[-1].state == "waiting")


def floors(held_out: Path) -> dict[str, float]:
    """What the true cube reaches."""
    tosses = [one for one in open_inputs([held_out], CONTACTNETS_CUBE) if isinstance(one, Toss)]
    true = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), CONTACTNETS_CUBE, Form.PHYSICAL)
    found = evaluate_model(true, tosses, EvaluationConfig())
    return {
        POSITION: float(found.errors.position.mean()),
        ROTATION: float(found.errors.rotation.mean()),
        LOSS: found.mean_loss,
    }


def print_table(runs: Sequence[Run], level: dict[str, float]) -> None:
    """One line a run."""
    places = (0, 25, 50, 100, 1 << 30)
    print("position error [% of width] after 0, 25, 50, 100 and all tosses; rotation error [deg] after 0 and all")
    print(f"{'criterion':12s}{'seed':>5s}{'rounds':>8s}{'time [s]':>10s}")
    for run in runs:
        at = [max(0, int(np.searchsorted(run.tosses, place, side="right")) - 1) for place in places]
        positions = "".join(f"{run.position[k]:9.1f}" for k in at)
        rotations = f"{run.rotation[0]:9.1f}{run.rotation[-1]:9.1f}"
        print(f"{run.criterion:12s}{run.seed:5d}{run.rounds:8d}{run.seconds[-1]:10.0f}  {positions}  {rotations}")
    print(f"true cube: position {level[POSITION]:.1f} %, rotation {level[ROTATION]:.1f} deg, loss {level[LOSS]:.4f}")


def main() -> int:
    """Prints a table, or JSON, and writes rows where they are wanted."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--criteria", nargs="+", default=["representative", "longest", "random"])
    parser.add_argument("--seeds", type=int, default=2, help="how many (default 2)")
    parser.add_argument("--top", type=int, default=16, help="tosses selected (default 16)")
    parser.add_argument("--rate", type=float, default=20.0, help="times real time (default 20)")
    parser.add_argument("--rows", type=Path, help="CSV file")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args()
    source = contactnets_folder()
    if source is None:
        return 0
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    with TemporaryDirectory() as place:
        played_folder, held_out = folders(source, Path(place))
        bag = Path(place) / "played.mcap"
        import_contactnets(played_folder, bag)
        cases = [(criterion, seed) for seed in range(arguments.seeds) for criterion in arguments.criteria]
        runs = [played(bag, held_out, *case, arguments.top, arguments.rate) for case in cases]
        level = floors(held_out)
    if arguments.rows:
        with arguments.rows.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([COLUMNS, *(row for run in runs for row in run.rows())])
            writer.writerow((TRUE_CUBE, 0, 0, *(level[name] for name in COLUMNS[3:])))
    if arguments.json:
        print(json.dumps({"true_cube": level, "runs": [asdict(run) for run in runs]}, indent=1))
    else:
        print_table(runs, level)
    return 0


if __name__ == "__main__":
    sys.exit(main())
