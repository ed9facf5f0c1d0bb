"""The scored tosses that a curator holds in memory: all of them, or a bounded number.

`exact` keeps everything and ranks it all: the selected set is that of `contact-curation rank` on the same tosses. `streaming`
keeps what one pass can, by criteria that can select in one pass: trace, exactly; representative by a search among a bounded
number of tosses, and log-det by exchanges, which come out near `exact`. The prior of log-det comes from the first tosses.
"""

from typing import Protocol

from contact_curation.errors import InvalidValueError
from contact_curation.information.criteria.criterion import Need
from contact_curation.information.ranker import RankingConfig, criterion_named, criterion_names
from contact_curation.information.record import TossInformation

SELECTIONS = ("exact", "streaming")


class Selection(Protocol):
    """The candidates for the buffer, of tosses scored at one theta."""

    def add(self, information: TossInformation) -> None:
        """Looks at a toss."""

    @property
    def candidates(self) -> tuple[TossInformation, ...]:
        """What the buffer is chosen from."""

    @property
    def seen(self) -> int:
        """How many different tosses were added."""


class ExactSelection:
    """Everything."""

    def __init__(self) -> None:
        self._known: dict[str, TossInformation] = {}

    def add(self, information: TossInformation) -> None:
        self._known.setdefault(information.toss_id, information)

    @property
    def candidates(self) -> tuple[TossInformation, ...]:
        return tuple(self._known.values())

    @property
    def seen(self) -> int:
        return len(self._known)


class StreamingSelection:
    """What a streaming selector keeps; all of the first `prior_tosses` tosses until they have given a criterion its prior.

    Args:
        config: with a criterion that can select from a stream.
        prior_tosses: how many tosses the prior is taken from.

    Raises:
        InvalidValueError: another criterion, which is not possible in one pass.
    """

    def __init__(self, config: RankingConfig, prior_tosses: int) -> None:
        criterion = criterion_named(config.criterion)
        if criterion.stream is None:
            streamed = (name for name in criterion_names() if criterion_named(name).stream)
            raise InvalidValueError("criterion of a streaming selection", criterion.name, " or ".join(streamed))
        self._start, self._config, self._prior_tosses = criterion.stream, config, prior_tosses
        self._first: dict[str, TossInformation] = {}
        self._selector = None if Need.PRIOR in criterion.needs else self._start((), config)

    def add(self, information: TossInformation) -> None:
        if self._selector is not None:
            self._selector.offer(information)
            return
        self._first.setdefault(information.toss_id, information)
        if len(self._first) == self._prior_tosses:
            self._selector = self._start(tuple(self._first.values()), self._config)
            self._first = {}

    @property
    def candidates(self) -> tuple[TossInformation, ...]:
        return tuple(self._first.values()) if self._selector is None else self._selector.selected

    @property
    def seen(self) -> int:
        return len(self._first) if self._selector is None else self._selector.seen


def selection_of(kind: str, config: RankingConfig, prior_tosses: int) -> Selection:
    """A fresh selection of one of `SELECTIONS`.

    Raises:
        InvalidValueError: the criterion is not possible in one pass.
    """
    return ExactSelection() if kind == "exact" else StreamingSelection(config, prior_tosses)
