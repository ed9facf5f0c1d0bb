"""What histories need of physics, computed once: six tosses of a small body, their information at four thetas, rankings.

Scoring and ranking are real; each result is remembered by all that it depends on. Training is a script: the number of the theta
at the end of a round follows from the one at its beginning and from the selected tosses. What a kill changes in the numbers of
a real training is tested with the stage itself (`test/stages/test_training.py`).
"""

import json
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS, LossConfig
from contact_curation.design.designer import Realised
from contact_curation.design.throw import Throw
from contact_curation.information.curation import Curation, curate
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.information.scoring import NotScored, Scorer, ScoringConfig
from contact_curation.learning.training.progress import Progress, TrainingState
from contact_curation.motion.toss import Toss, toss_identity
from contact_curation.pipeline.ranking import RankConfig, rank_tosses
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.scoring import PoolConfig
from contact_curation.pipeline.tosses import Tosses
from contact_curation.stages.scored_theta import ScoredTheta, theta_of_geometry
from contact_curation.storage.parameters_file import Parameters
from test.simulated import simulated_tosses

CORNERS = 0.05 * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
BODY = Body("tetrahedron", CORNERS, 0.2, np.full(3, 2e-4), 0.3, 0.05)
COUNT, THETAS = 6, 4


@cache
def bases() -> tuple[Toss, ...]:
    """The tosses, at the times of their own."""
    return simulated_tosses(COUNT, seed=11, body=BODY)


@cache
def toss(number: int, later_ns: int = 0) -> Toss:
    """A toss that a clock says to be later than it was."""
    base = bases()[number]
    stamps = base.stamps_ns + later_ns
    return replace(base, stamps_ns=stamps, toss_id=toss_identity(BODY.name, base.source, int(stamps[0])))


@cache
def geometry(number: int) -> ContactGeometry:
    """One of the thetas."""
    true = ContactGeometry.of_body(BODY)
    return replace(true, vertices_normal=true.vertices_normal * (1.0 + 0.01 * number))


@cache
def theta(number: int) -> ScoredTheta:
    return theta_of_geometry(geometry(number))


