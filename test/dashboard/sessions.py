"""A session of our own making, fed record by record."""

from dataclasses import dataclass, replace

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.dashboard.evidence import SelectedSet
from contact_curation.dashboard.live.learning_view import TrainingMoment
from contact_curation.dashboard.live.screen import Screen
from contact_curation.dashboard.live.session import LiveSession
from contact_curation.dashboard.live.throw_view import ThrowMade
from contact_curation.dashboard.toss_motion import ShownTheta
from contact_curation.design.throw import Throw
from contact_curation.information.curation import Curation, curate
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import DEFAULT_CRITERION, RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.toss import Toss
from test.simulated import RIG_NOISE, simulated_tosses

BODY = CONTACTNETS_CUBE
CONFIG = ScoringConfig()


@dataclass(frozen=True, eq=False)
class Scored:
    """Tosses, and their information at a theta near the truth."""

    theta: ShownTheta
    tosses: tuple[Toss, ...]
    informations: tuple[TossInformation, ...]

    @property
    def pool(self) -> Pool:
        return pool_of(self.informations)

    def curation(self, top: int, criterion: str = DEFAULT_CRITERION, seen: int | None = None) -> Curation:
        return curate(self.informations[:seen], RankingConfig(criterion, top))


def scored(count: int, seed: int = 3) -> Scored:
    """Simulated tosses, scored."""
    tosses = simulated_tosses(count, seed, RIG_NOISE)
    true = ContactGeometry.of_body(BODY)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(true.vertices_normal.shape)
    geometry = replace(true, vertices_normal=true.vertices_normal + noise)
    scorer = Scorer(geometry, BODY, CONFIG)
    informations = [one for one in scorer.score(tosses) if isinstance(one, TossInformation)]
    return Scored(ShownTheta(scorer.version, geometry), tosses, tuple(informations))


def selected_set(curation: Curation, top: int, seen: int, version: str) -> SelectedSet:
    """The selected set of a ranking, as a curator says it."""
    entries = [entry for entry in curation.ranking.entries if entry.selected]
    ids, gains = tuple(entry.toss_id for entry in entries), tuple(float(entry.marginal_gain) for entry in entries)
    return SelectedSet(curation.ranking.criterion, top, ids, gains, version, seen)


def throw_of(toss: Toss, throw_id: str) -> Throw:
    """The throw that would give a toss."""
    return Throw(
        throw_id=throw_id,
        body=toss.body,
        position=toss.positions[0],
        orientation_wxyz=toss.orientations_wxyz[0],
        linear_velocity=toss.linear_velocities[0],
        angular_velocity=toss.angular_velocities[0],
    )


def fed(screen: Screen, made: Scored, top: int) -> LiveSession:
    """A session in which everything has happened."""
    session = LiveSession(screen, BODY, made.theta, CONFIG.loss, throws=9)
    for place, (toss, information) in enumerate(zip(made.tosses, made.informations, strict=True), start=1):
        throw, stamp_ns = throw_of(toss, f"throw-{place}"), int(toss.stamps_ns[-1])
        session.add_throw(ThrowMade("designed", "commanded", throw, 3.0, float("nan"), ""))
        session.add_toss(toss)
        session.add_information(information)
        session.set_selected(selected_set(made.curation(top, seen=place), top, place, made.theta.version), stamp_ns)
        assert session.show_ranking()
        session.add_training(TrainingMoment("training", 10 * place, 1.0 / place, 2.0 / place, 30.0, 40.0), stamp_ns)
        session.add_throw(ThrowMade("designed", "scored", throw, 3.0, 2.0, ""))
    session.add_rejected("cube-1600000500000000000-abcdef01", 33, ["found a jump, expected none"], 1_600_000_500_000_000_000)
    return session
