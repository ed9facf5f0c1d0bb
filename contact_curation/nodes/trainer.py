"""Node `trainer`: trains a model on the selected tosses; writes the checkpoint to disk before it announces the parameters."""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import CuratedBuffer, ModelParameters, TrainingStatus

from contact_curation.contact.models.registry import DEFAULT_MODEL, MODELS
from contact_curation.errors import InvalidValueError
from contact_curation.information.model_version import model_version
from contact_curation.learning.training.progress import TrainingState
from contact_curation.nodes.messages.bounds import MOST_IDS, check_size
from contact_curation.nodes.messages.headers import Stamped, check_format, stamped_of
from contact_curation.nodes.messages.model_parameters import model_message
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.messages.training_status import status_message, waiting_message
from contact_curation.nodes.ros.body_parameter import declared_body_and_params
from contact_curation.nodes.ros.health import Health, HealthReport, awaited
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import latched
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.training_parameters import declared_held_out, declared_protocol, first_model_of
from contact_curation.nodes.ros.worker import Latest, Worker
from contact_curation.nodes.toss_fetch import TossFetch
from contact_curation.stages.held_out_tosses import HeldOutErrors
from contact_curation.stages.scoring import checked_body
from contact_curation.stages.training import Moment, RoundsConfig, SelectedSet, TrainingStage, made_of
from contact_curation.storage.stores.tosses import TossStore

STATUS_DEPTH = 64
"""Number of status messages that a late subscriber receives."""


