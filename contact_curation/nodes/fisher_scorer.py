"""Node `fisher_scorer`: computes the information of tosses, and stores it before announcing it."""

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import ModelParameters
from contact_curation_msgs.msg import Toss as TossMessage
from contact_curation_msgs.msg import TossInformation as TossInformationMessage
from contact_curation_msgs.srv import GetInformation, GetTosses

from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.information.scoring import ScoringConfig
from contact_curation.motion.toss import Toss
from contact_curation.nodes.messages.model_parameters import theta_in
from contact_curation.nodes.messages.toss import toss_of
from contact_curation.nodes.messages.toss_bytes import EXPECTED_TOSS, toss_in
from contact_curation.nodes.messages.toss_information import information_message
from contact_curation.nodes.ros.body_parameter import declared_body_and_params, warn_of_kept
from contact_curation.nodes.ros.catch_up import CatchUp, Source
from contact_curation.nodes.ros.health import Health, HealthReport, awaited
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import RESULTS_DEPTH, latched, profile
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Worker
from contact_curation.stages.records import Cursor
from contact_curation.stages.scored_theta import ScoredTheta, read_scored_theta, theta_of_geometry
from contact_curation.stages.scoring import Announcement, ScoringStage, checked_body
from contact_curation.storage.stores.information import InformationStore

TOSSES = Source(TossMessage, "toss", GetTosses, "get_tosses", "tosses", page=16, read=toss_in)

LARGEST_PAGE = 64
"""Largest number of records in a response of `get_information`."""


class FisherScorer(StageNode):
    """Scores tosses at the newest theta, and all tosses again when theta changes."""

    def __init__(self) -> None:
        super().__init__("fisher_scorer")
        about_params = "theta to begin with: JSON file or checkpoint; empty: the body as described"
        self._body, parameters = declared_body_and_params(self, about_params)
        config = declare_config(self, ScoringConfig(form=Form.RIGID, loss=replace(DEFAULT_LOSS, threads=1)))
        store = Path(declare(self, "store", "information.sqlite", "file that stores information"))
        theta = theta_of_geometry(ContactGeometry.of_body(self._body))
        if parameters:
            theta, self._body = read_scored_theta(Path(parameters), self._body)
        self._informations = InformationStore(store)
        self._informations.claim()
        self._stage = ScoringStage(self._body, config, self._informations, theta)
        if parameters and self._stage.keeps_newer:
            warn_of_kept(self, parameters)
        self._published_version = ""
        self._warnings = ThrottledWarnings(self)
        self._publisher = self.create_publisher(TossInformationMessage, "toss_information", latched(RESULTS_DEPTH))
        while missed := self._stage.unannounced(LARGEST_PAGE):
            self._announce(missed)
        self._worker = Worker(self.fail)
        self.create_service(GetInformation, "get_information", self._get_information)
        self.create_subscription(ModelParameters, "model_parameters", self._parameters_came, latched(1))
        self._tosses = CatchUp(self, self._worker, TOSSES, self._stage.cursor, self._score, self._caught_up)
        expected = profile(1, reliable=True, latched=False)
        self.create_subscription(TossMessage, EXPECTED_TOSS, self._expected_came, expected, raw=True)
        HealthReport(self, "scores", self._health, self._body.name)

    def close(self) -> None:
        self._worker.stop()
        self._informations.close()

    def _score(self, messages: Sequence[Any], cursor: Cursor) -> None:
        """Scores tosses, stores the information and announces it; on the worker's thread."""
        tosses = [toss for toss in map(self._translated, messages) if toss is not None]
        batch = self._stage.score(tosses, {message.toss_id: message.header.frame_id for message in messages})
        self._announce(batch.new)
        self._stage.advance(cursor)
        for one in batch.not_scored:
            self._warnings.note("not scored", f"toss {one.toss_id}: {one.reason}", dropped=False)

    def _expected_came(self, data: bytes) -> None:
        if not self._worker.waiting:
            self._worker.do(partial(self._begin, data))

    def _begin(self, data: bytes) -> None:
        """Scores what can be scored of a toss that is expected; on the worker's thread."""
        with suppress(InvalidValueError):
            self._stage.begin(checked_body(toss_of(toss_in(data)), self._body))

    def _translated(self, message: Any) -> Toss | None:
        try:
            return checked_body(toss_of(message), self._body)
        except InvalidValueError as error:
            self._warnings.note("bad toss", str(error))
            return None

    def _announce(self, batch: Sequence[Announcement]) -> None:
        for one in batch:
            self._publisher.publish(information_message(one.information, one.sequence, one.stamped))
            self.get_logger().info(one.information.in_words())
        self._stage.announced(batch)

    def _parameters_came(self, message: Any) -> None:
        self._worker.do(partial(self._renew, message))

    def _renew(self, message: Any) -> None:
        """Takes a new theta; all tosses are scored again once they are scored at the present one. On the worker's thread."""
        try:
            theta = theta_in(message, self._body)
            self._published_version = message.version
            if not self._tosses.complete:
                self._stage.postpone(theta)
                return
        except InvalidValueError as error:
            self._warnings.note("bad parameters", str(error))
            return
        self._go_on(theta)

    def _caught_up(self) -> None:
        """Changes to the newest theta when all tosses are scored at the present one; on the worker's thread."""
        theta = self._stage.postponed
        if theta is not None:
            self._go_on(theta)

    def _go_on(self, theta: ScoredTheta) -> None:
        try:
            renewed = self._stage.renew(theta)
        except InvalidValueError as error:
            self._warnings.note("bad parameters", str(error))
            return
        if self._published_version not in ("", self._stage.version):
            self._warnings.note(
                "other body",
                f"parameters of {self._body.name}: found version {self._published_version}, expected {self._stage.version}: "
                "give all nodes the same body (mass, inertia, corners)",
                dropped=False,
            )
        if renewed:
            self.get_logger().info(f"scoring at theta {self._stage.version} from now on")
            self._tosses.restart()

    def _get_information(self, request: Any, response: Any) -> Any:
        response.last_sequence = self._stage.last_sequence
        page = self._stage.after(request.after_sequence, min(request.limit or LARGEST_PAGE, LARGEST_PAGE))
        response.information = [information_message(one.information, one.sequence, one.stamped) for one in page]
        return response

    def _health(self) -> Health:
        values = {
            "stored": self._stage.last_sequence,
            "toss": self._tosses.cursor.sequence,
            "queue": self._worker.waiting,
            "parameters_version": self._stage.version,
            **self._warnings.counts,
        }
        missing = "" if self._tosses.cursor.sequence else awaited(self, "tosses", TOSSES.topic)
        said = f"{self._stage.last_sequence} records at theta {self._stage.version}"
        return Health(said, values, waiting_for=missing)


def main() -> int:
    """Runs the node."""
    return run(FisherScorer, "fisher_scorer")


if __name__ == "__main__":
    sys.exit(main())
