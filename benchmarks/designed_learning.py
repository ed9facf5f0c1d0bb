"""What is learned from designed throws, against random ones of the same arm: the loop in one process, throw by throw.

The simulated arm throws the described cube, a tracker with the real rig's noise looks on, and its poses become tosses by the
same rules and gates as in `pose_ingest`. After each throw a polytope that began at a random initialisation is trained on all
tosses so far, one round of the trainer's protocol; all tosses are scored again at the new theta; and the designer's own stage,
canary included, chooses the next throw. Random throws, from the same prior and as safe, teach another learner that began alike.

Held out are the real tosses 400 to 569 where they are at hand (the simulated cube is the best description of the real one that
there is), else tosses thrown in MuJoCo without an arm. Vertices and friction are compared with those of the simulated cube.

    python -m benchmarks.designed_learning [--seeds 10] [--throws 12] [--arms designed random warm-up raw] [--steps 400]
                                           [--set canary.FIELD=VALUE] [--save RUNS.jsonl] [--json]

With `--save` runs are kept, and those that are there already are not made again.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks._arm_rig import ArmRig
from benchmarks._data import contactnets_folder, training_and_held_out
from contact_curation.cli.settings import add_settings, with_settings
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.model import Rows
from contact_curation.contact.model_kind import ModelKind
from contact_curation.contact.model_rollout import roll_out_model
from contact_curation.contact.models import initial_model
from contact_curation.contact.parameter_form import Form
from contact_curation.contact.polytope_model import PolytopeModel, initial_geometry
from contact_curation.design.canary import CanaryConfig
from contact_curation.design.particle import Particle
from contact_curation.design.planner import DesignConfig, Planner
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.design.throw_prior import PUBLISHED_PRIOR, ReleasePrior, fitted_prior, published_releases, raw_prior
from contact_curation.information.record import TossInformation
from contact_curation.learning.bootstrap import BootstrapConfig, Interval, spread
from contact_curation.learning.evaluation import shape_errors
from contact_curation.learning.motion_errors import motion_errors
from contact_curation.learning.protocols import budgeted
from contact_curation.learning.training import Training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import states_of, transitions_of
from contact_curation.nodes.design_stage import ONE_THREAD, DesignStage, DesignStageConfig
from contact_curation.nodes.throw_log import Proposal
from contact_curation.sim.thrown_toss import thrown_toss
from contact_curation.storage.state_store import StateStore

BODY = CONTACTNETS_CUBE
ARMS = ("designed", "random", "warm-up", "raw")
FIRST_ROUND = 2
"""Tosses of the first round, as the trainer's."""

SIMULATED = 64
"""Held-out tosses where there are no real ones."""

MEASURES = ("position", "rotation", "vertices", "friction")


@dataclass(frozen=True)
class Moment:
    """After a throw.

    Attributes:
        throw: its number, from 1.
        warm_up: why it was no designed one; None when it was, or was never to be.
        seen: whether its motion became a toss.
        planned, realised: gain of a designed one; not a number otherwise.
        position, rotation: mean errors of held-out tosses [% of width, deg].
        vertices: root mean square [mm].
        friction: size of the error.
    """

    throw: int
    warm_up: str | None
    seen: bool
    planned: float
    realised: float
    position: float
    rotation: float
    vertices: float
    friction: float


@dataclass(frozen=True)
class Run:
    """One learner."""

    arm: str
    seed: int
    settings: str
    moments: tuple[Moment, ...]


@dataclass(frozen=True)
class Line:
    """A measure after some throws: median over the seeds of an arm, and of its difference to random throws.

    Attributes:
        arm, throws, measure: which.
        value: of the arm.
        difference: to random throws, seed by seed.
        ratio: median over the seeds of the ratio to random throws.
        better: share of the seeds in which it is less than that of random throws.
    """

    arm: str
    throws: int
    measure: str
    value: Interval
    difference: Interval
    ratio: float
    better: float


@dataclass(frozen=True, eq=False)
class Shared:
    """What all runs share.

    Attributes:
        held_out: tosses that nobody learns from.
        prior: of throws.
        raw: the paper's.
        config: of the designer.
        steps: of a round of training.
    """

    held_out: tuple[Toss, ...]
    prior: ReleasePrior
    raw: ReleasePrior
    config: DesignStageConfig
    steps: int

    def settings(self, arm: str) -> str:
        """What a run of an arm hangs on."""
        return f"{self.steps} steps" + (f", {self.config.canary}" if arm == "designed" else "")