class Remembering:
    """The real scorer at one of the thetas, which scores each toss once.

    Args:
        number: of the theta.
    """

    def __init__(self, number: int) -> None:
        self.real = Scorer(geometry(number), BODY, ScoringConfig())
        self._known: dict[str, TossInformation | NotScored] = {}

    @property
    def version(self) -> str:
        return self.real.version

    @property
    def blocks(self) -> tuple[ParameterBlock, ...]:
        return self.real.blocks

    def score(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        for one in tosses:
            if one.toss_id not in self._known:
                self._known[one.toss_id] = self.real.score([one])[0]
        return tuple(self._known[one.toss_id] for one in tosses)


@cache
def scorer(number: int) -> Remembering:
    return Remembering(number)


@cache
def number_of(data: bytes) -> int:
    """Of a theta in its bytes."""
    return next(number for number in range(THETAS) if theta(number).data == data)


def version(number: int) -> str:
    return scorer(number).version


_curations: dict[tuple[Any, ...], Curation] = {}


def remembered_curation(candidates: Sequence[TossInformation], config: RankingConfig) -> Curation:
    """The curator's ranking, of candidates in this very order."""
    key = (*(one.toss_id for one in candidates), candidates[0].parameters_version, repr(config))
    if key not in _curations:
        _curations[key] = curate(candidates, config)
    return _curations[key]


@cache
def ranked(tosses: frozenset[tuple[int, int]], number: int, config: RankingConfig) -> tuple[str, ...]:
    """What `rank` selects, best first."""
    pool = PoolConfig(ReadingConfig(BODY), (Parameters(geometry(number), BODY),), ScoringConfig())
    source = Tosses.of([toss(*one) for one in sorted(tosses)], BODY)
    curation = rank_tosses(source, RankConfig(pool, config, jobs=1)).curation
    assert curation is not None
    return curation.ranking.selected_ids


@dataclass(frozen=True)
class Script:
    """Of training.

    Attributes:
        exact: each round begins at the same theta.
        steps: of a round.
        form: of the parameters, which nobody asks for.
        restitution: whether one is learned.
        loss: that it minimises, which nothing computes.
    """

    exact: bool
    steps: int = 2
    form: str = ""
    restitution: bool = False
    loss: LossConfig = DEFAULT_LOSS


@dataclass(frozen=True)
class ThetaModel:
    """A model that is one of the thetas."""

    number: int
    body = BODY
    kind = "polytope"

    def geometry(self) -> ContactGeometry:
        return geometry(self.number)


@dataclass
class ScriptedTraining:
    """As much of a training as its stage asks for."""

    model: ThetaModel
    data: Any
    held_out: None
    config: Script
    seed: int
    steps: int = 0
    end: int = -1
    at_optimum: bool = False

    def __post_init__(self) -> None:
        self.end = self.config.steps if self.end < 0 else self.end

    @property
    def counters(self) -> Progress:
        state = TrainingState.SPENT if self.steps >= self.end else TrainingState.RUNNING
        return Progress(self.steps, 0, 0.0, 0.0, 0.0, 0, state, "")

    @property
    def progress(self) -> Progress:
        return self.counters

    def advance(self, steps: int) -> Progress:
        self.steps = min(self.steps + steps, self.end)
        if self.steps == self.end:
            before = 0 if self.config.exact else self.model.number
            self.model = ThetaModel(zlib.crc32(repr((before, sorted(self.data.ids))).encode()) % THETAS)
        return self.counters

    def replace_data(self, data: Any, *, fresh_budget: bool) -> None:
        self.data, self.end = data, self.steps + self.config.steps

    def trained(self) -> ThetaModel:
        return self.model

    def displaced(self) -> str:
        return ""


class ScriptedDesigner:
    """As much of a designer as its stage asks for: it explores until two tosses are known at a theta."""

    def __init__(self, body: Body, *_: Any) -> None:
        self.body = body

    def particle(self, theta: ContactGeometry) -> Any:
        return SimpleNamespace(version=version(number_of(theta_of_geometry(theta).data)))

    def planner(self, particle: Any) -> Any:
        return SimpleNamespace(version=particle.version, reference_scores=lambda: np.arange(2.0))

    def unready_reason(self, losses: Sequence[float], known: Sequence[Any], scores: Callable[[], Sequence[Any]]) -> str | None:
        return None if len(losses) >= 2 and scores() else "too few tosses"

    def explore(self, name: str, *_: Any) -> Throw:
        return _throw(name)


class ScriptedDesign:
    """Its plans gain as much as they say; what their tosses gain is their trace."""

    def __init__(self, planner: Any, *_: Any) -> None:
        self.planner = planner

    def plan(self, names: Sequence[str], seed: int) -> Any:
        return SimpleNamespace(throws=[self.predicted(_throw(name)) for name in names])

    def predicted(self, throw: Throw) -> Throw:
        return replace(throw, expected_information=1.0, parameters_version=self.planner.version)

    def add(self, throw: Throw, realised: Sequence[TossInformation]) -> Realised:
        return Realised(throw.throw_id, realised[0].toss_id, throw.expected_information, realised[0].trace)


def _throw(name: str) -> Throw:
    turn, still = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    return Throw(name, BODY.name, np.array([0.0, 0.0, 0.2]), turn, still, still)


def transitions(tosses: Sequence[Toss], length_scale: float) -> Any:
    """Training data that knows which tosses it is of."""
    return SimpleNamespace(ids=tuple(one.toss_id for one in tosses), before=None, after=None, dt=None)


def save_checkpoint(path: Path, training: ScriptedTraining, notes: dict[str, str]) -> None:
    own = {"number": training.model.number, "steps": training.steps, "end": training.end, "seed": training.seed}
    path.write_text(json.dumps({"notes": notes, "exact": training.config.exact, **own}))


def read_notes(path: Path) -> dict[str, str]:
    return dict(json.loads(path.read_text())["notes"])


def read_model(path: Path) -> ThetaModel:
    return ThetaModel(json.loads(path.read_text())["number"])


def resume_training(path: Path, data: Any, held_out: None) -> ScriptedTraining:
    found = json.loads(path.read_text())
    model, script = ThetaModel(found["number"]), Script(found["exact"])
    return ScriptedTraining(model, data, None, script, found["seed"], found["steps"], found["end"])
