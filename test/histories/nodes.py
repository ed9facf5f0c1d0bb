"""The nodes of a cell on a still middleware: their own code, but for what reads parameter files, translates poses or trains."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest.mock import patch

from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.srv import GetTosses

from contact_curation.configs import fields_of
from contact_curation.motion.toss import Toss
from contact_curation.nodes import curator, fisher_scorer, throw_designer, trainer
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.throw import throw_message, throw_of
from contact_curation.nodes.messages.toss_information import INFORMATION, information_message, information_of
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched
from contact_curation.nodes.throw_goals import Outcome
from contact_curation.stages import curation, design, held_out_tosses, scoring, training
from contact_curation.stages.parameters import with_parameters
from contact_curation.stages.records import AnnouncedTosses, load_record, stored_records
from contact_curation.stages.throw_loop import LoopConfig
from contact_curation.storage.stores import sqlite
from contact_curation.storage.stores.tosses import TossStore
from test.histories import numbers
from test.histories.middleware import OPENED, Hand, Process, StillNode, Watch

BOARD = "board"


class Announced(NamedTuple):
    """A toss on its way: its message but for the translation of its poses."""

    sequence: int
    toss_id: str
    toss: Toss
    header: Any


class Keeper(StillNode):
    """pose_ingest behind its journal: stores tosses, announces them, and answers for them."""

    def __init__(self) -> None:
        super().__init__("pose_ingest")
        self.store = TossStore(Path(self._process.parameters["store"]))
        self._publisher = self.create_publisher(TossMessage, "toss", latched(RESULTS_DEPTH))
        self.create_service(GetTosses, "get_tosses", self._answer)
        self.store.reach_disk()
        self._announce(self.store.after(self._announced, 64))

    @property
    def _announced(self) -> int:
        return (load_record(self.store.states.load, AnnouncedTosses) or AnnouncedTosses()).tosses

    def cut(self, toss: Toss) -> None:
        """A toss came out of the poses, perhaps once more."""
        if self.store.add(toss).added:
            self.store.reach_disk()
        self._announce(self.store.after(self._announced, 64))

    def _announce(self, stored: Any) -> None:
        for one in stored:
            self._publisher.publish(_announced(one.sequence, one.toss.toss_id))
            self.store.states.save(stored_records(AnnouncedTosses(one.sequence)))

    def _answer(self, request: Any, _: Any) -> Any:
        limit = request.limit or 32
        stored = self.store.get(request.toss_ids) if request.toss_ids else self.store.after(request.after_sequence, limit)
        found = [_announced(one.sequence, one.toss.toss_id) for one in stored]
        unknown = sorted(set(request.toss_ids) - {one.toss_id for one in found})
        return Answered(found, unknown, self.store.last_sequence)


class Answered(NamedTuple):
    """Of the service, with tosses that need no translation."""

    tosses: list[Announced]
    unknown_ids: list[str]
    last_sequence: int


_tosses: dict[str, Toss] = {}


@cache
def _announced(sequence: int, toss_id: str) -> Announced:
    return Announced(sequence, toss_id, _tosses[toss_id], SimpleNamespace(frame_id=BOARD))


def known(toss: Toss) -> Toss:
    """The toss, which messages may be of from now on."""
    return _tosses.setdefault(toss.toss_id, toss)


class Scorer(fisher_scorer.FisherScorer, StillNode):
    """The real node."""


class Curator(curator.Curator, StillNode):
    """The real node."""


class Trainer(trainer.Trainer, StillNode):
    """The real node."""


class Designer(throw_designer.ThrowDesigner, StillNode):
    """The real node."""


MAKERS = {"keeper": Keeper, "scorer": Scorer, "curator": Curator, "trainer": Trainer, "designer": Designer}


class Goals:
    """Of a thrower that makes a throw, or does not, when a history says so."""

    missing = ""

    def __init__(self, node: Any, told: Callable[[Outcome], None], patience: float) -> None:
        self._told, self._throw = told, None

    @property
    def busy(self) -> bool:
        return self._throw is not None

    def send(self, throw: Any) -> None:
        self._throw = throw

    def look(self) -> None:
        return

    def end(self, released_ns: int | None) -> None:
        """The throw was made at this time, or not at all."""
        throw, self._throw = self._throw, None
        if released_ns is None:
            self._told(Outcome(None, "it was not made"))
        else:
            self._told(Outcome(throw_message(throw_of(throw), Stamped(released_ns, BOARD)), ""))


class _NoTosses:
    tosses = ()

    def errors(self, model: Any, loss: Any) -> held_out_tosses.HeldOutErrors:
        return held_out_tosses.HeldOutErrors(0.0, 0.0, 0.0, 0)


def _declared(node: StillNode, default: Any, prefix: str = "", *, fixed: bool = True) -> Any:
    """The config, with the parameters that the process was started with."""
    kind: Any = type(default)
    names = _names(kind)
    given = {name: value for name, value in node._process.parameters.items() if name in names}
    return _changed(default, tuple(sorted(given.items()))) if given else default


@cache
def _names(kind: Any) -> frozenset[str]:
    return frozenset(field.path for field in fields_of(kind()))


@cache
def _changed(default: Any, values: tuple[tuple[str, Any], ...]) -> Any:
    return with_parameters(default, dict(values))


_messages: dict[tuple[Any, ...], Any] = {}
_informations: dict[tuple[str, str], Any] = {}


def _information_message(information: Any, sequence: int, stamped: Any) -> Any:
    key = (information.toss_id, information.parameters_version, sequence, stamped)
    if key not in _messages:
        _messages[key] = information_message(information, sequence, stamped)
    return _messages[key]


def _information_of(message: Any) -> Any:
    key = (message.toss_id, message.parameters_version)
    if key not in _informations:
        _informations[key] = information_of(message)
    return _informations[key]


@contextmanager
def dying(store: sqlite.SqliteStore) -> Iterator[None]:
    """A transaction before or after whose commit the process may die."""
    process = Process.by_store.get(str(store.path))
    outermost = store._depth == 0
    with TRANSACTION(store):
        yield
        if outermost and process is not None:
            process.commits()
    if outermost and process is not None:
        process.commits()


TRANSACTION, OPEN = sqlite.SqliteStore.transaction, sqlite.SqliteStore.__init__


def _opened(store: sqlite.SqliteStore, path: Path, schema: sqlite.StoreSchema) -> None:
    OPEN(store, path, schema)
    OPENED.setdefault(str(path), []).append(store)


def _saved(path: Path, trained: Any, notes: dict[str, str]) -> None:
    process = Process.by_store[str(path.with_suffix(".sqlite"))]
    process.commits()
    numbers.save_checkpoint(path, trained, notes)
    process.commits()


@contextmanager
def in_one_process() -> Iterator[None]:
    """Inside, nodes are made on the middleware."""
    replaced: Mapping[Any, Mapping[str, Any]] = {
        fisher_scorer: {
            "TOSSES": replace(fisher_scorer.TOSSES, page=2, read=None),
            "information_message": _information_message,
            "toss_of": lambda message: message.toss,
        },
        curator: {"INFORMATION": replace(INFORMATION, page=2), "information_of": _information_of},
        trainer: {
            "declared_protocol": lambda node, _: numbers.Script(node._process.parameters["exact"]),
            "first_model_of": lambda path, kind, body, *_: (lambda _: numbers.ThetaModel(0), body),
            "declared_held_out": lambda *_: _NoTosses(),
            "toss_of": lambda message: message.toss,
            "model_version": lambda model: numbers.version(model.number),
        },
        throw_designer: {
            "INFORMATION": replace(INFORMATION, page=2),
            "information_of": _information_of,
            "declared_design": lambda _: None,
            "declared_thrower": lambda *_: None,
            "declared_loop": lambda _: LoopConfig(theta_timeout=20.0),
            "ThrowGoals": Goals,
            "Clock": Watch,
        },
        design: {"Designer": numbers.ScriptedDesigner, "AdaptiveDesign": numbers.ScriptedDesign},
        scoring: {"scorer_of": lambda theta, *_: numbers.scorer(numbers.number_of(theta.data))},
        curation: {"curate": numbers.remembered_curation},
        training: {
            "Training": numbers.ScriptedTraining,
            "transitions_of": numbers.transitions,
            "model_version": lambda model: numbers.version(model.number),
            "save_checkpoint": _saved,
            "read_notes": numbers.read_notes,
            "read_model": numbers.read_model,
            "resume_training": numbers.resume_training,
        },
        sqlite.SqliteStore: {"transaction": dying, "__init__": _opened},
    }
    for node in (fisher_scorer, curator, trainer, throw_designer):
        others = {"Worker": Hand, "HealthReport": lambda *_: None}
        others |= {"declare_config": _declared} if node is not throw_designer else {}
        one, both = {"declared_body": lambda _: numbers.BODY}, {"declared_body_and_params": lambda *_: (numbers.BODY, "")}
        replaced = {**replaced, node: {**replaced[node], **others, **(one if node is curator else both)}}
    with ExitStack() as stack:
        for owner, values in replaced.items():
            for name, value in values.items():
                stack.enter_context(patch.object(owner, name, value))
        yield
