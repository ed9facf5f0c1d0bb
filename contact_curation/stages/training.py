"""Training that can be interrupted at any time, in rounds on the selected tosses, each starting where the last one ended.

A round takes the newest selected set whose tosses are all there, gives it the protocol's budget of gradient steps, and ends
with new parameters. These change the ranking, thus the selected set, thus the next round. So that it comes to rest, only so
many rounds may follow one another without news: a toss that is new to the curator, or another way in which it selects.

The checkpoint holds the training in the middle of a round, and which round that is; the tosses are in a store of its own, and
with them a `TrainingRecord` for whoever supervises.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from contact_curation.configs import set_whole_numbers
from contact_curation.contact.body import Body
from contact_curation.contact.models.model import Model, Rows
from contact_curation.errors import InvalidValueError
from contact_curation.information.model_version import model_version
from contact_curation.learning.evaluation.misfit import misfits
from contact_curation.learning.training.progress import Progress, TrainingState
from contact_curation.learning.training.protocols import TrainingConfig
from contact_curation.learning.training.training import Training
from contact_curation.learning.uncertainty.more_throws import MoreThrows, after_training
from contact_curation.motion.toss import Toss
from contact_curation.motion.transitions import Transitions, transitions_of
from contact_curation.stages.records import TrainingRecord, load_record, record_bytes, record_of, stored_records
from contact_curation.storage.checkpoint_file import read_model, read_notes, resume_training, save_checkpoint
from contact_curation.storage.stores.tosses import TossStore

ROUND = "round"
"""Name of the checkpoint's note about the round it is in."""

MADE_OF = "made of"
"""Name of its note about the kind of model and the body."""


class SelectedSet(NamedTuple):
    """The tosses that the curator selected.

    Attributes:
        revision: of the buffer.
        tosses_seen: how many it was chosen from.
        toss_ids: best first.
        chosen_by: criterion and number of tosses, in words; empty where they are not known.
        version: of the theta that the tosses were ranked at.
    """

    revision: int
    tosses_seen: int
    toss_ids: tuple[str, ...]
    chosen_by: str = ""
    version: str = ""


@dataclass(frozen=True)
class RoundsConfig:
    """When a round begins, and how finely it is cut.

    Attributes:
        least_tosses: a round needs at least this many selected tosses.
        settling_rounds: rounds that may follow one another without a toss that is new to the curator or a change of how it
            selects.
        slice_steps: gradient steps between two checks for new messages.
        checkpoint_steps: gradient steps between two checkpoints within a round.
    """

    least_tosses: int = 2
    settling_rounds: int = 3
    slice_steps: int = 25
    checkpoint_steps: int = 200

    def __post_init__(self) -> None:
        set_whole_numbers(self, ("least_tosses", "slice_steps", "checkpoint_steps"), 1)
        set_whole_numbers(self, ("settling_rounds",))


@dataclass(frozen=True)
class Round:
    """Which round it is.

    Attributes:
        number: from 1.
        revision: of the buffer that it trains on.
        tosses_seen: by the curator, then.
        settling: how many rounds since there was news, this one included; 0 when there was.
        toss_ids: it trains on.
        earlier_ids: that rounds before it trained on, and it does not.
        chosen_by: as of the selected set.
    """

    number: int = 0
    revision: int = 0
    tosses_seen: int = 0
    settling: int = 0
    toss_ids: tuple[str, ...] = ()
    earlier_ids: tuple[str, ...] = ()
    chosen_by: str = ""


class Moment(NamedTuple):
    """The training before its first or at the end of any round.

    Attributes:
        model: as it is then.
        progress: as it is then.
        round: which.
        ended: whether the round has ended.
    """

    model: Model
    progress: Progress
    round: Round
    ended: bool


