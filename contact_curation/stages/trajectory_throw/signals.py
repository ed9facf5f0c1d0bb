"""What an arm, its controller and the tracker say, and what of it keeps the arm from moving, in one line each.

Times are seconds of one clock, that of the stamps. A stamp that is ahead of this clock is as bad as one that is old: with it,
joint states that stop would be noticed late. One such stamp among sound ones is left out. What is heard may come from any
thread.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from contact_curation.geometry.quaternions import Array
from contact_curation.stages.trajectory_throw.config import TrajectoryConfig

KEPT = 8192
"""Joint states and poses of the body that are remembered."""

STILL, STILL_SPAN = 0.02, 0.1
"""An arm whose joints have moved more slowly than this [rad/s] for so long [s] is at rest."""

FULL_SPEED = 1e-3
"""Largest difference of a speed scaling from 1 that counts as none."""


class ArmSignals:
    """What was heard.

    Args:
        home: (J,) posture that throws begin at [rad].
        now: the clock [s].
        config: what is asked of it.
    """

    def __init__(self, home: Array, now: Callable[[], float], config: TrajectoryConfig) -> None:
        self._home, self._now, self._config = np.asarray(home), now, config
        self._joints: deque[tuple[float, Array]] = deque(maxlen=KEPT)
        self._poses: deque[tuple[float, Array, Array]] = deque(maxlen=KEPT)
        self._scaling: tuple[float, float] | None = None
        self._active: float | None = None

    def joints_seen(self, stamp: float, positions: Array) -> None:
        """Takes a joint state: positions (J,) [rad], in the order of the limits; one that is not finite counts as none."""
        if np.isfinite(positions).all():
            state = stamp, np.asarray(positions, dtype=float)
            self._joints = _with(self._joints, state, self._now(), self._config.oldest_state)

    def body_seen(self, stamp: float, position: Array, orientation_wxyz: Array) -> None:
        """Takes a tracked pose of the body on the board."""
        pose = stamp, np.asarray(position), np.asarray(orientation_wxyz)
        self._poses = _with(self._poses, pose, self._now(), self._config.oldest_signal)

    def scaling_seen(self, share: float) -> None:
        """Takes the speed scaling, 1 for full speed."""
        self._scaling = self._now(), share

    def controller_seen(self) -> None:
        """Takes a sign that the controller is active."""
        self._active = self._now()

    @property
    def joints(self) -> list[tuple[float, Array]]:
        """Joint states, oldest first: stamp [s] and positions (J,) [rad]."""
        return list(self._joints)

    @property
    def poses(self) -> list[tuple[float, Array, Array]]:
        """Poses of the body, oldest first: stamp [s], position (3,) [m], orientation wxyz (4,)."""
        return list(self._poses)

    @property
    def last_joints(self) -> tuple[float, Array] | None:
        """The newest joint state; None before the first."""
        return self._joints[-1] if self._joints else None

    @property
    def speed(self) -> float:
        """Share of the full speed that the arm goes at, as far as is known."""
        return 1.0 if self._scaling is None or not np.isfinite(self._scaling[1]) else self._scaling[1]

    def missing(self) -> list[str]:
        """What keeps the arm from throwing now; nothing moves."""
        found = self.arm_missing()
        if self._joints and not found:
            found += self._away_from_home()
        if not self._poses:
            found.append("tracker: found no pose of the body, expected its poses on the board; is it in view?")
        else:
            age = self._now() - self._poses[-1][0]
            found += _stale("tracker: found the last pose of the body", age, self._config.oldest_signal)
        return found

    def arm_missing(self) -> list[str]:
        """What keeps the arm from moving at all now."""
        config, found, now = self._config, list[str](), self._now()
        if not self._joints:
            found.append("joint states: found none, expected the arm's joints; compare the arm's file with their names")
        else:
            found += _stale("joint states: found the last one", now - self._joints[-1][0], config.oldest_state)
        if config.controller_state and (self._active is None or abs(now - self._active) > config.oldest_signal):
            found.append("controller: found no state of it, expected an active one; activate it")
        if config.speed_scaling:
            found += self._slowed(now)
        return found

    def moving(self) -> list[str]:
        """The joint that moves, if one does."""
        known = self.joints
        recent = [state for state in known if state[0] >= known[-1][0] - STILL_SPAN]
        if len(recent) < 2:
            return []
        (first, before), (last, after) = recent[0], recent[-1]
        speeds = np.abs(after - before) / (last - first)
        joint = int(speeds.argmax())
        if speeds[joint] <= STILL:
            return []
        return [f"joint {joint + 1}: found it moving at {speeds[joint]:.2f} rad/s, expected the arm at rest; wait until it is"]

    def _away_from_home(self) -> list[str]:
        off, allowed = np.abs(self._joints[-1][1] - self._home), self._config.at_home
        joint = int(off.argmax())
        if off[joint] <= allowed:
            return []
        line = f"joint {joint + 1}: found it {off[joint]:.3f} rad from home, expected at most {allowed:g}"
        return [f"{line}; bring the arm home, by hand or by ~/home"]

    def _slowed(self, now: float) -> list[str]:
        if self._scaling is None or abs(now - self._scaling[0]) > self._config.oldest_signal:
            return ["speed scaling: found none, expected 100 %; set trajectory.speed_scaling to false if the arm reports none"]
        if abs(self._scaling[1] - 1.0) <= FULL_SPEED:
            return []
        return [f"speed scaling: found {100.0 * self._scaling[1]:.0f} %, expected 100 %; move the slider to its end"]


def _with[Signal: tuple[Any, ...]](known: deque[Signal], one: Signal, now: float, oldest: float) -> deque[Signal]:
    """What is known, oldest first, and one more signal, which begins with its stamp [s].

    A signal that is ahead of the clock by more than `oldest` is left out while sound ones come. Those that are known give way
    to a sound one: they were stray, or the clock has been set back.
    """
    sound = one[0] <= now + oldest
    if sound and known and known[-1][0] > now + oldest:
        return deque([*(each for each in known if each[0] < one[0]), one], KEPT)  # at once, for other threads
    fresh = known and abs(now - known[-1][0]) <= oldest
    if not known or (one[0] > known[-1][0] and (sound or not fresh)):
        known.append(one)
    return known


def _stale(what: str, age: float, oldest: float) -> list[str]:
    """That a stamp is too old, or ahead."""
    if abs(age) <= oldest:
        return []
    found = f"{what} {abs(age):.2f} s {'old' if age > 0.0 else 'ahead of the clock'}"
    return [f"{found}, expected at most {oldest:g} s; does it still come, and do the clocks agree?"]
