"""The rules that experiments compare, by the names that tables show (method.md 1.12)."""

from dataclasses import dataclass

from contact_curation.contact.evaluation import Estimator
from contact_curation.information.ranker import DEFAULT_CRITERION, RankingConfig, criterion_names
from contact_curation.information.scoring import ScoringConfig

PUBLIC_HELD_OUT = "400-569"
"""Numbers of ContactNets' tosses that are for evaluation only."""

BUDGET = 400
"""Gradient steps of the budgeted protocol (method.md, appendix A)."""


@dataclass(frozen=True)
class Rule:
    """How tosses are selected.

    Attributes:
        criterion, variant: as in `RankingConfig`.
        estimator: of the information that it ranks by.
        reranked: whether the set is selected again at what was learned from it.
        by_polytope: whether a polytope, fitted to the optimum, selects for whatever learns: a network then learns from what is
            known before it is made, and no pool has to be scored by it.
        redrawn: whether it keeps other tosses whenever a re-ranked rule might. Such a rule has a model see more tosses than it
            keeps; this is what that alone is worth.
    """

    criterion: str
    estimator: Estimator = Estimator.GAUSS_NEWTON
    reranked: bool = True
    variant: str = "pivoted"
    by_polytope: bool = False
    redrawn: bool = False

    def ranking(self, top: int, seed: int) -> RankingConfig:
        """For so many tosses; the seed is that of random ones."""
        return RankingConfig(self.criterion, top, seed, variant=self.variant, certificate_steps=0)

    def scoring(self) -> ScoringConfig:
        """How tosses are scored for it."""
        return ScoringConfig(self.estimator)


_OWN = {
    "random": Rule("random", reranked=False),
    "random-redrawn": Rule("random", redrawn=True),
    "longest": Rule("longest", reranked=False),
    "trace-static": Rule("trace", Estimator.EMPIRICAL, reranked=False),
    "trace": Rule("trace", Estimator.EMPIRICAL),
    "orthogonal": Rule("orthogonal", Estimator.EMPIRICAL),
    "orthogonal-literal": Rule("orthogonal", Estimator.EMPIRICAL, variant="literal"),
    "trace-by-polytope": Rule("trace", Estimator.EMPIRICAL, by_polytope=True),
    "representative-by-polytope": Rule("representative", by_polytope=True),
    "all": Rule("random", reranked=False),
}
RULES: dict[str, Rule] = {**_OWN, **{name: Rule(name) for name in criterion_names() if name not in _OWN}}
"""Every criterion, re-ranked by Gauss-Newton information where nothing else is said; `all` keeps the whole pool."""

OURS = DEFAULT_CRITERION
BASELINES = ("random", "longest")
