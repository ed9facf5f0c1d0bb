"""A cell whose nodes are killed, restarted and starved in any order, and what must hold of it whatever came."""

import sqlite3
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from contact_curation.design.throw import ThrowState
from contact_curation.information.ranker import RankingConfig
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.model_parameters import model_message
from contact_curation.stages.curation import CurationConfig
from contact_curation.stages.records import BufferRecord, TrainingRecord, load_record
from test.histories import numbers
from test.histories.middleware import Middleware, Process
from test.histories.nodes import BOARD, MAKERS, known
from test.lost_machine import LOG, Disk

NAMES = tuple(MAKERS)
NUMBERED = ("toss>scorer", "toss_information>curator", "toss_information>designer")
"""Channels whose messages are numbered: what is lost on them is asked for."""
SYNCED = ("keeper", "scorer")
"""Nodes whose stores are on the disk before anybody hears of what is in them."""
LEAD_NS = 5_000_000
"""From the release of a throw to the first frame of its toss."""
SHIFTS_NS = (0, -3_600_000_000_000, 3_600_000_000_000)
"""By which a tracker's clock may be set."""
CRITERIA = ("representative", "log-det", "trace")
LONGEST = 2000
"""Rounds in which a cell that nobody disturbs comes to rest."""
SECONDS = 12
"""In which nothing happens in one that is at rest; a question without an answer is asked again after 5."""


