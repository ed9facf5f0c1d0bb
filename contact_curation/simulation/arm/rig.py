"""Throws and their tosses in one process: the simulated arm throws, a simulated tracker measures poses, which become tosses.

The tracker has the noise of ContactNets', and the poses pass the segmenter and the quality checks of `pose_ingest`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.planner import Planner
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.scalars import ScalarPose
from contact_curation.motion.body_tracker import TrackerConfig
from contact_curation.motion.ingest import IngestConfig, TossIngest
from contact_curation.motion.pose_stream import FramePose
from contact_curation.motion.toss import NANOSECONDS, Toss
from contact_curation.simulation.arm.feasibility import ArmFeasibility
from contact_curation.simulation.arm.safety import GateConfig
from contact_curation.simulation.arm.throw import ArmThrower, ExecutedThrow
from contact_curation.simulation.arm.throw_motion import ThrowPlanner
from contact_curation.simulation.tracker_noise import TrackerNoise, TrackerNoiseConfig
from contact_curation.simulation.world import DEFAULT_WORLD, WorldConfig, free_motion

BOARD = "body_surface"
PAUSE_NS = 10 * NANOSECONDS
"""Pause between two throws [ns]."""

LONGEST_MOTION = 300
"""Frames of a motion in another world than the arm's, 2 s."""


class Seen(NamedTuple):
    """A throw as it was executed, and its toss; None if the poses gave no accepted toss."""

    commanded: Throw
    executed: Throw
    toss: Toss | None


class ArmRig:
    """Throws one body with the simulated arm.

    Args:
        body: body that is thrown.
        seed: random seed of the gripper's delays and the tracker's noise.
        world: contacts that the body meets after its release; by default those of the arm's own simulation.
    """

    def __init__(self, body: Body, seed: int, world: WorldConfig = DEFAULT_WORLD) -> None:
        self.body, self._world = body, world
        self.feasibility = ArmFeasibility(ThrowPlanner(body), GateConfig())
        self._thrower = ArmThrower(self.feasibility.planner, seed=seed)
        self._noise = TrackerNoise(TrackerNoiseConfig(), seed)
        self._now_ns = PAUSE_NS

    def throw(self, throw: Throw) -> Seen:
        """Executes a throw and tracks it.

        Raises:
            InvalidValueError: the arm cannot make the throw.
        """
        made = self._thrower.execute(throw)
        executed = throw_of_state(
            throw.throw_id, throw.body, made.release, throw.expected_information, throw.parameters_version
        )
        return Seen(throw, executed, self._toss(made))

    def random_throws(self, planner: Planner, count: int, seed: int, name: str) -> list[Throw]:
        """Draws throws from a planner's prior that are within the safety limits and that the arm can make."""
        rng, throws = np.random.default_rng([seed, 7]), list[Throw]()
        while len(throws) < count:
            for state in planner.evaluator.draw_safe(planner.prior, 32, rng).states(planner.config.candidates.placement):
                throw = throw_of_state(f"{name}-{len(throws)}", self.body.name, state)
                if len(throws) < count and self.feasibility.refusal(throw) is None:
                    throws.append(throw)
        return throws

    def _toss(self, made: ExecutedThrow) -> Toss | None:
        """The toss that segmenter and quality checks accept from the tracked poses; None if there is none."""
        config = IngestConfig(TrackerConfig(body_frame=f"body_{self.body.name}", board_frame=BOARD))
        ingest = TossIngest(config, self.body, source=made.throw.throw_id)
        events = [event for frame in self._frames(made) for event in ingest.push(frame)]
        found = [event for event in (*events, *ingest.flush()) if isinstance(event, Toss)]
        return found[0] if len(found) == 1 else None

    def _frames(self, made: ExecutedThrow) -> Sequence[FramePose]:
        first_ns, states = self._now_ns, made.states
        if self._world != DEFAULT_WORLD:
            states = free_motion(self.body, made.release, LONGEST_MOTION, made.frame_period, self._world)
        frames = []
        for number, state in enumerate(states):
            stamp_ns = first_ns + round(number * made.frame_period * NANOSECONDS)
            pose = self._noise.seen(stamp_ns, Pose(state[:3], state[3:7]))
            if pose is not None:
                place, turn = (tuple(part.tolist()) for part in (pose.position, pose.orientation_wxyz))
                frames.append(FramePose(stamp_ns, BOARD, f"body_{self.body.name}", ScalarPose(place, turn)))
            self._now_ns = stamp_ns + PAUSE_NS
        return frames
