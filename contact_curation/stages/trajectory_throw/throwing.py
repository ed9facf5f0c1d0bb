"""Throws by an arm of one's own, without threads, topics or a clock: plan, trajectory, gripper's command, and what was seen.

A goal is planned, and the body must be in the gripper as the plan holds it; then the plan becomes one trajectory that begins at
a stated time. The arm passes each place a little late (its lag, told from the joint states), and the gripper lets go some time
after its command (its delay, learned from tracked releases). So the command to open goes out at

    begin + planned release + lag - delay

Joints that went too far in the throws before, or not far enough, are told to go less or more far.

While the arm moves, joint states, controller and speed scaling are watched. If one is not as it must be, the arm is stopped on
its path by slowing time down, the gate is disarmed until a person arms it again, and the gripper is not opened any more. Armed
again, it can be asked to go home, slowly and straight in joint space. The release that is returned is the one that the tracker
saw; without one the throw counts as not made.

Times are seconds of one clock, that of the stamps of joint states and tracker. `signals`, `admits`, `admits_homeward` and
`controller_ended` may be used from any thread; everything else belongs to one.
"""

from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.release_delay import (
    DEFAULT_DELAY,
    Delay,
    DelayConfig,
    Seen,
    learned_delay,
    with_release,
)
from contact_curation.design.throw import Throw, throw_of_state
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array, angle_between
from contact_curation.motion.release import DEFAULT_RELEASE, BodyShape, HandPath, ReleaseConfig, Track, find_fall
from contact_curation.simulation.arm.limits import JointLimits
from contact_curation.simulation.arm.path import JointPath, stopped
from contact_curation.simulation.arm.planned_throw import PlannedThrow
from contact_curation.simulation.arm.safety import SafetyGate, path_out_of_limits
from contact_curation.simulation.arm.throw_motion import STEP
from contact_curation.stages.arm import Ending
from contact_curation.stages.following import following
from contact_curation.stages.joint_gains import UNKNOWN_GAINS, Following
from contact_curation.stages.records import GripperRecord
from contact_curation.stages.trajectory_throw.config import TrajectoryConfig
from contact_curation.stages.trajectory_throw.signals import ArmSignals

POINTS_EVERY = 8
"""Samples of a path between two points of the trajectory that is sent."""

RECENT = 1.0
"""Time over which lag and tracking error are told [s]."""

FEWEST_STATES = 5
"""Joint states of a motion before its lag and its tracking error are told."""


class Sent(NamedTuple):
    """A trajectory for the controller.

    Attributes:
        begin: when its first sample is due [s].
        path: samples every `STEP`; at rest at its end.
    """

    begin: float
    path: JointPath

    @property
    def points(self) -> tuple[Array, JointPath]:
        """The samples to send, at rest at the end, and their times (N,) after the beginning [s]."""
        points = self.path.thinned(POINTS_EVERY)
        return STEP * np.minimum(np.arange(len(points)) * POINTS_EVERY, len(self.path) - 1), points


class Step(NamedTuple):
    """What is to be done now.

    Attributes:
        opens: whether the gripper is to be told to open, at once.
        stop: trajectory that replaces the one under way.
        ending: of the goal.
    """

    opens: bool = False
    stop: Sent | None = None
    ending: Ending | None = None


class Phase(StrEnum):
    """What the arm does."""

    IDLE = "waiting for a goal"
    HOLDING = "waiting for the body in the gripper"
    MOVING = "moving"
    HOMEWARD = "going home"
    STOPPING = "stopping"