class Cell:
    """Keeper, scorer, curator, trainer and designer; a history is a list of calls.

    Args:
        folder: for their stores.
        exact: whether the trainer begins each round anew.
        coverage: of the curator.
    """

    def __init__(self, folder: Path, exact: bool, coverage: float) -> None:
        self.folder = folder
        self.middleware = Middleware()
        self.later_ns = 0
        self.only_trained, self._unseen = True, False
        self.measured: list[tuple[int, int]] = []
        self.coverage = coverage
        self.ranking = RankingConfig(top=2)
        self._most_known, self._published = 0, BufferRecord()
        self._safe: dict[str, bytes] = {}
        self._commanded: set[str] = set()
        own: dict[str, dict[str, Any]] = {
            "curator": {"top": 2, "criterion": self.ranking.criterion, "coverage": coverage},
            "trainer": {"exact": exact, "slice_steps": 1, "checkpoint_steps": 1, "settling_rounds": 2},
            "designer": {"auto": True, "await_tracker": False},
        }
        self._disk = Disk()
        self._watching = ExitStack()
        self._watching.enter_context(self._disk.watched())
        for name in NAMES:
            Process(name, self.middleware, MAKERS[name], folder / f"{name}.sqlite", own.get(name, {}))
            self.save(name)
        self.middleware.watch = self._watch

    # What a history is made of

    def cut(self) -> None:
        """A toss is cut out of the poses, which wait while pose_ingest is away."""
        if len(self.measured) < numbers.COUNT:
            self.measured.append((len(self.measured), self.later_ns))
            self._play(self.measured[-1:])
            self._unseen |= not self.process("keeper").alive

    def end_throw(self, made: bool) -> None:
        """The throw under way is made, and its toss is the next one that is cut; or it is not."""
        designer = self.process("designer")
        if designer.alive and designer.node._goals.busy:
            comes = len(self.measured) if made and len(self.measured) < numbers.COUNT else None
            released = None if comes is None else int(numbers.toss(comes, self.later_ns).stamps_ns[0]) - LEAD_NS
            designer.node._goals.end(released)

    def play_again(self) -> None:
        """The tracker's recording is played once more."""
        self._play(self.measured)
        self._unseen = not self.process("keeper").alive

    def set_clock(self, shift_ns: int) -> None:
        """The tracker's clock jumps."""
        self.later_ns = shift_ns

    def go_on(self, number: int, steps: int = 1) -> None:
        """What comes next on a channel."""
        for _ in range(steps):
            channels = self.middleware.channels
            if channels:
                self.middleware.take(channels[number % len(channels)])

    def repeat(self, channel: str) -> None:
        """A numbered message comes twice."""
        waiting = self.middleware.waiting[channel]
        if waiting:
            waiting.append(waiting[0])

    def reorder(self, channel: str) -> None:
        """A numbered message comes behind those after it."""
        self.middleware.waiting[channel].rotate(-1)

    def drop(self, channel: str) -> None:
        """A numbered message is lost."""
        waiting = self.middleware.waiting[channel]
        if waiting:
            waiting.popleft()

    def publish_theta(self, number: int) -> None:
        """Somebody beside the trainer publishes a theta."""
        self.only_trained = False
        message = model_message(numbers.ThetaModel(number), numbers.version(number), 0, Stamped(0, BOARD))  # type: ignore[arg-type]
        self.middleware.publish("model_parameters", message, 1)

    def tick(self, name: str) -> None:
        """A second of one node."""
        self.process(name).tick()

    def kill(self, name: str) -> None:
        self.process(name).kill()

    def die_at(self, name: str, commits: int) -> None:
        """A process will die before or behind one of its next commits."""
        self.process(name).dies_in = commits

    def restart(self, name: str) -> None:
        if not self.process(name).alive:
            self.process(name).start()

    def rank_by(self, top: int, criterion: str) -> None:
        """The curator's parameters are changed, those that it will be started with next time, too."""
        curator = self.process("curator")
        curator.parameters |= {"top": top, "criterion": criterion}
        self.ranking = RankingConfig(criterion, top=top)
        if curator.alive:
            changed = [_Parameter("top", top), _Parameter("criterion", criterion)]
            assert curator.set_parameters(changed).successful

    def cover(self, coverage: float) -> None:
        """The curator is started again with another coverage, which counts for what it still knows."""
        self.kill("curator")
        self.coverage = self.process("curator").parameters["coverage"] = coverage
        self.restart("curator")
        self._most_known = max(self._counts.values(), default=0)

    def save(self, name: str) -> None:
        """The system writes to disk what a node has committed."""
        with sqlite3.connect(self.folder / f"{name}.sqlite") as connection:
            self._safe[name] = connection.serialize()
        connection.close()

    def lose_power(self, lost: tuple[str, ...]) -> None:
        """The machine dies, and with it the last commits of some stores; of those that are synced all since then."""
        left = {name: self._disk.left(self.folder / f"{name}.sqlite") for name in SYNCED}
        for name in NAMES:
            self.kill(name)
        for name in lost:
            own = left.get(name, {"": self._safe[name]})
            self._replace(name, own[""])
            if LOG in own:
                (self.folder / f"{name}.sqlite{LOG}").write_bytes(own[LOG])
        for name in NAMES:
            self.restart(name)

    def remove(self, name: str) -> None:
        """Somebody removes a node's store while it is away, which takes a while."""
        self.kill(name)
        for other in NAMES:
            self.tick(other)
        self._replace(name, None)
        self._unseen |= name == "keeper"
        self.restart(name)

    # What must hold

    def finish(self) -> None:
        """Undisturbed it comes to rest, and is whole."""
        self.come_to_rest()
        self.check()

    def come_to_rest(self) -> None:
        """Nobody disturbs the cell any more; poses that came while there was nobody, or no store, are played again."""
        for name in NAMES:
            self.process(name).dies_in = 0
            self.restart(name)
        if self._unseen:
            self.play_again()
        self.process("designer").parameters["auto"] = False
        self.end_throw(made=False)
        quiet = rounds = 0
        while quiet < SECONDS:
            worked = False
            while channels := self.middleware.channels:
                for channel in channels:
                    self.middleware.take(channel)
                worked, rounds = True, rounds + 1
                assert rounds < LONGEST, "the cell does not come to rest"
            before = self.state if worked else None
            for name in NAMES:
                self.tick(name)
            quiet = 0 if worked and self.state != before else quiet + 1
            rounds += 1
            assert rounds < LONGEST, "the cell does not come to rest"

    @property
    def state(self) -> tuple[Any, ...]:
        """What a cell at rest does not change."""
        nodes = {name: self.process(name).node for name in NAMES}
        stages = nodes["scorer"]._stage.version, nodes["curator"]._stage.cursor, nodes["trainer"]._stage.round
        return (*stages, self._published, nodes["keeper"].store.last_sequence)

    def check(self) -> None:
        """After rest: nothing is lost, and the buffer is what `rank` selects of the same tosses at the theta that came last."""
        expected = {numbers.toss(*one).toss_id for one in self.measured}
        keeper, scorer, curator, trainer, designer = (self.process(name).node for name in NAMES)
        assert {one.toss.toss_id for one in keeper.store.after(0, 64)} == expected
        version = scorer._stage.version
        for node in (scorer, curator):
            assert {one.information.toss_id for one in node._informations.all_of(version)} == expected, node.name
        assert self._faults == []
        self._check_throws(designer._stage, expected)
        if not expected:
            assert self._published == BufferRecord()
            return
        number = next(one for one in range(numbers.THETAS) if numbers.version(one) == version)
        assert self._published.version == version
        assert self._published.criterion == self.ranking.criterion
        assert self._published.seen == len(expected)
        assert self._published.selected == numbers.ranked(frozenset(self.measured), number, self.ranking)
        self._check_training(trainer, version)

    def _check_throws(self, stage: Any, expected: set[str]) -> None:
        """The designer knows all tosses, gives none to two throws, and sees that all was learned from them."""
        assert stage._stamps.keys() == expected
        own = [made.toss_id for made in stage.throws if made.toss_id]
        assert len(set(own)) == len(own)
        last = stage.throws[-1] if stage.throws else None
        if last and last.toss_id and last.exploration is None and self.only_trained:
            assert last.realised is not None
        assert stage.is_up_to_date or not self.only_trained

    def _check_training(self, trainer: Any, version: str) -> None:
        """The trainer has used the buffer, or may not use it any more; the scorer has its theta."""
        stage = trainer._stage
        assert stage.missing == ()
        assert not stage.due
        record = load_record(trainer._tosses.states.load, TrainingRecord)
        assert record is not None
        assert record.revision == (self._published.revision if len(self._published.selected) >= 2 else record.revision)
        if stage.round.number and self.only_trained:
            assert version == numbers.version(stage.now.model.number)

    def close(self) -> None:
        """Gives back what the processes hold."""
        for name in NAMES:
            self.kill(name)
            Process.by_store.pop(str(self.process(name).store))
        self._watching.close()

    def process(self, name: str) -> Process:
        return self.middleware.processes[name]

    @property
    def _counts(self) -> dict[str, int]:
        """Tosses that the curator knows at each theta."""
        stored = self.process("curator").node._informations
        return {version: stored.count(version) for version in stored.versions}

    @property
    def _faults(self) -> list[str]:
        """What nodes warned of, though nothing was wrong with any message."""
        said = {kind for name in NAMES[1:] for kind in self.process(name).node._warnings.counts}
        return sorted(said - {"unknown toss", "throw not made"})

    def _play(self, measured: list[tuple[int, int]]) -> None:
        for one in measured:
            toss = known(numbers.toss(*one))
            keeper = self.process("keeper")
            if keeper.alive:
                self.middleware.do("keeper", _cutting(keeper, toss))

    def _replace(self, name: str, content: bytes | None) -> None:
        """A store is as it was, or gone with all that belongs to it."""
        path = self.folder / f"{name}.sqlite"
        for suffix in ("-wal", "-shm"):
            path.with_name(path.name + suffix).unlink(missing_ok=True)
        path.unlink(missing_ok=True)
        if content is not None:
            path.write_bytes(content)
        elif name == "trainer":
            path.with_suffix(".safetensors").unlink(missing_ok=True)
        if name == "curator":
            self._most_known, self._published = 0, BufferRecord()
        elif name == "designer":
            self._commanded.clear()

    def _watch(self, topic: str, message: Any) -> None:
        """No throw has the name of another; a buffer is not published against coverage, and its number tells it from others."""
        if topic == "throw_report" and message.state == ThrowState.COMMANDED:
            name = message.throw_command.throw_id
            assert name not in self._commanded
            self._commanded.add(name)
        if topic != "curated_buffer":
            return
        counts = self._counts
        self._most_known = max(self._most_known, *counts.values())
        assert message.tosses_seen == counts[message.parameters_version]
        assert message.tosses_seen >= CurationConfig(coverage=self.coverage).coverage * self._most_known
        ids = tuple(message.toss_ids)
        record = BufferRecord(message.revision, ids, message.parameters_version, message.criterion, message.tosses_seen)
        before, self._published = self._published, record
        same = (ids, record.version, record.criterion) == (before.selected, before.version, before.criterion)
        assert record.revision == before.revision if same else record.revision > before.revision


def _cutting(keeper: Process, toss: Any) -> Callable[[], None]:
    return lambda: keeper.node.cut(toss)


class _Parameter:
    """As ROS gives it to who may refuse it."""

    def __init__(self, name: str, value: Any) -> None:
        self.name, self.value = name, value
