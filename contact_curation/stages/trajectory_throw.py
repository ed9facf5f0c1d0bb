"""Throws by an arm of one's own, without threads, topics or a clock: plan, trajectory, gripper's command, and what was seen.

A goal is planned, and the body must be in the gripper as the plan holds it; then the plan becomes one trajectory that begins at
a stated time. The arm passes each place a little late (its lag,
told from the joint states), and the gripper lets go some time after its command (its delay, learned from tracked releases). So
the command to open goes out at

    begin + planned release + lag - delay

While the arm moves, joint states, controller and speed scaling are watched. If one is not as it must be, the arm is stopped on
its path by slowing time down, the gate is disarmed until a person arms it again, and the gripper is not opened any more. Armed
again, it can be asked to go home, slowly and straight in joint space. The
release that is returned is the one that the tracker saw; without one the throw counts as not made.

Times are seconds of one clock, that of the stamps of joint states and tracker. What is seen may come from any thread, `admits`
too; everything else belongs to one.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
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
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.poses import Pose
from contact_curation.geometry.quaternions import Array, angle_between
from contact_curation.motion.release import DEFAULT_RELEASE, BodyShape, HandPath, ReleaseConfig, Track, find_fall
from contact_curation.simulation.arm.limits import JointLimits
from contact_curation.simulation.arm.path import JointPath, stopped
from contact_curation.simulation.arm.planned_throw import PlannedThrow
from contact_curation.simulation.arm.safety import SafetyGate
from contact_curation.simulation.arm.throw_motion import STEP
from contact_curation.stages.arm import Ending
from contact_curation.stages.joint_following import Following, following
from contact_curation.stages.records import GripperRecord

KEPT = 8192
"""Joint states and poses of the body that are remembered."""

RECENT = 1.0
"""Time over which lag and tracking error are told [s]."""

FEWEST_STATES = 5
"""Joint states of a motion before its lag and its tracking error are told."""


@dataclass(frozen=True)
class TrajectoryConfig:
    """What a thrower asks of an arm, and how long it waits.

    Attributes:
        lead: a trajectory is sent so long before it begins [s].
        stop_lead: the trajectory of a stop is sent so long before it begins [s].
        oldest_state: joint states older than this stop the arm [s].
        oldest_signal: a controller's state or a speed scaling older than this stops the arm [s].
        tracking_error: largest distance of a joint from its path, which is as late as the arm is [rad].
        largest_lag: largest time by which the arm may be late [s].
        lag: guess of the time by which the arm is late, before the first throw [s].
        at_home: largest distance of a joint from home before a throw [rad].
        window: time before and after the planned release for which the body goes steadily, as the arm's swing has it [s].
        grip_error: largest distance of the held body from where the plan holds it [m].
        grip_turn: largest error of the held body's orientation [rad].
        grip_patience: how long to wait for the body to be put into the gripper so [s].
        learning: so many first releases may be more uncertain than the window allows: they show the gripper's delay.
        patience: how long to wait for the controller's end after the trajectory's [s].
        speed_scaling: whether a speed scaling is reported and must be at 100 %.
        controller_state: whether the controller reports its state while it is active.
    """

    lead: float = 0.3
    stop_lead: float = 0.05
    oldest_state: float = 0.1
    oldest_signal: float = 0.5
    tracking_error: float = 0.05
    largest_lag: float = 0.2
    lag: float = 0.0
    at_home: float = 0.02
    window: float = 0.03
    grip_error: float = 0.02
    grip_turn: float = 0.15
    grip_patience: float = 45.0
    learning: int = 3
    patience: float = 3.0
    speed_scaling: bool = True
    controller_state: bool = True

    def __post_init__(self) -> None:
        for name in ("lead", "stop_lead", "oldest_state", "oldest_signal", "tracking_error", "largest_lag", "at_home", "window",
                     "patience", "grip_error", "grip_turn", "grip_patience"):  # fmt: skip
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise InvalidValueError(f"trajectory.{name}", getattr(self, name), "a positive number")
        if not 0.0 <= self.lag <= self.largest_lag:
            raise InvalidValueError("trajectory.lag", self.lag, f"between 0 and {self.largest_lag:g} s")
        if self.learning < 0:
            raise InvalidValueError("trajectory.learning", self.learning, "0 or more")


class Sent(NamedTuple):
    """A trajectory for the controller.

    Attributes:
        begin: when its first sample is due [s].
        path: samples every `STEP`; at rest at its end.
    """

    begin: float
    path: JointPath


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
        delay: what is assumed of the gripper.
        release: how the beginning of a fall is looked for.
        record: what was learned before.
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
        delay: DelayConfig = DEFAULT_DELAY,
        release: ReleaseConfig = DEFAULT_RELEASE,
        record: GripperRecord | None = None,
    ) -> None:
        self.config, self.gate, self._now = config, gate, now
        self._shape = BodyShape(body.vertices, body.inertia, body.gravity)
        self._limits, self._home, self._plan, self._homeward = limits, np.asarray(home), plan, homeward
        self._delay_config, self._release_config = delay, release
        self._seen: tuple[Seen, ...] = () if record is None else record.seen
        self._learned = learned_delay(self._seen, delay)
        self._lag = config.lag if record is None else min(record.lag, config.largest_lag)
        self._joints: deque[tuple[float, Array]] = deque(maxlen=KEPT)
        self._poses: deque[tuple[float, Array, Array]] = deque(maxlen=KEPT)
        self._scaling: tuple[float, float] | None = None
        self._active: float | None = None
        self._wanted: Throw | None = None
        self._wants_home = False
        self._throw: PlannedThrow | None = None
        self._path: JointPath | None = None
        self._opened: float | None = None
        self._done: str | None = None
        self._arming = 0
        self._told = float("nan")
        self._forget()

    def _forget(self) -> None:
        self._state = Phase.IDLE
        self._wanted = self._throw = self._path = None
        self._wants_home = False
        self._begin = self._until = 0.0
        self._opened = self._done = None
        self._why = ""

    @property
    def record(self) -> GripperRecord:
        """What was learned."""
        return GripperRecord(self._seen, self._lag)

    @property
    def delay(self) -> Delay:
        """What is known of the gripper."""
        return self._learned

    @property
    def lag(self) -> float:
        """Time by which the arm passes places later than planned [s]."""
        return self._lag

    @property
    def busy(self) -> bool:
        """Whether a goal or the way home was taken or is under way."""
        return self._wanted is not None or self._wants_home

    @property
    def wants_home(self) -> bool:
        """Whether the way home was taken or is under way."""
        return self._wants_home

    @property
    def grip(self) -> Pose | None:
        """The body in the flange's frame as the throw that was planned holds it; None if there is none."""
        return None if self._throw is None else self._throw.grip

    @property
    def phase(self) -> Phase:
        """What the arm does."""
        return self._state

    @property
    def opens_at(self) -> float | None:
        """When the gripper is to be told to open [s]; None if it is not."""
        if self._throw is None or self._state is not Phase.MOVING or self._opened is not None:
            return None
        return self._begin + self._throw.release + self._lag - self.delay.mean

    def joints_seen(self, stamp: float, positions: Array) -> None:
        """Takes a joint state: positions (J,) [rad], in the order of the limits."""
        if not self._joints or stamp > self._joints[-1][0]:
            self._joints.append((stamp, np.asarray(positions, dtype=float)))

    def body_seen(self, stamp: float, position: Array, orientation_wxyz: Array) -> None:
        """Takes a tracked pose of the body on the board."""
        if not self._poses or stamp > self._poses[-1][0]:
            self._poses.append((stamp, np.asarray(position), np.asarray(orientation_wxyz)))

    def scaling_seen(self, share: float) -> None:
        """Takes the speed scaling, 1 for full speed."""
        self._scaling = self._now(), share

    def controller_seen(self) -> None:
        """Takes a sign that the controller is active."""
        self._active = self._now()

    def controller_ended(self, failure: str) -> None:
        """The controller has ended the trajectory: an empty line if it was followed, else why not."""
        if self._path is not None:
            self._done = failure

    def missing(self) -> tuple[str, ...]:
        """What keeps the arm from throwing now, one line each; nothing moves."""
        found = self._signals_missing()
        if self._joints and not found:
            off = np.abs(self._joints[-1][1] - self._home)
            joint, allowed = int(off.argmax()), self.config.at_home
            if off[joint] > allowed:
                line = f"joint {joint + 1}: found it {off[joint]:.3f} rad from home, expected at most {allowed:g}"
                found.append(f"{line}; bring the arm home, by hand or by ~/home")
        if not self._poses or self._now() - self._poses[-1][0] > self.config.oldest_signal:
            found.append("tracker: found no pose of the body, expected its poses on the board")
        return tuple(found)

    def _signals_missing(self) -> list[str]:
        """What the arm and its controller do not say or say wrongly."""
        config, found, now = self.config, list[str](), self._now()
        if not self._joints:
            found.append("joint states: found none, expected the arm's joints")
        elif (age := now - self._joints[-1][0]) > config.oldest_state:
            found.append(f"joint states: found the last one {age:.2f} s old, expected at most {config.oldest_state:g} s")
        if config.controller_state and (self._active is None or now - self._active > config.oldest_signal):
            found.append("controller: found no state of it, expected an active one; activate it")
        if config.speed_scaling:
            found += self._scaling_refusal(now)
        return found

    def _scaling_refusal(self, now: float) -> list[str]:
        if self._scaling is None or now - self._scaling[0] > self.config.oldest_signal:
            return ["speed scaling: found none, expected 100 %; set trajectory.speed_scaling to false if the arm reports none"]
        if abs(self._scaling[1] - 1.0) > 1e-3:
            return [f"speed scaling: found {100.0 * self._scaling[1]:.0f} %, expected 100 %"]
        return []

    def admits(self, throw: Throw) -> str | None:
        """Takes a goal, or says in one line why not."""
        refusal = self._busy() or next(iter(self.missing()), None) or self._too_uncertain()
        refusal = refusal or self.gate.admits(throw, self._now())
        if refusal is None:
            self._arming = self.gate.arming
            self._wanted = throw  # last: from now on the other thread may begin it
        return refusal

    def admits_homeward(self) -> str | None:
        """Takes the order to go home, or says in one line why not."""
        disarmed = None if self.gate.watch(self._now()) else f"the arm is disarmed ({self.gate.reason}); arm it first"
        refusal = self._busy() or next(iter(self._signals_missing()), None) or disarmed
        if refusal is None:
            self._arming = self.gate.arming
            self._wants_home = True
        return refusal

    def _busy(self) -> str | None:
        if self._wanted is not None:
            return f"busy with throw {self._wanted.throw_id}, expected one goal at a time"
        return "the arm is on its way home, expected one goal at a time" if self._wants_home else None

    def begin_homeward(self) -> Sent | Ending:
        """The trajectory home, which is to be sent at once, or why there is none."""
        path = self._homeward(self._joints[-1][1])
        if isinstance(path, str):
            return self._refused(path)
        return self._sent(path, Phase.HOMEWARD)

    def begin(self) -> Sent | Ending | None:
        """Plans the goal that was taken.

        Returns:
            The trajectory, which is to be sent at once, or the goal's ending. None while the body is not in the gripper as
            `grip` says; call it again then.
        """
        if self._throw is None:
            assert self._wanted is not None
            plan = self._plan(self._wanted)
            if isinstance(plan, str):
                return self._refused(plan)
            self._throw, self._state, self._until = plan, Phase.HOLDING, self._now() + self.config.grip_patience
        if self.gate.arming != self._arming:
            return self._refused(f"stopped before it began: {self.gate.reason or 'armed again since'}")
        against = next(iter(self.missing()), "") or self._held_otherwise()
        if not against:
            return self._begun(self._throw)
        return self._refused(against) if self._now() > self._until else None

    def _held_otherwise(self) -> str:
        """In one line how the tracked body is not as the plan holds it; empty if it is."""
        assert self._throw is not None
        (_, position, orientation), config, held = self._poses[-1], self.config, self._throw.held
        away = float(np.linalg.norm(position - held.position))
        turned = float(angle_between(orientation, held.orientation_wxyz))
        if away <= config.grip_error and turned <= config.grip_turn:
            return ""
        found = f"{1e3 * away:.0f} mm and {turned:.2f} rad from where the throw holds it"
        return f"body: found it {found}, expected at most {1e3 * config.grip_error:.0f} mm and {config.grip_turn:g} rad"

    def _begun(self, plan: PlannedThrow) -> Sent | Ending:
        early = self.delay.mean - self._lag - plan.release - self.config.lead
        if early > 0.0:
            return self._refused(
                f"delay of the gripper: found it {1e3 * early:.0f} ms longer than the swing, expected it shorter"
            )
        return self._sent(plan.path, Phase.MOVING)

    def _sent(self, path: JointPath, state: Phase) -> Sent | Ending:
        if self.gate.arming != self._arming:
            return self._refused(f"stopped before it began: {self.gate.reason or 'armed again since'}")
        self._path, self._state, self._begin = path, state, self._now() + self.config.lead
        self._until = self._begin + (len(path) - 1) * STEP + self.config.patience
        return Sent(self._begin, path)

    def _refused(self, why: str) -> Ending:
        self._forget()
        return Ending(False, why)

    def _too_uncertain(self) -> str | None:
        delay, window = self.delay, self.config.window
        if delay.throws >= self.config.learning and 2.0 * delay.next_sd > window:
            found = f"{1e3 * delay.next_sd:.1f} ms (standard deviation)"
            return f"delay of the gripper: found it uncertain by {found}, expected at most {0.5e3 * window:.1f} ms"
        return None

    def advance(self) -> Step:
        """What is to be done; call it often, and at `opens_at`."""
        if self._path is None:
            return Step()
        now = self._now()
        self.gate.watch(now)
        seen = self._done is not None and (self._opened is None or self._fallen(now))
        if self._state is Phase.STOPPING:
            return Step(ending=self._ended() if seen or now > self._until else None)
        against = self._against(now)
        if against:
            return self._stopped(now, against)
        opens_at = self.opens_at
        if opens_at is not None and now >= opens_at:
            if now - opens_at > self.config.window:
                return self._stopped(now, f"the gripper's command would be {1e3 * (now - opens_at):.0f} ms late")
            self._opened = now
            return Step(opens=True)
        return Step(ending=self._ended() if seen else None)

    def cancel(self) -> Step:
        """Stops the goal that is under way; the gate stays armed."""
        if self._state is Phase.HOLDING:
            return Step(ending=self._refused("cancelled before it began"))
        return self._stopped(self._now(), "cancelled", latches=False) if self._state is Phase.MOVING else Step()

    def _against(self, now: float) -> str:
        """Why the arm must not go on; empty if it may."""
        if self.gate.arming != self._arming:
            return self.gate.reason or "armed again since"
        if self._done:
            return f"the controller gave up: {self._done}"
        if self._done is not None and self._opened is None and self._throw is not None:
            return "the controller ended before the release"
        if now > self._until:
            return f"the controller has not ended {self.config.patience:g} s after the trajectory"
        missing = self._signals_missing()
        if missing and self._done is None:
            return missing[0]
        found = self._following()
        if found is None:
            return ""
        allowed = self.config.tracking_error
        if found.error > allowed:
            return f"joint {found.joint}: found it {found.error:.3f} rad from its path, expected at most {allowed:g}"
        if self._opened is None and self._throw is not None:
            self._lag = found.lag
        return ""

    def _following(self) -> Following | None:
        """How the arm follows its path so far; None where nothing was seen since the last call."""
        assert self._path is not None
        known = list(self._joints)
        if not known or known[-1][0] == self._told:
            return None
        self._told = known[-1][0]
        states = [(stamp, joints) for stamp, joints in known if stamp >= max(self._begin, known[-1][0] - RECENT)]
        if len(states) < FEWEST_STATES:
            return None
        times = np.array([stamp for stamp, _ in states]) - self._begin
        return following(self._path, times, np.array([one for _, one in states]), self._lag, self.config.largest_lag)

    def _stopped(self, now: float, why: str, *, latches: bool = True) -> Step:
        """Stops the arm on its path, or leaves it where the controller left it."""
        assert self._path is not None
        if latches:
            self.gate.stop(why)
        self._state, self._why = Phase.STOPPING, why
        if self._done is not None:
            self._until = now + self.config.patience
            return Step()
        at = now + self.config.stop_lead
        path = stopped(self._path, self._progress(at), STEP, self._limits.acceleration)
        self._until = at + len(path) * STEP + self.config.patience
        return Step(stop=Sent(at, path))

    def _progress(self, at: float) -> float:
        """How far along its path the controller is at a time [s]; behind time where the speed is scaled."""
        assert self._path is not None
        by_time = max(at - self._begin, 0.0)
        share = 1.0 if self._scaling is None else self._scaling[1]
        if share == 1.0 or by_time == 0.0 or not self._joints:
            return by_time
        stamp, joints = self._joints[-1]
        passed = self._path.positions[: max(int((stamp - self._begin) / STEP), 1)]
        place = STEP * float(np.linalg.norm(passed - joints, axis=1).argmin())
        return min(place + self._lag + share * (at - stamp), by_time)

    def _fallen(self, now: float) -> bool:
        """Whether the whole fall must have been seen."""
        config = self._release_config
        return self._opened is not None and now >= self._opened + config.latest + config.flight_span

    def _ended(self) -> Ending:
        """The goal's outcome, with the release as the tracker saw it."""
        released = None if self._opened is None else self._release(self._opened)
        why, homeward = self._why, self._wants_home
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
        poses = [pose for pose in list(self._poses) if first <= pose[0] <= last]
        if not poses:
            return "the tracker saw nothing of the release"
        track = Track(*(np.array(part) for part in zip(*poses)))
        fall = find_fall(track, hand, opened, expected, self._shape, config)
        if isinstance(fall, str):
            return fall
        self._seen, changed = with_release(self._seen, Seen(fall.time - opened, fall.time_sd), self._delay_config)
        self._learned = learned_delay(self._seen, self._delay_config)
        throw = plan.throw
        executed = throw_of_state(throw.throw_id, throw.body, fall.state, throw.expected_information, throw.parameters_version)
        late = 1e3 * (fall.time - expected)
        remark = f"released {abs(late):.0f} ms {'late' if late > 0.0 else 'early'}"
        return executed, fall.time, f"{remark}; {changed}" if changed else remark
