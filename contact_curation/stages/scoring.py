"""Scoring that can be interrupted at any time: all results and the position in the stream are on disk.

A toss is scored once per theta. Its information is on the disk under its own number before anybody hears of it, so that no
number ever stands for two records, even if the machine crashes. After a kill, the numbers that were perhaps never announced are
announced again.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from contact_curation.configs import fields_of
from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.information.network.model_scorer import TossScorer
from contact_curation.information.record import TossInformation
from contact_curation.information.scoring import BegunToss, NotScored, ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.stages.records import (
    AnnouncedInformation,
    Cursor,
    ScorerPosition,
    Stamped,
    TossHeader,
    load_record,
    stored_records,
)
from contact_curation.stages.scored_theta import ScoredTheta, forget_theta_of_another_body, scorer_of
from contact_curation.storage.stores.information import InformationStore

PARAMETERS, MODEL = "parameters", "model"
"""What theta is kept under: its safetensors bytes, and the name of its model."""
NEXT_PARAMETERS, NEXT_MODEL = "next_parameters", "next_model"
"""The same of the theta that comes next; empty while there is none."""
NOTHING_NEXT = {NEXT_PARAMETERS: b"", NEXT_MODEL: b""}

MOST_VERSIONS = 2
"""Older thetas' information is dropped: it can be scored again."""


class Announcement(NamedTuple):
    """The information of a toss, its number from 1, and the header it goes out with."""

    sequence: int
    information: TossInformation
    stamped: Stamped


class Batch(NamedTuple):
    """The results of scoring some tosses: new information, and a line for each toss that could not be scored."""

    new: tuple[Announcement, ...]
    not_scored: tuple[NotScored, ...]


class _Foreseen(NamedTuple):
    """The digest of a toss that was scored before it was announced, and what came out."""

    digest: str
    result: TossInformation | NotScored