def shared_by_all(config: DesignStageConfig, steps: int) -> Shared:
    """With real tosses where they are at hand."""
    folder = contactnets_folder()
    if folder is None:
        releases = published_releases(SIMULATED, np.random.default_rng(13))
        throws = [throw_of_state(f"held-out-{k}", BODY.name, state) for k, state in enumerate(releases)]
        held_out = tuple(thrown_toss(BODY, throw, first_stamp_ns=k) for k, throw in enumerate(throws))
        return Shared(held_out, PUBLISHED_PRIOR, raw_prior(published_releases(570, np.random.default_rng(0))), config, steps)
    parts = training_and_held_out(folder)
    releases = np.array([states_of(toss, 1.0)[0] for toss in parts.training])
    return Shared(tuple(parts.held_out), fitted_prior(releases), raw_prior(releases), config, steps)


class Learner:
    """A polytope that is trained on all tosses so far, one round of the trainer's protocol per toss.

    Args:
        seed: of its initialisation and shuffles.
        steps: of a round.
    """

    def __init__(self, seed: int, steps: int) -> None:
        self._seed, self._steps = seed, steps
        self._training: Training | None = None
        self.tosses: list[Toss] = []

    @property
    def geometry(self) -> ContactGeometry:
        """Theta; before the first round the initialisation."""
        if self._training is None:
            return initial_geometry(BODY, Form.PHYSICAL, np.zeros(3), np.random.default_rng(self._seed))
        model = self._training.trained()
        assert isinstance(model, PolytopeModel)
        return model.geometry()

    @property
    def trained(self) -> bool:
        """Whether there was a round."""
        return self._training is not None

    def learn(self, toss: Toss) -> None:
        """A round with one toss more."""
        self.tosses.append(toss)
        if len(self.tosses) < FIRST_ROUND:
            return
        data = transitions_of(self.tosses, BODY.length_scale)
        if self._training is None:
            rng = np.random.default_rng(self._seed)
            model = initial_model(ModelKind.POLYTOPE, BODY, Form.PHYSICAL, Rows(data.before, data.after, data.dt), rng)
            config = replace(budgeted(ModelKind.POLYTOPE), steps=self._steps, evaluation_steps=self._steps, loss=ONE_THREAD)
            self._training = Training(model, data, None, config, self._seed)
        else:
            self._training.replace_data(data, fresh_budget=True)
        self._training.advance(self._steps)

    def infos(self, tosses: Sequence[Toss]) -> list[tuple[TossInformation, int]]:
        """What tosses teach at theta, and their last stamps."""
        scored = Particle(self.geometry, BODY, ONE_THREAD).scorer.score(tosses)
        pairs = zip(scored, tosses, strict=True)
        return [(info, int(toss.stamps_ns[-1])) for info, toss in pairs if isinstance(info, TossInformation)]


class Loop:
    """One learner, its arm and its designer.

    Args:
        arm: how throws are chosen.
        seed: of all that is random.
        shared: what all runs share.
        states: of the designer.
    """

    def __init__(self, arm: str, seed: int, shared: Shared, states: StateStore) -> None:
        self._rig, self._learner, self._shared = ArmRig(BODY, seed), Learner(seed, shared.steps), shared
        config = shared.config
        self._stage = DesignStage(BODY, config, states, prior=shared.prior, feasible=self._rig.feasibility)
        self._seed, self._designs = seed, arm == "designed"
        self._random: list[Throw] = []
        if arm in ("random", "raw"):
            prior = shared.raw if arm == "raw" else shared.prior
            planner = Planner([Particle(ContactGeometry.of_body(BODY), BODY, ONE_THREAD)], prior)
            self._random = self._rig.random_throws(planner, 64, seed, arm)

    def throw(self, number: int) -> Moment:
        """Throws, learns, looks."""
        proposal = self._next()
        self._stage.begin(proposal)
        seen = self._rig.throw(proposal.throw)
        self._stage.finish(seen.executed, self._rig.released_ns)
        if seen.toss is not None:
            self._taken(seen.toss)
        made = self._stage.throws[-1]
        gains = (made.realised.planned, made.realised.realised) if made.realised else (np.nan, np.nan)
        return Moment(number, proposal.warm_up, seen.toss is not None, *gains, *self._errors())

    def _next(self) -> Proposal:
        if self._random:
            return Proposal(self._random.pop(0), "chosen at random")
        return self._stage.propose()

    def _taken(self, toss: Toss) -> None:
        """As the nodes do: scored at the theta that there is, trained on, and everything scored at the new theta."""
        for info, stamp_ns in self._learner.infos([toss]):
            self._stage.add(info, stamp_ns)
        self._learner.learn(toss)
        self._stage.keep([one.toss_id for one in self._learner.tosses])
        if self._learner.trained and self._designs:
            self._stage.renew(self._learner.geometry)
            for info, stamp_ns in self._learner.infos(self._learner.tosses):
                self._stage.add(info, stamp_ns)

    def _errors(self) -> tuple[float, float, float, float]:
        model = PolytopeModel(self._learner.geometry, BODY, Form.PHYSICAL)
        states = [states_of(toss, BODY.length_scale) for toss in self._shared.held_out]
        periods = np.array([toss.frame_period for toss in self._shared.held_out])
        rolled = roll_out_model(model, np.stack([one[0] for one in states]), np.array([len(one) for one in states]), periods)
        errors = motion_errors(rolled.states, np.concatenate(states), rolled.starts, BODY)
        shape = shape_errors(model)
        assert shape is not None
        position, rotation = (float(np.nanmean(values)) for values in (errors.position, errors.rotation))
        return position, rotation, shape.vertex_rms_mm, abs(shape.friction_error)


