"""The pool: every toss of all recordings once, with its scores, and the curation of the scored ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from contact_curation.information.criteria.explanation import explanation
from contact_curation.information.curation import Curation, curate_particles
from contact_curation.information.network.score_folder import ScoreFolder, coordinates_of
from contact_curation.information.pool import Pool, pool_of
from contact_curation.information.ranker import RankingConfig
from contact_curation.pipeline.scoring import ScoredInput
from contact_curation.pipeline.tosses import EachOnce
from contact_curation.storage.manifest.ranked import PoolToss


@dataclass(frozen=True, eq=False)
class TossPool:
    """Every toss once.

    Attributes:
        tosses: in the order of the recordings.
        left_out: what came once more, one line each.
    """

    tosses: tuple[PoolToss, ...]
    left_out: tuple[str, ...]

    @property
    def rankable(self) -> tuple[PoolToss, ...]:
        """The tosses that were scored at every theta."""
        return tuple(toss for toss in self.tosses if toss.scores and not toss.reasons)

    def curated(self, config: RankingConfig, exact_scores: ScoreFolder | None = None) -> Curation:
        """The ranking of the tosses that were scored at every theta.

        Args:
            config: how to rank.
            exact_scores: of networks, which stand in for the sketched ones.

        Raises:
            InvalidValueError: no toss, or no information.
        """
        tosses = sorted(self.rankable, key=lambda toss: toss.seen.toss_id)
        particles = range(len(tosses[0].informations)) if tosses else ()
        return curate_particles([_particle(tosses, k, exact_scores) for k in particles], config)

    def reasons(self, curation: Curation, config: RankingConfig) -> Mapping[str, str]:
        """Why each toss is selected or not, by id; while the factors can be read."""
        pool = pool_of([toss.informations[0] for toss in sorted(self.rankable, key=lambda toss: toss.seen.toss_id)])
        selected = {entry.toss_id: entry.marginal_gain for entry in curation.ranking.entries if entry.selected}
        return explanation(config.criterion, pool, selected, config).reasons


def pool_of_inputs(inputs: Sequence[ScoredInput]) -> TossPool:
    """The pool of some recordings; a toss that is in several of them belongs to the first that has it whole."""
    once = EachOnce()
    for one in inputs:
        once.add(one.reading)
    tosses = [PoolToss(taken.seen, inputs[taken.recording].scores.get(id_, ())) for id_, taken in once.taken.items()]
    return TossPool(tuple(tosses), tuple(once.left_out))


def _particle(tosses: Sequence[PoolToss], theta: int, folder: ScoreFolder | None) -> Pool:
    """The pool at one theta; with a folder, the networks' exact scores stand in it for the sketched ones."""
    infos = [toss.informations[theta] for toss in tosses]
    if folder is None:
        return pool_of(infos)
    gram = folder.gram([toss.seen.digest for toss in tosses], infos[0].parameters_version)
    return pool_of(infos, network_scores=coordinates_of(gram))
