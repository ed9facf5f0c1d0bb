"""Processor time of each step from the pose that ends a toss to the message with its information, and of what is done before.

The stages of pose_ingest and fisher_scorer take simulated tosses in one process, on one thread and without a middleware. What
`graph_latency` measures beyond their sum is waiting: for the middleware, for threads, for the disk. On a busy machine compare
the least times; processor time, too, grows there.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.speed.toss_stages [--tosses N]
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from contact_curation_msgs.msg import Toss as TossMessage
from rclpy.serialization import deserialize_message, serialize_message

from contact_curation.contact.body import CONTACTNETS_CUBE as CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import DEFAULT_LOSS
from contact_curation.contact.parameter_form import Form
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.information.scoring import Scorer, ScoringConfig
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.lead_in import surrounded
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Toss
from contact_curation.nodes.messages.toss import toss_message, toss_of
from contact_curation.nodes.messages.toss_bytes import toss_bytes, toss_in
from contact_curation.nodes.messages.toss_information import information_message
from contact_curation.stages.ingest import Arrival, IngestJournal
from contact_curation.stages.scored_theta import theta_of_geometry
from contact_curation.stages.scoring import ScoringStage
from contact_curation.storage.stores.information import InformationStore
from contact_curation.storage.stores.tosses import StoredToss, TossStore
from test.simulated import RIG_NOISE, simulated_tosses

SEED, BOARD = 5, "body_surface"
BEFORE, AFTER = 60, 30
"""Frames around each toss: the body is carried, and lies."""

CONFIG = ScoringConfig(form=Form.RIGID, loss=replace(DEFAULT_LOSS, threads=1))
"""As in fisher_scorer."""


class Stages:
    """What the two nodes do, with the processor time [ms] of each step."""

    def __init__(self, folder: Path) -> None:
        self.times: dict[str, list[float]] = {}
        self._tosses, informations = TossStore(folder / "tosses"), InformationStore(folder / "information")
        self._complete: list[Toss] = []
        ingest = TossIngest(IngestConfig(TrackerConfig("body_cube")), CUBE, source="benchmark", complete=self._complete.append)
        self._journal = IngestJournal(ingest, self._tosses, "benchmark", "/poses")
        theta = theta_of_geometry(ContactGeometry.of_body(CUBE))
        self._scoring = ScoringStage(CUBE, CONFIG, informations, theta)
        self._scorer = Scorer(ContactGeometry.of_body(CUBE), CUBE, CONFIG)

    def take(self, pose: FramePose) -> None:
        """Takes a pose, and goes on with the toss that it is the last of or ends."""
        began = time.thread_time_ns()
        happened = self._journal.take([Arrival("/poses", pose.stamp_ns, pose)])
        spent = (time.thread_time_ns() - began) * 1e-6
        self.times.setdefault("a pose that ends a toss: cut, judge, store" if happened.tosses else "any other pose", []).append(
            spent
        )
        while self._complete:
            self._meanwhile(self._complete.pop(0))
        for stored in happened.tosses:
            self._end(stored)
        if (expected := self._journal.expected()) is not None:
            data = self._timed("before: toss to bytes", lambda: toss_bytes(expected, 0, BOARD))
            self._timed("before: sync the store", self._journal.sync_ahead)
            self._timed("before: score what is new but the last", lambda: self._scoring.begin(toss_of(toss_in(data))))
        elif (nearing := self._journal.nearing_end()) is not None:
            data = self._timed("earlier: toss so far to bytes", lambda: toss_bytes(nearing, 0, BOARD))
            self._timed("earlier: score all but the last transition", lambda: self._scoring.begin(toss_of(toss_in(data))))

    def _meanwhile(self, toss: Toss) -> None:
        data = self._timed("meanwhile: complete toss to bytes", lambda: toss_bytes(toss, 0, BOARD))
        self._timed("meanwhile: score the last transition", lambda: self._scoring.begin(toss_of(toss_in(data))))

    def _end(self, stored: StoredToss) -> None:
        data = self._timed("toss to bytes", lambda: toss_bytes(stored.toss, stored.sequence, BOARD))
        toss = self._timed("bytes to toss", lambda: toss_of(toss_in(data)))
        batch = self._timed("store the information", lambda: self._scoring.score([toss], {toss.toss_id: BOARD}))
        (one,) = batch.new
        message = self._timed("information to message", lambda: information_message(one.information, 1, one.stamped))
        self._timed("message to bytes", lambda: serialize_message(message))
        self._timed("for comparison: objects to bytes and back", lambda: _through_objects(stored.toss))
        self._timed("for comparison: score the whole toss", lambda: self._scorer.score([toss]))

    def _timed[R](self, step: str, work: Callable[[], R]) -> R:
        began = time.thread_time_ns()
        result = work()
        self.times.setdefault(step, []).append((time.thread_time_ns() - began) * 1e-6)
        return result


def _through_objects(toss: Toss) -> Toss:
    return toss_of(deserialize_message(serialize_message(toss_message(toss, 1, BOARD)), TossMessage))


def poses(count: int) -> Iterator[FramePose]:
    """Of a body that is tossed so often."""
    for toss in simulated_tosses(count, SEED, RIG_NOISE):
        around = surrounded(toss, BEFORE, AFTER, SegmenterConfig())
        first_ns = int(toss.stamps_ns[0])
        rows = (around.stamps_ns.tolist(), around.positions.tolist(), around.orientations_wxyz.tolist())
        for stamp_ns, (x, y, z), (qw, qx, qy, qz) in zip(*rows, strict=True):
            pose = ScalarPose((x, y, z), (qw, qx, qy, qz))
            yield FramePose(first_ns + stamp_ns, BOARD, "body_cube", pose)


def main() -> int:
    """Prints a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--tosses", type=int, default=64, help="how many (default 64)")
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder:
        stages = Stages(Path(folder))
        for pose in poses(arguments.tosses):
            stages.take(pose)
    print(f"{'step':48s}{'times':>8s}{'least':>10s}{'median':>10s}")
    for step, times in stages.times.items():
        print(f"{step:48s}{len(times):8d}{min(times):7.2f} ms{np.median(times):7.2f} ms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