def run(arm: str, seed: int, throws: int, shared: Shared) -> Run:
    """One learner from its first throw to its last."""
    config = shared.config
    if arm == "warm-up":  # for ever
        config = replace(config, canary=replace(config.canary, least_tosses=1 << 30, most_tosses=0))
    with TemporaryDirectory() as folder, StateStore(Path(folder) / "throws.sqlite") as states:
        loop = Loop(arm, seed, replace(shared, config=config), states)
        return Run(arm, seed, shared.settings(arm), tuple(loop.throw(number + 1) for number in range(throws)))


def lines(runs: Sequence[Run], throws: Sequence[int]) -> list[Line]:
    """The table."""
    by_seed = {arm: {one.seed: one for one in runs if one.arm == arm} for arm in ARMS}
    found = []
    for arm in ARMS:
        for count in throws:
            for measure in MEASURES:
                found += _line(by_seed[arm], by_seed["random"], arm, count, measure)
    return found


def _line(ours: dict[int, Run], theirs: dict[int, Run], arm: str, count: int, measure: str) -> list[Line]:
    seeds = sorted(ours.keys() & theirs.keys())
    if not seeds:
        return []
    own, other = (np.array([getattr(runs[seed].moments[count - 1], measure) for seed in seeds]) for runs in (ours, theirs))
    config = BootstrapConfig()
    value, difference = spread(own, config).median, spread(own - other, config).median
    return [Line(arm, count, measure, value, difference, float(np.median(own / other)), float((own < other).mean()))]


def _load(path: Path | None) -> list[Run]:
    if path is None or not path.exists():
        return []
    told = [json.loads(line) for line in path.read_text().splitlines()]
    return [Run(**{**one, "moments": tuple(Moment(**moment) for moment in one["moments"])}) for one in told]


def _print(table: Sequence[Line], runs: Sequence[Run]) -> None:
    print(f"{'':<10} {'throws':>6} {'measure':<10} {'median':>24} {'less random':>26} {'ratio':>6} {'better':>7}")
    for line in table:
        cells = [f"{one.value:.3f} ({one.low:.3f} to {one.high:.3f})" for one in (line.value, line.difference)]
        tail = f"{cells[0]:>24} {cells[1]:>26} {line.ratio:6.2f} {line.better:7.0%}"
        print(f"{line.arm:<10} {line.throws:>6} {line.measure:<10} {tail}")
    designed = [one for one in runs if one.arm == "designed"]
    if designed:
        first = [next((m.throw for m in one.moments if m.warm_up is None), len(one.moments) + 1) for one in designed]
        gains = [m.realised / m.planned for one in designed for m in one.moments if m.planned > 0.0]
        print(f"first designed throw: {sorted(first)}; realised / planned gain, quartiles: ", end="")
        print(np.percentile(gains, [25, 50, 75]).round(2).tolist() if gains else "none")
    print(f"throws without a toss: {sum(not moment.seen for one in runs for moment in one.moments)}")


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--throws", type=int, default=12)
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=list(ARMS[:2]))
    parser.add_argument("--steps", type=int, default=400, help="of a round of training; the trainer's are 400")
    parser.add_argument("--save", type=Path)
    parser.add_argument("--json", action="store_true")
    add_settings(parser, ("canary",))
    arguments = parser.parse_args()
    canary: CanaryConfig = with_settings({"canary": CanaryConfig()}, arguments.settings)["canary"]
    shared = shared_by_all(DesignStageConfig(DesignConfig(), canary), arguments.steps)
    runs = [one for one in _load(arguments.save) if one.settings == shared.settings(one.arm)]
    for seed in range(arguments.seeds):
        for arm in arguments.arms:
            if any((one.arm, one.seed, len(one.moments)) == (arm, seed, arguments.throws) for one in runs):
                continue
            runs.append(run(arm, seed, arguments.throws, shared))
            print(f"{arm} {seed}: {runs[-1].moments[-1]}", file=sys.stderr, flush=True)
            if arguments.save is not None:
                with arguments.save.open("a") as file:
                    file.write(json.dumps(asdict(runs[-1])) + "\n")
    wanted = [one for one in runs if one.seed < arguments.seeds and len(one.moments) == arguments.throws]
    table = lines(wanted, sorted({count for count in (4, 6, 8, 12) if count <= arguments.throws} | {arguments.throws}))
    if arguments.json:
        print(json.dumps([asdict(line) for line in table]))
    else:
        _print(table, wanted)
    return 0


if __name__ == "__main__":
    sys.exit(main())
