"""Curation that can be interrupted at any time: all information is on disk, and the buffer follows from it.

Information of different thetas is never mixed. A new theta takes over once enough of the known tosses are scored at it, so
that the buffer does not shrink to a handful of tosses while the others are being scored again. New is the theta whose
information came last: a training may come back to where it was.
"""

from dataclasses import dataclass, replace

from contact_curation.configs import set_whole_numbers
from contact_curation.errors import InvalidValueError, UnknownNameError
from contact_curation.information.accumulated import Accumulated
from contact_curation.information.curation import Curation, curate
from contact_curation.information.pool import pool_of
from contact_curation.information.prior import log_det_prior
from contact_curation.information.ranker import RankingConfig
from contact_curation.information.record import TossInformation
from contact_curation.stages.records import (
    BufferRecord,
    CuratorPosition,
    Cursor,
    Stamped,
    TossHeader,
    load_record,
    stored_records,
)
from contact_curation.stages.selection import SELECTIONS, Selection, selection_of
from contact_curation.storage.stores.information import InformationStore


@dataclass(frozen=True)
class CurationConfig:
    """How the buffer is selected.

    Attributes:
        selection: exact ranks all tosses; streaming needs bounded memory and takes the criteria representative, log-det, trace.
        prior_tosses: number of first tosses that streaming keeps all, and from which log-det estimates its prior.
        coverage: a new theta replaces the old one when this share of the known tosses is scored at it.
    """

    selection: str = SELECTIONS[0]
    prior_tosses: int = 64
    coverage: float = 0.9

    def __post_init__(self) -> None:
        if self.selection not in SELECTIONS:
            raise UnknownNameError("selection", self.selection, SELECTIONS)
        set_whole_numbers(self, ("prior_tosses",), 1)
        if not 0.0 < self.coverage <= 1.0:
            raise InvalidValueError("coverage", self.coverage, "a share in (0, 1]")


@dataclass(frozen=True, eq=False)
class Buffer:
    """The selected tosses and the evidence for them.

    Attributes:
        ranking: how it was chosen.
        curation: ranking and diagnostics of the candidates.
        candidates: what was ranked.
        revision: counts changes of the selected tosses.
        seen: how many tosses were seen at this theta.
        newest_stamp_ns: of the newest toss seen.
        log_det: of the selected tosses, relative to the prior.
        frame_id: of the board.
    """

    ranking: RankingConfig
    curation: Curation
    candidates: tuple[TossInformation, ...]
    revision: int
    seen: int
    newest_stamp_ns: int
    log_det: float
    frame_id: str

    def in_words(self) -> str:
        """One line, for logs."""
        selected = self.curation.ranking.selected_ids
        best = f", best {selected[0]}" if selected else ""
        return f"buffer {self.revision}: {len(selected)} of {self.seen} tosses selected by {self.ranking.criterion}{best}"

    @property
    def efficiency_bound(self) -> float:
        """The proven lower bound on the selected set's D-efficiency against every other set of its size.

        0 where nothing is: by criteria that carry no certificate, and of tosses that were seen and let go.
        """
        certificate = self.curation.ranking.certificate
        return certificate.subset if certificate and self.seen == len(self.candidates) else 0.0


