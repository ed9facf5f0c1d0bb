"""What a criterion is: how it selects tosses, the unit and label of its numbers, and what it needs; and which ones there are.

A criterion registers itself where it is defined. Those of the package are listed in `criteria/__init__.py`; any other one is
known by its name as soon as `register` was called.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from contact_curation.configs import check_positive, set_whole_numbers
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.information.pool import Pool
from contact_curation.information.ranking import Selection
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming import Selector
from contact_curation.information.subspace import EIGENVALUE_CUT

DEFAULT_CRITERION = "representative"
"""The one to select training sets by (docs/rule.md)."""

MOST_SELECTED = 1_000_000


@dataclass(frozen=True)
class RankingConfig:
    """How tosses are ranked.

    Attributes:
        criterion: name of a registered criterion.
        top: number of tosses to select.
        seed: random seed of the criterion random.
        prior: prior information as a share of the information of the pool's mean toss (method.md 1.6).
        normalisation: normalisation of the criterion trace: sum, mean or coherent.
        variant: variant of the criterion orthogonal: pivoted, max-cosine or literal.
        whiten: whether the criterion orthogonal whitens toss scores by the pooled information first.
        centre: whether the criterion orthogonal subtracts the pool's mean score first.
        cut: eigenvalues of the pooled information below this share of the largest are not identifiable.
        certificate_steps: passes over the pool that tighten the certificate of log-det; 0 for none. Ten bring most of what
            there is and cost about as much as the selection, whatever the size of the pool: a small share of scoring it.
    """

    criterion: str = DEFAULT_CRITERION
    top: int = 32
    seed: int = 0
    prior: float = 1e-3
    normalisation: str = "sum"
    variant: str = "pivoted"
    whiten: bool = False
    centre: bool = False
    cut: float = EIGENVALUE_CUT
    certificate_steps: int = 10

    def __post_init__(self) -> None:
        criterion_named(self.criterion)
        for name, accepted in (item for one in _REGISTERED.values() for item in one.choices.items()):
            if getattr(self, name) not in accepted:
                raise UnknownNameError(f"ranking.{name}", getattr(self, name), accepted)
        set_whole_numbers(self, ("top",), 1, MOST_SELECTED, "ranking.")
        set_whole_numbers(self, ("seed", "certificate_steps"), prefix="ranking.")
        check_positive(self, ("prior",), "ranking.")
        if not 0.0 < self.cut < 1.0:
            raise InvalidValueError("ranking.cut", self.cut, "a number between 0 and 1")


class Need(Enum):
    """Data that a criterion needs beside the factors; the caller provides it.

    THETA: the tosses' information at a theta; a criterion without it ranks the same tosses alike at every theta.
    SUBSPACE: the subspace that the pool identifies: at least one toss must carry information.
    PRIOR: the prior information A0.
    EXACT_SCORES: of a network each toss's summed score itself, and not its sketch.
    """

    THETA = "theta"
    SUBSPACE = "subspace"
    PRIOR = "prior"
    EXACT_SCORES = "exact scores"


class Explanation(NamedTuple):
    """A gain and a reason for each toss of a pool, by toss id, for the dashboard.

    Attributes:
        gains: what the toss would add to the selected set.
        reasons: why it is selected or not, in a few words.
    """

    gains: Mapping[str, float]
    reasons: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class Criterion:
    """One way to select tosses.

    Attributes:
        name: on the command line, in manifests and messages, and in `RankingConfig.criterion`.
        label: what a toss's score is.
        unit: of scores and gains; empty for a plain number.
        select: selects from the same tosses scored at one theta or at several (method.md 2.4), a pool for each.
        needs: what it reads.
        stream: starts to select from a stream that is not stored whole, given the first tosses where it needs a prior;
            None for a criterion that needs the whole pool.
        certified: whether its selections carry a certificate.
        choices: fields of `RankingConfig` that only it reads, with the values they may have.
        explain: says why tosses are selected or not, given the pool and the gain of each selected toss, best first;
            None to name the criterion only.
    """

    name: str
    label: str
    unit: str
    select: Callable[[Sequence[Pool], RankingConfig], Selection]
    needs: frozenset[Need] = frozenset({Need.THETA})
    stream: Callable[[Sequence[TossInformation], RankingConfig], Selector] | None = None
    certified: bool = False
    choices: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    explain: Callable[[Pool, Mapping[str, float], RankingConfig], Explanation] | None = None

    def axis_label(self, what: str = "") -> str:
        """What an axis of scores, or of `what`, is labelled with."""
        return f"{what or self.label} [{self.unit}]" if self.unit else what or self.label

    def reads_exact_scores(self, config: RankingConfig) -> bool:
        """Whether it reads a network's score sums themselves; whitened ones are taken in the sketch's coordinates."""
        return Need.EXACT_SCORES in self.needs and not config.whiten


_REGISTERED: dict[str, Criterion] = {}


def register(criterion: Criterion, *, replace: bool = False) -> Criterion:
    """Makes a criterion known by its name.

    Args:
        criterion: to be known.
        replace: whether it may take the place of one of the same name, as in a notebook's cell that is run again.

    Returns:
        The criterion.

    Raises:
        InvalidValueError: the name is taken.
    """
    if criterion.name in _REGISTERED and not replace:
        raise InvalidValueError("name of a new criterion", criterion.name, f"none of {', '.join(_REGISTERED)}")
    _REGISTERED[criterion.name] = criterion
    return criterion


def criterion_names() -> tuple[str, ...]:
    """Names of all registered criteria, in the order of their registration."""
    return tuple(_REGISTERED)


def criterion_named(name: str) -> Criterion:
    """The registered criterion of that name; InvalidValueError where there is none."""
    if name not in criterion_names():
        raise UnknownNameError("criterion", name, _REGISTERED)
    return _REGISTERED[name]


def moved_by_theta(name: str) -> bool:
    """Whether a criterion's ranking depends on theta, so that tosses have to be scored for it."""
    return Need.THETA in criterion_named(name).needs