class ScoringStage:
    """Scores tosses of one body at the newest theta.

    Args:
        body: what is tossed.
        config: how tosses are scored.
        informations: where results, theta and the place in the stream are stored.
        theta: where no newer one is kept.

    Attributes:
        keeps_newer: whether another theta than the given one is taken, because the store has kept it.

    Raises:
        InvalidValueError: the store holds results of the same theta that were made in another way.
    """

    def __init__(self, body: Body, config: ScoringConfig, informations: InformationStore, theta: ScoredTheta) -> None:
        self._body = body
        self._config = config
        self._informations = informations
        self._states = informations.states
        forget_theta_of_another_body(self._states, body, PARAMETERS, MODEL, *NOTHING_NEXT)
        stored, model = self._states.load(PARAMETERS), self._states.load(MODEL) or theta.model.encode()
        known = ScoredTheta(model.decode(), stored) if stored else theta
        self.keeps_newer = known != theta
        self._scorer = self._checked(scorer_of(known, body, config))
        self._begun: BegunToss | None = None
        self._foreseen: _Foreseen | None = None
        position = load_record(self._states.load, ScorerPosition)
        if position is not None and position.version != self.version:  # started with another body, or other parameters
            self._score_anew()
        elif position is not None:
            kept = _settings_in(position.loss, position.compression)
            for name, value in _settings_in(config.loss.in_words, self._compressed).items():
                if kept.get(name, value) != value:
                    raise InvalidValueError(name, value, f"{kept[name]}, as in the store, or another store")
        informations.reach_disk()  # what was stored and not announced will be

    @property
    def version(self) -> str:
        """Of theta."""
        return self._scorer.version

    @property
    def cursor(self) -> Cursor:
        """Position after the last toss that was scored at this theta."""
        known = load_record(self._states.load, ScorerPosition)
        return known.cursor if known is not None and known.version == self.version else Cursor()

    def renew(self, theta: ScoredTheta) -> bool:
        """Goes on with another theta; False when it is the same.

        What is kept of it from an earlier time is scored again: under new numbers it is news to whoever listens.

        Raises:
            InvalidValueError: no theta of such a model, one that the form cannot have, or the store holds results of it that
                were made in another way.
        """
        try:
            scorer = self._checked(scorer_of(theta, self._body, self._config))
        except InvalidValueError:
            self._states.save(NOTHING_NEXT)
            raise
        if scorer.version == self.version:
            self._states.save(NOTHING_NEXT)
            return False
        self._states.save({PARAMETERS: theta.data, MODEL: theta.model.encode(), **NOTHING_NEXT})
        self._scorer, self._begun, self._foreseen = scorer, None, None
        self._score_anew()
        return True

    def _score_anew(self) -> None:
        """Drops what is kept of this theta from an earlier time, and information that is too old; begins at the first toss."""
        self._informations.drop_version(self.version)
        self._informations.keep_newest_versions(MOST_VERSIONS)
        self.advance(Cursor())  # a restart drops nothing again

    def postpone(self, theta: ScoredTheta) -> None:
        """Remembers the theta to go on with once all tosses are scored at the present one; the newest replaces the others.

        While thetas come faster than tosses are scored, each theta that is begun is also finished.

        Raises:
            InvalidValueError: no theta of such a model, or one that the form cannot have.
        """
        scorer_of(theta, self._body, self._config)
        self._states.save({NEXT_PARAMETERS: theta.data, NEXT_MODEL: theta.model.encode()})

    @property
    def postponed(self) -> ScoredTheta | None:
        """The theta to go on with; None while there is none."""
        data, model = self._states.load(NEXT_PARAMETERS), self._states.load(NEXT_MODEL)
        return ScoredTheta(model.decode(), data) if data and model else None

    def begin(self, toss: Toss) -> None:
        """Scores what can be scored of a toss that is expected soon, and was not before. Nothing is stored.

        Its last velocities are not known yet, unless it comes once more as long as it was: then it is taken to be complete.
        """
        if self._begun is not None and self._begun.fits(toss):
            self._foreseen = _Foreseen(toss.digest(), self._begun.score(toss))
        else:
            self._begun, self._foreseen = self._scorer.begin(toss, self._begun), None

    def score(self, tosses: Sequence[Toss], frames: Mapping[str, str]) -> Batch:
        """Scores the tosses that have no result yet, and stores the results.

        Args:
            tosses: of this body.
            frames: by toss id, the frame that its poses are given in.
        """
        fresh = [toss for toss in tosses if self._informations.get(toss.toss_id, self.version) is None]
        results = self._scored(fresh) if fresh else ()
        scored = [(toss, result) for toss, result in zip(fresh, results) if isinstance(result, TossInformation)]
        headers = {toss.toss_id: Stamped(int(toss.stamps_ns[-1]), frames[toss.toss_id]) for toss, _ in scored}
        records = [stored_records(TossHeader(header), name=toss_id) for toss_id, header in headers.items()]
        self._states.save({key: data for one in records for key, data in one.items()})
        new = [Announcement(self._informations.add(one).sequence, one, headers[one.toss_id]) for _, one in scored]
        if new:
            self._informations.reach_disk()
        return Batch(tuple(new), tuple(result for result in results if isinstance(result, NotScored)))

    def _scored(self, tosses: Sequence[Toss]) -> tuple[TossInformation | NotScored, ...]:
        begun, foreseen, self._begun, self._foreseen = self._begun, self._foreseen, None, None
        if begun is None or len(tosses) > 1:
            return self._scorer.score(tosses)
        if foreseen is not None and foreseen.digest == tosses[0].digest():
            return (foreseen.result,)
        return (begun.score(tosses[0]),)

    def after(self, sequence: int, limit: int) -> tuple[Announcement, ...]:
        """The next `limit` results behind `sequence`."""
        return tuple(self._with_header(*one) for one in self._informations.after(sequence, limit))

    def unannounced(self, limit: int) -> tuple[Announcement, ...]:
        """A page of what is kept and was perhaps never announced."""
        known = load_record(self._states.load, AnnouncedInformation) or AnnouncedInformation()
        return self.after(known.sequence, limit)

    def announced(self, batch: Sequence[Announcement]) -> None:
        """Remembers that everything up to these was announced."""
        if batch:
            self._states.save(stored_records(AnnouncedInformation(batch[-1].sequence)))

    def advance(self, cursor: Cursor) -> None:
        """Remembers that every toss up to the cursor was scored at this theta."""
        position = ScorerPosition(self.version, cursor, self._config.loss.in_words, self._compressed)
        self._states.save(stored_records(position))

    @property
    def _compressed(self) -> str:
        """How factors are compressed, a word for each field."""
        return " ".join(f"{field.path}={field.default}" for field in fields_of(self._config.compression))

    @property
    def last_sequence(self) -> int:
        """The newest number; 0 while there is none."""
        return self._informations.last_sequence

    def _checked(self, scorer: TossScorer) -> TossScorer:
        """The scorer, if results of its theta that are kept already are like its own."""
        stored = next(iter(self._informations.all_of(scorer.version)), None)
        if stored is None:
            return scorer
        known = stored.information
        own = {
            "estimator": self._config.estimator.value,
            "influence_bound": self._config.influence_bound,
            "blocks": scorer.blocks,
        }
        for name, value in own.items():
            if value != getattr(known, name):
                raise InvalidValueError(name, value, f"{getattr(known, name)}, as in the store, or another store")
        return scorer

    def _with_header(self, sequence: int, information: TossInformation) -> Announcement:
        header = load_record(self._states.load, TossHeader, information.toss_id)
        return Announcement(sequence, information, Stamped() if header is None else header.stamped)


def checked_body(toss: Toss, body: Body) -> Toss:
    """The toss, if it is one of this body; InvalidValueError otherwise."""
    if toss.body != body.name:
        raise InvalidValueError(f"body of toss {toss.toss_id}", toss.body, body.name)
    return toss


def _settings_in(loss: str, compression: str) -> dict[str, str]:
    """Settings by their names, from the words of a `ScorerPosition`; none from an empty text."""
    words = [*(f"loss.{word}" for word in loss.split()), *(f"compression.{word}" for word in compression.split())]
    return dict(word.split("=") for word in words)