class TrainingStage:
    """Trains one model on whatever is selected.

    Args:
        begin: gives the model to begin with, from the first training data.
        length_scale: of the body [m].
        config: the protocol; its budget is that of a round.
        rounds: when they begin.
        seed: of the shuffles.
        tosses: where fetched tosses are kept.
        checkpoint: file; made at the first round.
        made_of: kind of model and body, in words; a checkpoint of others is refused, since it would be trained on as it was.

    Raises:
        InvalidValueError: the checkpoint is of another kind of model or another body, or none of a trainer node.
    """

    def __init__(
        self,
        begin: Callable[[Rows], Model],
        length_scale: float,
        config: TrainingConfig,
        rounds: RoundsConfig,
        seed: int,
        tosses: TossStore,
        checkpoint: Path,
        made_of: str = "",
    ) -> None:
        self._begin = begin
        self._length_scale = length_scale
        self._config = config
        self._rounds = rounds
        self._seed = seed
        self._tosses = tosses
        self._checkpoint = checkpoint
        self._made_of = made_of
        self._wanted: SelectedSet | None = None
        self._chosen_anew = False
        self._training: Training | None = None
        self._round = Round()
        self._record = load_record(tosses.states.load, TrainingRecord)
        if checkpoint.exists():
            self._resume()
        self._note()

    @property
    def now(self) -> Moment | None:
        """Where it is; None before the first round."""
        if self._training is None:
            return None
        return Moment(self._training.trained(), self._training.progress, self._round, not self._running)

    @property
    def round(self) -> Round:
        """The newest one; number 0 before the first."""
        return self._round

    @property
    def progress(self) -> Progress | None:
        """How far it is; None before the first round."""
        return None if self._training is None else self._training.progress

    def misfits(self) -> tuple[str, ...]:
        """What the model of the newest round lacks by the tosses that it learns from, one line each."""
        if self._training is None:
            return ()
        model, at_optimum = self._training.model, self._training.at_optimum
        geometry = model.geometry()
        bounces = geometry is not None and geometry.restitution is not None
        found = misfits(self._round_tosses, model.body, geometry if at_optimum else None, bounces=bounces)
        return (*found, *filter(None, (self._training.displaced(),)))

    def more_throws(self, tosses: Sequence[Toss] = ()) -> MoreThrows | None:
        """How far as many throws again would change predicted motions of these tosses, or else of those of the round.

        None where that is not known, as after rounds that did not end at an optimum.
        """
        return None if self._training is None else after_training(self._training, tosses or self._round_tosses, self._seed)

    @property
    def missing(self) -> tuple[str, ...]:
        """Ids of the newest selected set whose tosses have to be fetched."""
        return () if self._wanted is None else tuple(one for one in self._wanted.toss_ids if not self._tosses.contains(one))

    def follow(self, selected: SelectedSet) -> None:
        """Trains on this set from the next round on.

        Where neither the tosses nor theta have changed and others are selected, the curator was told to select otherwise.
        """
        before, self._wanted = self._wanted, selected
        if before is not None and (before.version, before.tosses_seen) == (selected.version, selected.tosses_seen):
            self._chosen_anew |= bool(selected.version) and set(before.toss_ids) != set(selected.toss_ids)
        self._note()

    def add(self, toss: Toss) -> None:
        """Keeps a toss that was fetched; InvalidValueError if another one of its id is there."""
        self._tosses.add(toss)
        self._note()

    @property
    def rests_on(self) -> SelectedSet | None:
        """The newest selected set where nothing is left to do until there is another; None where something is, or none came."""
        return None if self.due or self.missing else self._wanted

    @property
    def due(self) -> bool:
        """Whether `advance` has something to do."""
        return self._running or self._round_due

    def advance(self) -> Moment | None:
        """Begins a round or takes a slice of it; gives the moment before the first round and that at the end of each."""
        if not self._running:
            if not self._round_due:
                return None
            self._start_round()
            return self.now if self._round.number == 1 else None
        before = self._trained_so_far.counters.gradient_steps
        progress = self._trained_so_far.advance(self._rounds.slice_steps)
        ended, every = progress.state is not TrainingState.RUNNING, self._rounds.checkpoint_steps
        if ended or before // every != progress.gradient_steps // every:
            self._save()
        return self.now if ended else None

    @property
    def _round_tosses(self) -> list[Toss]:
        """What the newest round learns from."""
        return [one.toss for one in self._tosses.get(self._round.toss_ids)]

    @property
    def _running(self) -> bool:
        return self._training is not None and self._training.counters.state is TrainingState.RUNNING

    @property
    def _trained_so_far(self) -> Training:
        assert self._training is not None  # a round is running
        return self._training

    @property
    def _round_due(self) -> bool:
        """Whether the newest selected set is another one, is all there, and may still be trained on."""
        wanted = self._wanted
        if wanted is None or len(wanted.toss_ids) < self._rounds.least_tosses or self.missing:
            return False
        if set(wanted.toss_ids) == set(self._round.toss_ids):
            return False
        return self._is_news(wanted) or self._round.settling < self._rounds.settling_rounds

    def _is_news(self, wanted: SelectedSet) -> bool:
        """Whether the set follows from a new toss or from another choice, and not from the last round's theta alone."""
        chosen_otherwise = self._round.chosen_by not in ("", wanted.chosen_by)
        return self._chosen_anew or chosen_otherwise or wanted.tosses_seen > self._round.tosses_seen

    def _start_round(self) -> None:
        wanted = self._wanted
        assert wanted is not None  # a round is due
        settling = 0 if self._is_news(wanted) else self._round.settling + 1
        self._chosen_anew = False
        data = self._data(wanted.toss_ids)
        if self._training is None:
            model = self._begin(Rows(data.before, data.after, data.dt))
            self._training = Training(model, data, None, self._config, self._seed)
        else:
            self._training.replace_data(data, fresh_budget=True)
        seen = max(wanted.tosses_seen, self._round.tosses_seen)
        before = {*self._round.toss_ids, *self._round.earlier_ids} - set(wanted.toss_ids)
        earlier = () if self._config.exact else tuple(sorted(before))  # an exact round forgets what was before
        self._round = Round(self._round.number + 1, wanted.revision, seen, settling, wanted.toss_ids, earlier, wanted.chosen_by)
        self._save()

    def _data(self, toss_ids: tuple[str, ...]) -> Transitions:
        """Of stored tosses, in the order of their ids, so that the same set gives the same training."""
        stored = sorted(self._tosses.get(toss_ids), key=lambda one: one.toss.toss_id)
        return transitions_of([one.toss for one in stored], self._length_scale)

    def _save(self) -> None:
        last, earlier = self._round.toss_ids, self._round.earlier_ids
        ids = {"training ids": "\n".join((*last, *earlier)), "fitted ids": "\n".join(last)}  # as `evaluate` reads them
        notes = {ROUND: record_bytes(self._round).decode(), MADE_OF: self._made_of, **ids}
        save_checkpoint(self._checkpoint, self._trained_so_far, notes)
        self._note()

    def _note(self) -> None:
        """Keeps what a supervisor reads, where it has changed: after the checkpoint, which it tells of."""
        rests_on, before = self.rests_on, self._record or TrainingRecord()
        ended = self._training is not None and not self._running
        record = TrainingRecord(
            round=self._round.number,
            gradient_steps=0 if self.progress is None else self.progress.gradient_steps,
            running=self._running,
            version=model_version(self._trained_so_far.trained()) if ended else before.version,
            revision=0 if rests_on is None else rests_on.revision,
            tosses_seen=0 if rests_on is None else rests_on.tosses_seen,
        )
        if record != self._record:
            self._record = record
            self._tosses.states.save(stored_records(record))

    def _resume(self) -> None:
        """Goes on in the middle of the round; where its tosses or the protocol are others, from its parameters on.

        An exact protocol has no use for these: it begins each round at the same theta_0.
        """
        notes = read_notes(self._checkpoint)
        found, of = _round_of(notes, self._checkpoint), notes.get(MADE_OF, self._made_of)
        if of != self._made_of:
            raise InvalidValueError(f"checkpoint {self._checkpoint}", of, f"{self._made_of}, or another checkpoint")
        if all(self._tosses.contains(toss_id) for toss_id in found.toss_ids):
            training = resume_training(self._checkpoint, self._data(found.toss_ids), None)
            if training.config == self._config:
                self._round, self._training = found, training
                return
        if not self._config.exact:
            model = read_model(self._checkpoint)
            self._begin = lambda _: model


def made_of(kind: str, body: Body) -> str:
    """Kind of model and body in words, with a digest of all the body's values."""
    return f"{kind} of {body.name}, {body.mass:g} kg ({body.digest})"


def _round_of(notes: Mapping[str, str], path: Path) -> Round:
    """The round that a checkpoint is in; a checkpoint of the `train` command is in none."""
    if ROUND not in notes:
        raise InvalidValueError(f"checkpoint {path}", "none of a trainer node", "one; `params` takes others")
    return record_of(Round, notes[ROUND].encode(), path)