class Trainer(StageNode):
    """Trains a model on the tosses that the curator selects, in rounds."""

    def __init__(self) -> None:
        super().__init__("trainer")
        about_params = "theta to begin with: a JSON file or a checkpoint; empty: the random initialisation"
        self._body, parameters = declared_body_and_params(self, about_params)
        kind = declare(self, "model", DEFAULT_MODEL, "model to train", choices=list(MODELS))
        protocol = declared_protocol(self, kind)
        rounds = declare_config(self, RoundsConfig())
        seed = declare(self, "seed", 0, "random seed of the initialisation and the shuffles", bounds=(0, 1 << 31))
        first, self._body = first_model_of(parameters, kind, self._body, protocol, seed)
        self._held_out = declared_held_out(self, self._body)
        store = Path(declare(self, "store", "trainer.sqlite", "file that stores fetched tosses"))
        checkpoint = declare(
            self,
            "checkpoint",
            "",
            "file of the model and the state of its training; empty: the store's name, ending in .safetensors",
        )
        self._tosses = TossStore(store)
        self._tosses.claim()
        self._stage = TrainingStage(
            first,
            self._body.length_scale,
            protocol,
            rounds,
            seed,
            self._tosses,
            Path(checkpoint or store.with_suffix(".safetensors")),
            made_of(kind, self._body),
        )
        if number := self._stage.round.number:
            self.get_logger().info(f"goes on from round {number} of its checkpoint; seed and params are for a new one")
        self._warnings = ThrottledWarnings(self)
        self._stamped = Stamped(0, "")
        self._kind, self._loss = kind, protocol.loss
        self._misfits: tuple[str, ...] = ()
        self._said_to_rest: tuple[int, Stamped] | None = None
        self._errors: tuple[str, HeldOutErrors] | None = None
        self._more_throws: tuple[str, str] | None = None
        self._model_parameters = self.create_publisher(ModelParameters, "model_parameters", latched(1))
        self._status = self.create_publisher(TrainingStatus, "training_status", latched(STATUS_DEPTH))
        self._worker = Worker(self.fail)
        self._training = Latest(self._worker, self._train)
        self._fetch = TossFetch(self, self._worker, lambda: self._stage.missing, self._fetched)
        self.create_subscription(CuratedBuffer, "curated_buffer", self._buffer_came, latched(1))
        self._worker.do(self._announce_again)
        HealthReport(self, "training", self._health, self._body.name)

    def close(self) -> None:
        self._worker.stop()
        self._tosses.close()

    def _buffer_came(self, message: Any) -> None:
        self._worker.do(partial(self._follow, message))

    def _follow(self, message: Any) -> None:
        """Takes a new buffer; on the worker's thread, as all methods below but the last."""
        try:
            check_format(message)
            check_size("toss_ids of the buffer", message.toss_ids, MOST_IDS)
            if message.body != self._body.name:
                raise InvalidValueError("body of the buffer", message.body, self._body.name)
        except InvalidValueError as error:
            self._warnings.note("bad buffer", str(error))
            return
        self._stamped = stamped_of(message.header)
        chosen_by, version = f"{message.criterion} {message.capacity}", message.parameters_version
        ids = tuple(message.toss_ids)
        self._stage.follow(SelectedSet(message.revision, message.tosses_seen, ids, chosen_by, version))
        self._fetch.ask()
        self._training.want()
        self._say_if_it_rests()

    def _fetched(self, messages: Sequence[Any], unknown: Sequence[str]) -> None:
        for message in messages:
            try:
                self._stage.add(checked_body(toss_of(message), self._body))
            except InvalidValueError as error:
                self._warnings.note("bad toss", str(error))
        for toss_id in unknown:
            self._warnings.note("unknown toss", f"get_tosses knows no {toss_id}, which the buffer holds", dropped=False)
        self._training.want()

    def _train(self) -> None:
        """Trains for a slice of steps; jobs that came meanwhile run before the next slice."""
        moment = self._stage.advance()
        if moment is not None:
            self._announce(moment)
        if self._stage.due:
            self._training.want()
        self._say_if_it_rests()

    def _announce_again(self) -> None:
        """Publishes the last round's parameters after a restart: latched messages are lost with their node."""
        moment = self._stage.now
        if moment is not None and moment.ended:
            self._announce(moment)
        self._training.want()

    def _announce(self, moment: Moment) -> None:
        version = model_version(moment.model)
        if moment.ended:
            self._look_for_misfits()
            self._model_parameters.publish(model_message(moment.model, version, moment.progress.gradient_steps, self._stamped))
        self._say(moment, version)

    def _look_for_misfits(self) -> None:
        """Logs what the model lacks, once each kind; diagnostics and the status keep saying it."""
        before, self._misfits = self._misfits, self._stage.misfits()
        for line in self._misfits:
            if all(line.partition(":")[0] != one.partition(":")[0] for one in before):
                self.get_logger().warning(line)

    def _say(self, moment: Moment, version: str) -> None:
        if self._errors is None or self._errors[0] != version:
            self._errors = version, self._held_out.errors(moment.model, self._loss)
        rests_on = self._stage.rests_on
        self._said_to_rest = None if rests_on is None else (rests_on.revision, self._stamped)
        revision = None if rests_on is None else rests_on.revision
        more = "" if rests_on is None else self._by_more_throws(version)
        told = (*self._misfits, *([more] if more else ()))
        self._status.publish(status_message(moment, version, self._errors[1], self._stamped, revision, told))

    def _by_more_throws(self, version: str) -> str:
        """How far more throws would change what it rests at, in words; empty where that is not known."""
        if self._more_throws is None or self._more_throws[0] != version:
            found = self._stage.more_throws(self._held_out.tosses)
            self._more_throws = version, found.in_words() if found else ""
            if found:
                self.get_logger().info(found.in_words())
        return self._more_throws[1]

    def _say_if_it_rests(self) -> None:
        """Publishes the state `waiting` if the buffer needs no round, for nodes that wait for the trainer."""
        rests_on, moment = self._stage.rests_on, self._stage.now
        if rests_on is None or (rests_on.revision, self._stamped) == self._said_to_rest:
            return
        if moment is not None:
            self._say(moment, model_version(moment.model))
            return
        self._said_to_rest = rests_on.revision, self._stamped
        self._status.publish(waiting_message(self._kind, rests_on.revision, self._stamped))

    def _health(self) -> Health:
        progress, number = self._stage.progress, self._stage.round.number
        if progress is None:
            missing = awaited(self, "selected tosses", "curated_buffer")
            return Health("waiting for selected tosses", self._warnings.counts, waiting_for=missing)
        values = {
            "round": number,
            "gradient_steps": progress.gradient_steps,
            "training_loss": progress.training_loss,
            "missing": len(self._stage.missing),
            "queue": self._worker.waiting,
            "more_throws": self._more_throws[1] if self._more_throws else "",
            **self._warnings.counts,
        }
        failed = progress.state is TrainingState.FAILED
        said = "; ".join([f"round {number}: {progress.reason or progress.state.value}", *self._misfits])
        return Health(said, values, warning=failed)


def main() -> int:
    """Runs the node."""
    return run(Trainer, "trainer")


if __name__ == "__main__":
    sys.exit(main())
