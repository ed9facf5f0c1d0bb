"""representative over a stream, with bounded memory: the expected error at running sums, among a bounded number of tosses.

The expected error of a set needs only sums over all tosses (`TossSums`) and the set's own factors. So nothing of the pool is
approximated but where the search may look: among the tosses held. When they are too many, half are held further: the set
selected until then; of the others the ones with the most information, measured against the mean toss of all; and as many that
are taken at random, by a digest of their ids. The first determine what is weakly determined, the others balance the scores.

The set is searched for among the tosses held, whenever it is asked for: greedily, and from the set that was selected when
tosses were last let go. The better of the two counts. Nothing else of a search is remembered, so that the set depends
on the order in which tosses came, and not on when it was asked for.
"""

from zlib import crc32

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.information.criteria.expected_error import ExpectedError
from contact_curation.information.criteria.set_search import Looks, MeanErrors, exchanged, greedy
from contact_curation.information.optimum_shift import PoolScores, TossSums
from contact_curation.information.pool import Pool
from contact_curation.information.record import TossInformation
from contact_curation.information.streaming import Seen, checked_top
from contact_curation.information.subspace import EIGENVALUE_CUT, fisher_subspace

MOST_HELD = 1024
"""Tosses held at most, some 10 MB of factors; of selections of more than a quarter of it four times as many as are selected."""


class RepresentativeStreaming:
    """Selects k tosses of a small expected error."""

    def __init__(self, pivot: Array, top: int, prior: float, cut: float = EIGENVALUE_CUT, most_held: int = MOST_HELD) -> None:
        """Start with nothing selected.

        Args:
            pivot: (3,) about which the ground's tilt is taken, near the tosses; the result does not depend on it.
            top: k.
            prior: delta > 0: A0 is this share of the mean toss.
            cut: see `fisher_subspace`.
            most_held: tosses held at most; at least 4 k are.

        Raises:
            InvalidValueError: `top` is below 1.
        """
        self._top = checked_top(top)
        self._pivot, self._prior, self._cut = pivot, prior, cut
        self._most_held = max(most_held, 4 * top)
        self._seen = Seen()
        self._sums: TossSums | None = None
        self._held: dict[str, TossInformation] = {}
        self._before: tuple[str, ...] = ()

    def offer(self, info: TossInformation) -> None:
        """Look at one toss.

        Raises:
            InvalidValueError: it was scored at another theta than the tosses before, or of as many tosses as are held none
                carries information.
        """
        if not self._seen.is_new(info):
            return
        alone = Pool((info,), self._pivot)
        self._sums = TossSums.of(alone) if self._sums is None else self._sums + TossSums.of(alone)
        self._held[info.toss_id] = info
        if len(self._held) == self._most_held:
            self._let_go(self._errors(self._sums))

    @property
    def selected(self) -> tuple[TossInformation, ...]:
        """The tosses selected now.

        Raises:
            InvalidValueError: none of them carries information.
        """
        if self._sums is None:
            return ()
        errors = self._errors(self._sums)
        return tuple(errors.pool.infos[index] for index in self._best(errors))

    @property
    def held(self) -> int:
        """How many tosses are in memory."""
        return len(self._held)

    @property
    def seen(self) -> int:
        """How many different tosses were offered."""
        return len(self._seen)

    def _errors(self, sums: TossSums) -> ExpectedError:
        """Of sets of the tosses held, against all that were seen."""
        pool = Pool(tuple(sorted(self._held.values(), key=lambda info: info.toss_id)), self._pivot)
        coordinates = fisher_subspace(sums.fisher, pool.sketched, self._cut).per_mean_toss(sums.tosses)
        return ExpectedError.against(PoolScores.of_sums(pool, sums, coordinates, self._prior), pool, coordinates)

    def _best(self, one: ExpectedError) -> list[int]:
        errors, looks = MeanErrors((one,)), Looks(len(one.pool), self._top, len(one.pool))
        starts = [greedy(errors, min(self._top, errors.tosses), looks)]
        if self._before:
            starts.append(one.pool.indices_of(self._before).tolist())
        found = [exchanged(errors, exchanged(errors, start, looks), looks) for start in starts]
        return min(found, key=lambda selected: errors.value(errors.sums(selected)))

    def _let_go(self, errors: ExpectedError) -> None:
        selected, pool = self._best(errors), errors.pool
        places = (self._most_held // 2 - len(selected)) // 2
        traces, digests = pool.traces_in(errors.coordinates), [crc32(toss_id.encode()) for toss_id in pool.ids]
        kept = list(selected)
        for order in (np.argsort(-traces, kind="stable"), np.argsort(digests, kind="stable")):
            kept += order[~np.isin(order, kept)][:places].tolist()
        self._before = tuple(pool.ids[index] for index in selected)
        self._held = {pool.ids[index]: pool.infos[index] for index in kept}