class CurationStage:
    """Selects the best tosses of one body.

    Args:
        ranking: criterion and number of tosses.
        config: how they are kept.
        informations: where everything that came, the place in the stream and the buffer are stored.
        body: its name; information of another one in the store is dropped. Empty for any.

    Raises:
        InvalidValueError: the criterion is not possible with this selection.
    """

    def __init__(self, ranking: RankingConfig, config: CurationConfig, informations: InformationStore, body: str = "") -> None:
        self._config = config
        self._informations = informations
        self._states = informations.states
        self._body = body
        self.check(ranking)
        position = load_record(self._states.load, CuratorPosition) or CuratorPosition()
        self._newest, self._most, known = position.newest, position.most, position.versions
        self._selections: dict[str, Selection] = {}
        self._order = list(informations.versions if known is None else known)
        if others := [version for version in self._order if body and self._body_at(version) not in ("", body)]:
            self._newest, self._most = Stamped(), 0
            self._order = [version for version in self._order if version not in others]
            for version in others:
                informations.drop_version(version)
        self.rank_by(ranking)

    @property
    def ranking(self) -> RankingConfig:
        """Criterion and number of tosses."""
        return self._ranking

    def rank_by(self, ranking: RankingConfig) -> None:
        """Goes on with another criterion or number of tosses."""
        selections = {version: self._of_stored(ranking, version) for version in self._order}
        self._ranking, self._selections = ranking, selections

    def check(self, ranking: RankingConfig) -> None:
        """Raises InvalidValueError where a criterion is not possible with this selection."""
        self._fresh(ranking)

    @property
    def cursor(self) -> Cursor:
        """Position after the last stored information; before the first where another body's was stored last."""
        position = load_record(self._states.load, CuratorPosition) or CuratorPosition()
        return position.cursor if position.body in ("", self._body) or not self._body else Cursor()

    def add(self, information: TossInformation, stamp_ns: int, frame_id: str) -> None:
        """Stores the information of a toss.

        Raises:
            InvalidValueError: tosses are known at the same theta, scored in another way.
        """
        self._informations.add(information)
        version = information.parameters_version
        if version not in self._selections:
            self._selections[version] = self._of_stored(self._ranking, version)
        if [version] != self._order[-1:]:
            self._order = [one for one in self._order if one != version] + [version]
        self._selections[version].add(information)
        if stamp_ns > self._newest.stamp_ns:
            self._newest = Stamped(stamp_ns, frame_id)
        self._states.save(stored_records(TossHeader(Stamped(stamp_ns, frame_id)), name=information.toss_id))

    def advance(self, cursor: Cursor) -> None:
        """Remembers that everything up to the cursor is stored, and forgets thetas that are neither ranked nor the newest.

        The theta that the buffer is ranked at stays until another one covers enough tosses, however many thetas come and go
        meanwhile. Which theta came last is remembered here and no sooner: after a death everything behind the cursor comes
        once more.
        """
        self._most = self._known()
        needed = {self._ranked_version(), *self._order[-1:]}
        forgotten = [version for version in self._order if version not in needed]
        self._order = [version for version in self._order if version in needed]
        self._states.save(stored_records(CuratorPosition(cursor, self._newest, tuple(self._order), self._most, self._body)))
        for version in forgotten:
            del self._selections[version]
            self._informations.drop_version(version)

    def buffer(self) -> Buffer | None:
        """The selection from all information so far; None without any.

        Raises:
            ContactCurationError: the tosses so far cannot be ranked, e.g. because none carries information.
        """
        selection = self._selections.get(self._ranked_version())
        candidates = () if selection is None else selection.candidates
        if selection is None or not candidates:
            return None
        curation = curate(candidates, self._ranking)
        return Buffer(
            ranking=self._ranking,
            curation=curation,
            candidates=candidates,
            revision=self._revision(curation, candidates[0].parameters_version, selection.seen),
            seen=selection.seen,
            newest_stamp_ns=self._newest.stamp_ns,
            log_det=_log_det(candidates, curation, self._ranking),
            frame_id=self._newest.frame_id,
        )

    def last_stamp_ns(self, toss_id: str) -> int:
        """Stamp of a stored toss's last frame."""
        header = load_record(self._states.load, TossHeader, toss_id)
        return 0 if header is None else header.stamped.stamp_ns

    def _body_at(self, version: str) -> str:
        """Name of the body whose tosses are stored at a theta; empty where none are."""
        return next((stored.information.body for stored in self._informations.all_of(version)), "")

    def _fresh(self, ranking: RankingConfig) -> Selection:
        return selection_of(self._config.selection, ranking, self._config.prior_tosses)

    def _of_stored(self, ranking: RankingConfig, version: str) -> Selection:
        """A selection of what is stored at a theta."""
        selection = self._fresh(ranking)
        for stored in self._informations.all_of(version):
            selection.add(stored.information)
        return selection

    def _known(self) -> int:
        """How many tosses are known, if only at a theta that was forgotten."""
        return max([self._most, *(self._selections[version].seen for version in self._order)])

    def _ranked_version(self) -> str:
        """The newest theta at which enough of the known tosses are scored; empty while nothing came.

        If there is none, because `coverage` was raised, it is the one at which most are scored.
        """
        seen = {version: self._selections[version].seen for version in reversed(self._order)}
        enough = self._config.coverage * self._known()
        return next((version for version in seen if seen[version] >= enough), max(seen, key=seen.__getitem__, default=""))

    def _revision(self, curation: Curation, version: str, seen: int) -> int:
        """Goes up by one when the selected tosses, their order, theta or criterion change; lives on disk with them."""
        before = load_record(self._states.load, BufferRecord) or BufferRecord()
        record = BufferRecord(before.revision, curation.ranking.selected_ids, version, curation.ranking.criterion, seen)
        if replace(record, seen=before.seen) != before:
            record = replace(record, revision=before.revision + 1)
        if record != before:
            self._states.save(stored_records(record))
        return record.revision


def _log_det(candidates: tuple[TossInformation, ...], curation: Curation, ranking: RankingConfig) -> float:
    """Of the selected tosses relative to the prior, whatever the criterion."""
    pool = pool_of(candidates)
    prior = log_det_prior(pool, ranking.prior, ranking.cut)
    factors = pool.stacked(pool.indices_of(curation.ranking.selected_ids))
    return Accumulated.prior_only(prior.coordinates).joined(factors).log_det