class TrajectoryThrow:
    """One arm and one gripper.

    Args:
        body: what is thrown.
        limits: of the arm's joints.
        home: (J,) posture that throws begin and end at [rad].
        plan: gives a throw's plan, or in one line why there is none.
        homeward: gives the way home from rest at a posture (J,), or in one line why there is none.
        gate: that every goal passes; a stop disarms it.
        now: the clock [s].
        config: of the arm.
        window: time before and after the planned release for which plans let the body go steadily [s].
        delay: what is assumed of the gripper.
        release: how the beginning of a fall is looked for.
        record: what was learned before.

    Attributes:
        config: of the arm.
        gate: that every goal passes.
        signals: takes what is heard of the arm and the body.
    """

    def __init__(
        self,
        body: Body,
        limits: JointLimits,
        home: Array,
        plan: Callable[[Throw], PlannedThrow | str],
        homeward: Callable[[Array], JointPath | str],
        gate: SafetyGate,
        now: Callable[[], float],
        config: TrajectoryConfig,
        window: float,
        delay: DelayConfig = DEFAULT_DELAY,
        release: ReleaseConfig = DEFAULT_RELEASE,
        record: GripperRecord | None = None,
    ) -> None:
        self.config, self.gate, self._now, self._window = config, gate, now, window
        self._shape = BodyShape(body.vertices, body.inertia, body.gravity)
        self._limits, self._home, self._plan, self._homeward = limits, home, plan, homeward
        self.signals = ArmSignals(home, now, config)
        self._delay_config, self._release_config = delay, release
        self._seen: tuple[Seen, ...] = () if record is None else record.seen
        self._learned = learned_delay(self._seen, delay)
        self._lag = config.lag if record is None else min(record.lag, config.largest_lag)
        self._gains = UNKNOWN_GAINS if record is None or len(record.joints.gains) != len(home) else record.joints
        self._order: Throw | Phase | None = None
        self._throw: PlannedThrow | None = None
        self._path: JointPath | None = None
        self._told: JointPath | None = None
        self._follows: Following | None = None
        self._opened: float | None = None
        self._done: str | None = None
        self._arming = 0
        self._heard = float("nan")
        self._forget()

    def _forget(self) -> None:
        self._state = Phase.IDLE
        self._throw = self._path = self._told = self._follows = None
        self._begin = self._until = 0.0
        self._opened = self._done = None
        self._why = self._gripper_failure = ""
        self._stop_sent = False
        self._order = None  # last: from now on another thread may give the next one

    @property
    def record(self) -> GripperRecord:
        """What was learned."""
        return GripperRecord(self._seen, self._lag, self._gains)

    @property
    def delay(self) -> Delay:
        """What is known of the gripper."""
        return self._learned

    @property
    def lag(self) -> float:
        """Time by which the arm passes places later than planned [s]."""
        return self._lag

    @property
    def busy(self) -> str | None:
        """In one line that a goal or the way home was taken or is under way; None if not."""
        order = self._order
        if isinstance(order, Throw):
            return f"busy with throw {order.throw_id}, expected one goal at a time; wait for its end"
        return None if order is None else "the arm is on its way home, expected one goal at a time; wait until it is there"

    @property
    def wants_home(self) -> bool:
        """Whether the way home was taken or is under way."""
        return self._order is Phase.HOMEWARD

    @property
    def grip(self) -> Pose | None:
        """The body in the flange's frame as the throw that was planned holds it; None if there is none."""
        return None if self._throw is None else self._throw.grip

    @property
    def phase(self) -> Phase:
        """What the arm does."""
        return self._state

    @property
    def released(self) -> bool:
        """Whether the gripper was told to open in this throw."""
        return self._opened is not None

    @property
    def opens_at(self) -> float | None:
        """When the gripper is to be told to open [s]; None if it is not."""
        if self._throw is None or self._state is not Phase.MOVING or self._opened is not None:
            return None
        return self._begin + self._throw.release + self._lag - self.delay.mean

    def controller_ended(self, failure: str) -> None:
        """The controller has ended the trajectory: an empty line if it was followed, else why not."""
        if self._path is not None:
            self._done = failure

    def gripper_failed(self, line: str) -> None:
        """The gripper has answered that it does not open, and why."""
        self._gripper_failure = line

    def admits(self, throw: Throw) -> str | None:
        """Takes a goal, or says in one line why not."""
        refusal = self.busy or next(iter(self.signals.missing()), None) or self._too_uncertain()
        refusal = refusal or self.gate.admits(throw, self._now())
        if refusal is None:
            self._arming = self.gate.arming
            self._order = throw  # last: from now on the other thread may begin it
        return refusal

    def admits_homeward(self) -> str | None:
        """Takes the order to go home, or says in one line why not."""
        disarmed = None if self.gate.watch(self._now()) else f"the arm is disarmed ({self.gate.reason}); arm it first"
        refusal = self.busy or next(iter(self.signals.arm_missing()), None) or disarmed
        refusal = refusal or next(iter(self.signals.moving()), None)
        if refusal is None:
            self._arming = self.gate.arming
            self._order = Phase.HOMEWARD
        return refusal

    def begin_homeward(self) -> Sent | Ending:
        """The trajectory home, which is to be sent at once, or why there is none."""
        last = self.signals.last_joints
        assert last is not None
        path = self._homeward(last[1])
        if isinstance(path, str):
            return self._refused(path)
        return self._sent(path, path, Phase.HOMEWARD)

    def begin(self) -> Sent | Ending | None:
        """Plans the goal that was taken.

        Returns:
            The trajectory, which is to be sent at once, or the goal's ending. None while the body is not in the gripper as
            `grip` says; call it again then.
        """
        if self._throw is None:
            assert isinstance(self._order, Throw)
            plan = self._plan(self._order)
            if isinstance(plan, str):
                return self._refused(plan)
            self._throw, self._state, self._until = plan, Phase.HOLDING, self._now() + self.config.grip_patience
        if self.gate.arming != self._arming:
            return self._refused(f"stopped before it began: {self.gate.reason or 'armed again since'}")
        against = next(iter(self.signals.missing()), "") or self._held_otherwise()
        if not against:
            return self._begun(self._throw)
        return self._refused(against) if self._now() > self._until else None

    def _held_otherwise(self) -> str:
        """In one line how the tracked body is not as the plan holds it; empty if it is."""
        assert self._throw is not None
        (_, position, orientation), config, held = self.signals.poses[-1], self.config, self._throw.held
        away = float(np.linalg.norm(position - held.position))
        turned = float(angle_between(orientation, held.orientation_wxyz))
        if away <= config.grip_error and turned <= config.grip_turn:
            return ""
        found = f"body: found it {1e3 * away:.0f} mm and {turned:.2f} rad from where the throw holds it"
        return (
            f"{found}, expected at most {1e3 * config.grip_error:.0f} mm and {config.grip_turn:g} rad; hold it as ~/grip says"
        )

    def _begun(self, plan: PlannedThrow) -> Sent | Ending:
        early = self.delay.mean - self._lag - plan.release - self.config.lead
        if early > 0.0:
            line = f"delay of the gripper: found it {1e3 * early:.0f} ms longer than the swing, expected it shorter"
            return self._refused(f"{line}; raise trajectory.lead")
        told = self._gains.told(plan.path, self._home)
        return self._sent(plan.path, plan.path if path_out_of_limits(told, self._limits) else told, Phase.MOVING)

    def _sent(self, path: JointPath, told: JointPath, state: Phase) -> Sent | Ending:
        if self.gate.arming != self._arming:
            return self._refused(f"stopped before it began: {self.gate.reason or 'armed again since'}")
        self._path, self._told, self._state, self._begin = path, told, state, self._now() + self.config.lead
        self._until = self._begin + (len(path) - 1) * STEP + self.config.patience
        return Sent(self._begin, told)

    def _refused(self, why: str) -> Ending:
        self._forget()
        return Ending(False, why)

    def _too_uncertain(self) -> str | None:
        least, most = self.delay.least_jitter, 0.5 * self._window
        if self.delay.throws >= self.config.learning and least > most:
            line = f"jitter of the gripper: found at least {1e3 * least:.1f} ms, expected at most {1e3 * most:.1f} ms"
            return f"{line}; raise steady.window, or mend the gripper and remove the file of the parameter state"
        return None

    def advance(self) -> Step:
        """What is to be done; call it often, and at `opens_at`."""
        if self._path is None:
            return Step()
        now = self._now()
        self.gate.watch(now)
        seen = self._done is not None and (self._opened is None or self._fallen(now))
        if self._state is Phase.STOPPING:
            return Step(ending=self._at_rest() if seen or now > self._until else None)
        against = self._against(now)
        if against:
            return self._stopped(now, against)
        opens_at = self.opens_at
        if opens_at is not None and now >= opens_at:
            if now - opens_at > self._window:
                return self._stopped(now, f"the gripper's command would be {1e3 * (now - opens_at):.0f} ms late")
            self._opened = now
            return Step(opens=True)
        return Step(ending=self._ended() if seen else None)

    def cancel(self, why: str = "cancelled") -> Step:
        """Stops what is under way; the gate stays armed."""
        if self._state is Phase.HOLDING:
            return Step(ending=self._refused(f"{why} before it began"))
        moving = self._state in (Phase.MOVING, Phase.HOMEWARD)
        return self._stopped(self._now(), why, latches=False) if moving else Step()

    def _against(self, now: float) -> str:
        """Why the arm must not go on; empty if it may."""
        if self.gate.arming != self._arming:
            return self.gate.reason or "armed again since"
        if self._done:
            return f"the controller gave up: {self._done}"
        if self._done is not None and self._opened is None and self._throw is not None:
            return "the controller ended before the release"
        if now < self._begin - 2.0 * self.config.lead:
            return f"the clock was set back by at least {self._begin - self.config.lead - now:.1f} s"
        if now > self._until:
            return f"the controller has not ended {self.config.patience:g} s after the trajectory"
        missing = self.signals.arm_missing()
        if missing and self._done is None:
            return missing[0]
        found = self._following()
        if found is None:
            return ""
        allowed = self.config.tracking_error
        if found.error > allowed:
            return f"joint {found.joint}: found it {found.error:.3f} rad from its path, expected at most {allowed:g}"
        if self._opened is None and self._throw is not None:
            self._lag, self._follows = found.lag, found
        return ""

    def _following(self) -> Following | None:
        """How the arm follows its path so far; None where nothing was seen since the last call."""
        assert self._path is not None
        assert self._told is not None
        known = self.signals.joints
        if not known or known[-1][0] == self._heard:
            return None
        self._heard = known[-1][0]
        states = [(stamp, joints) for stamp, joints in known if stamp >= max(self._begin, known[-1][0] - RECENT)]
        if len(states) < FEWEST_STATES:
            return None
        times = np.array([stamp for stamp, _ in states]) - self._begin
        positions = np.array([one for _, one in states])
        return following(self._path, self._told, self._home, times, positions, self._lag, self.config.largest_lag)

    def _stopped(self, now: float, why: str, *, latches: bool = True) -> Step:
        """Stops the arm on its path, or leaves it where the controller left it."""
        assert self._told is not None
        if latches:
            self.gate.stop(why)
        self._state, self._why = Phase.STOPPING, why
        if self._done is not None:
            self._until = now + self.config.patience
            return Step()
        at = now + self.config.stop_lead
        path = stopped(self._told, self._progress(at), STEP, self._limits.acceleration)
        self._stop_sent = True
        self._until = at + len(path) * STEP + self.config.patience
        return Step(stop=Sent(at, path))

    def _progress(self, at: float) -> float:
        """How far along its path the controller is at a time [s]; behind time where the speed is scaled."""
        assert self._path is not None
        by_time, share, last = max(at - self._begin, 0.0), self.signals.speed, self.signals.last_joints
        if share == 1.0 or by_time == 0.0 or last is None:
            return by_time
        stamp, joints = last
        passed = self._path.positions[: max(int((stamp - self._begin) / STEP), 1)]
        place = STEP * float(np.linalg.norm(passed - joints, axis=1).argmin())
        return min(place + self._lag + share * (at - stamp), by_time)

    def _at_rest(self) -> Ending:
        """The outcome after a stop; says so if nobody knows that the arm has stopped."""
        if self._stop_sent and self._done is None:
            self._why += f"; the controller has not ended {self.config.patience:g} s after the stop, the arm may still move"
        elif self._stop_sent and self._done:
            self._why += f"; the controller did not follow the stop: {self._done}"
        return self._ended()

    def _fallen(self, now: float) -> bool:
        """Whether the whole fall must have been seen."""
        config = self._release_config
        return self._opened is not None and now >= self._opened + config.latest + config.flight_span

    def _ended(self) -> Ending:
        """The goal's outcome, with the release as the tracker saw it."""
        released = None if self._opened is None else self._release(self._opened)
        why, homeward = self._why, self.wants_home
        if self._gripper_failure and isinstance(released, str):
            released += f"; the gripper said: {self._gripper_failure}"
        self._forget()
        if homeward:
            return Ending(False, f"stopped on the way home: {why}") if why else Ending(True, "at home")
        if released is None:
            return Ending(False, f"stopped before the release: {why}")
        if isinstance(released, str):
            return Ending(False, f"stopped after the gripper's command: {why}; {released}" if why else released)
        executed, at, remark = released
        if why:
            return Ending(False, f"stopped after the release: {why}", executed, at)
        return Ending(True, f"thrown; {remark}", executed, at)

    def _release(self, opened: float) -> tuple[Throw, float, str] | str:
        """The throw as executed, when, and what else is to be said; or why none was seen. Learns from it."""
        assert self._throw is not None
        plan, expected = self._throw, self._begin + self._throw.release + self._lag
        hand = HandPath(self._begin + self._lag + plan.hand_times, plan.hand)
        config = self._release_config
        first, last = opened - 2.0 * config.held_span, opened + config.latest + 2.0 * config.flight_span
        poses = [pose for pose in self.signals.poses if first <= pose[0] <= last]
        if not poses:
            return "the tracker saw nothing of the release"
        track = Track(*(np.array(part) for part in zip(*poses)))
        fall = find_fall(track, hand, opened, expected, self._shape, config)
        if isinstance(fall, str):
            return fall
        self._seen, changed = with_release(self._seen, Seen(fall.time - opened, fall.time_sd), self._delay_config)
        self._learned = learned_delay(self._seen, self._delay_config)
        if self._follows is not None:
            self._gains = self._gains.after(self._follows)
        throw = plan.throw
        executed = throw_of_state(throw.throw_id, throw.body, fall.state, throw.expected_information, throw.parameters_version)
        late = 1e3 * (fall.time - expected)
        remark = f"released {abs(late):.0f} ms {'late' if late > 0.0 else 'early'}"
        return executed, fall.time, f"{remark}; {changed}" if changed else remark
