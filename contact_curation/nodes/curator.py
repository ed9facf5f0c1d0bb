"""Node `curator`: ranks the scored tosses and publishes the selected set."""

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from contact_curation_msgs.msg import CuratedBuffer
from contact_curation_msgs.srv import SaveBuffer
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter

from contact_curation.errors import ContactCurationError, InvalidValueError
from contact_curation.information.ranker import RankingConfig
from contact_curation.nodes.messages.curated_buffer import buffer_message
from contact_curation.nodes.messages.headers import stamped_of
from contact_curation.nodes.messages.toss_information import INFORMATION, information_of
from contact_curation.nodes.ros.body_parameter import declared_body
from contact_curation.nodes.ros.catch_up import CatchUp
from contact_curation.nodes.ros.health import Health, HealthReport, awaited
from contact_curation.nodes.ros.node_main import StageNode, run
from contact_curation.nodes.ros.parameters import declare, declare_config
from contact_curation.nodes.ros.qos import latched
from contact_curation.nodes.ros.throttled_warnings import ThrottledWarnings
from contact_curation.nodes.ros.worker import Latest, Worker
from contact_curation.stages.buffer_manifest import manifest_of
from contact_curation.stages.curation import Buffer, CurationConfig, CurationStage
from contact_curation.stages.parameters import with_parameters
from contact_curation.stages.records import Cursor
from contact_curation.storage.manifest.file import provenance_of, write_manifest
from contact_curation.storage.outputs import check_replaceable, path_below
from contact_curation.storage.stores.information import InformationStore


class Curator(StageNode):
    """Ranks all scored tosses at every change and publishes the best."""

    def __init__(self) -> None:
        super().__init__("curator")
        self._body = declared_body(self)
        ranking = declare_config(self, RankingConfig(), fixed=False)
        config = declare_config(self, CurationConfig())
        store = Path(declare(self, "store", "buffer.sqlite", "file that stores the buffer and all information"))
        folder = declare(self, "save_folder", "", "folder that save_buffer writes in; empty: the folder of the store")
        self._save_folder = Path(folder) if folder else store.parent
        self._overwrites = declare(self, "save_overwrites", False, "whether save_buffer replaces an earlier manifest")
        self._informations = InformationStore(store)
        self._informations.claim()
        self._stage = CurationStage(ranking, config, self._informations, self._body.name)
        self._wanted = self._stage.ranking
        self._warnings = ThrottledWarnings(self)
        self._buffer: Buffer | None = None
        self._publisher = self.create_publisher(CuratedBuffer, "curated_buffer", latched(1))
        self._worker = Worker(self.fail)
        self._curating = Latest(self._worker, self._curate)
        self.create_service(SaveBuffer, "save_buffer", self._asked_to_save, callback_group=ReentrantCallbackGroup())
        self.add_on_set_parameters_callback(self._parameters_set)
        self._information = CatchUp(self, self._worker, INFORMATION, self._stage.cursor, self._take)
        self._curating.want()
        HealthReport(self, "selection", self._health, self._body.name)

    def close(self) -> None:
        self._worker.stop()
        self._informations.close()

    def _take(self, messages: Sequence[Any], cursor: Cursor) -> None:
        """Stores the information of tosses; on the worker's thread."""
        for message in messages:
            try:
                if message.body != self._body.name:
                    raise InvalidValueError(f"body of toss {message.toss_id}", message.body, self._body.name)
                self._stage.add(information_of(message), *stamped_of(message.header))
            except InvalidValueError as error:
                self._warnings.note("bad information", str(error))
        self._stage.advance(cursor)
        self._curating.want()

    def _curate(self) -> None:
        """Ranks all tosses and publishes the buffer; on the worker's thread, once after all messages that have come."""
        before = self._buffer
        try:
            self._buffer = self._stage.buffer()
        except ContactCurationError as error:
            self._warnings.note("not ranked", str(error), dropped=False)
            return
        if self._buffer is not None:
            self._publisher.publish(buffer_message(self._buffer))
            if before is None or before.in_words() != self._buffer.in_words():
                self.get_logger().info(self._buffer.in_words())

    def _parameters_set(self, parameters: list[Parameter]) -> SetParametersResult:
        """Checks new ranking parameters and queues the change for the worker's thread."""
        try:
            ranking = with_parameters(self._wanted, {one.name: one.value for one in parameters})
            self._stage.check(ranking)
        except InvalidValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        if ranking != self._wanted:
            self._wanted = ranking
            self._worker.do(partial(self._rank_by, ranking))
        return SetParametersResult(successful=True)

    def _rank_by(self, ranking: RankingConfig) -> None:
        """Changes how tosses are ranked; on the worker's thread."""
        self._stage.rank_by(ranking)
        self._curating.want()

    async def _asked_to_save(self, request: Any, response: Any) -> Any:
        return await self.done_by(self._worker, partial(self._save, request, response))

    def _save(self, request: Any, response: Any) -> Any:
        """Writes the manifest of a request; on the worker's thread."""
        buffer = self._buffer
        if buffer is None:
            response.message = "found no scored toss, expected at least one"
            return response
        try:
            path = self._manifest_path(request.path)
            write_manifest(manifest_of(buffer, self._stage.last_stamp_ns, self._body.to_mapping()), path)
        except ContactCurationError as error:
            response.message = str(error)
            return response
        response.success, response.path = True, str(path)
        response.tosses = len(buffer.curation.ranking.selected_ids)
        response.message = f"{response.tosses} of {buffer.seen} tosses selected"
        return response

    def _manifest_path(self, asked: str) -> Path:
        """The path of a manifest that a caller asked for.

        Raises:
            InvalidValueError: the path is outside `save_folder`, no file can have it, or one there is kept.
        """
        path = path_below("path", self._save_folder, asked)
        try:
            for taken in (path, provenance_of(path)):
                if self._overwrites:
                    check_replaceable("path", taken, "a new name, or that of an earlier manifest")
                elif taken.exists():
                    raise InvalidValueError("path", f"a file at {taken}", "a new name, or a curator with save_overwrites:=true")
        except OSError as error:  # a name that is too long, a folder that may not be searched
            raise InvalidValueError("path", f"{path.name[:40]!r}: {error.strerror}", "a name that a file can have") from error
        return path

    def _health(self) -> Health:
        buffer = self._buffer
        selected_now = 0 if buffer is None else len(buffer.curation.ranking.selected_ids)
        seen = 0 if buffer is None else buffer.seen
        values = {"selected": selected_now, "seen": seen, "queue": self._worker.waiting, **self._warnings.counts}
        missing = "" if self._information.cursor.sequence else awaited(self, "scored tosses", INFORMATION.topic)
        return Health(f"{selected_now} of {seen} tosses selected", values, waiting_for=missing)


def main() -> int:
    """Runs the node."""
    return run(Curator, "curator")


if __name__ == "__main__":
    sys.exit(main())
