"""What a curator keeps in memory of a stream of scored tosses: all of them, or a bounded number.

`exact` keeps everything and ranks it all: the selected set is that of `contact-curation rank` on the same tosses. `streaming`
keeps what one pass can: the k largest traces, exactly; or for log-det the better of exchanges, which come out near `exact`,
and of a sieve, which is proven to reach nearly half of the best set's value. `sieve` is that sieve alone: on real tosses it is
little better than keeping the first k. The prior of log-det comes from the first tosses.

The default criterion needs the whole pool. Where tosses are let go log-det stands in for it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from contact_curation.errors import InvalidValueError
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import LogDetPrior, log_det_prior
from contact_curation.information.ranker import DEFAULT_CRITERION, STREAMED_CRITERION, RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming.selector import Selector, TraceHeap
from contact_curation.information.streaming.sieve import SieveStreaming
from contact_curation.information.streaming.swap import GuardedSwap

SELECTIONS = ("exact", "streaming", "sieve")

LOG_DET_STREAMS: dict[str, Callable[[LogDetPrior, int], Selector]] = {"streaming": GuardedSwap, "sieve": SieveStreaming}
"""By selection, what keeps a large log-det: started with a prior and k."""

STREAMED_CRITERIA = {"streaming": ("trace", "log-det"), "sieve": ("log-det",)}


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
    """What a streaming selector keeps; all of the first `warm_up` tosses until they have given log-det its prior.

    Args:
        config: with criterion trace or log-det.
        warm_up: how many tosses the prior is taken from.
        kind: streaming or sieve; the latter for log-det only.

    Raises:
        InvalidValueError: another criterion, which is not possible in one pass.
    """

    def __init__(self, config: RankingConfig, warm_up: int, kind: str = "streaming") -> None:
        if config.criterion not in STREAMED_CRITERIA[kind]:
            raise InvalidValueError(f"criterion of a {kind} selection", config.criterion, " or ".join(STREAMED_CRITERIA[kind]))
        self._start = LOG_DET_STREAMS[kind]
        self._config = config
        self._warm_up = warm_up
        self._first: dict[str, TossInformation] = {}
        self._selector: Selector | None = None
        if config.criterion == "trace":
            self._selector = TraceHeap(config.top, config.normalisation)

    def add(self, information: TossInformation) -> None:
        if self._selector is not None:
            self._selector.offer(information)
            return
        self._first.setdefault(information.toss_id, information)
        if len(self._first) == self._warm_up:
            prior = log_det_prior(pool_of(self._first.values()), self._config.prior, self._config.cut)
            self._selector = self._start(prior, self._config.top)
            for first in self._first.values():
                self._selector.offer(first)
            self._first = {}

    @property
    def candidates(self) -> tuple[TossInformation, ...]:
        return tuple(self._first.values()) if self._selector is None else self._selector.selected

    @property
    def seen(self) -> int:
        return len(self._first) if self._selector is None else self._selector.seen


def ranking_for(kind: str, config: RankingConfig) -> RankingConfig:
    """How tosses are ranked by one of `SELECTIONS` where a configuration may not have named its criterion."""
    stands_in = kind != "exact" and config.criterion == DEFAULT_CRITERION
    return replace(config, criterion=STREAMED_CRITERION) if stands_in else config


def selection_of(kind: str, config: RankingConfig, warm_up: int) -> Selection:
    """A fresh selection of one of `SELECTIONS`.

    Raises:
        InvalidValueError: the criterion is not possible in one pass.
    """
    return ExactSelection() if kind == "exact" else StreamingSelection(config, warm_up, kind)
