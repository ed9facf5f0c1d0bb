"""The safety gate of an arm: checks every command, and stops the arm when a heartbeat is missing. It denies by default.

The gate begins disarmed. A person arms it. A stop disarms it, and so does a missing heartbeat; it then stays disarmed until it
is armed again. Each arming has a number, so that motions that were allowed before a stop do not resume after it. The gate owns
no clock: every call gets the time of a steady clock.
"""

import threading
from dataclasses import dataclass

import numpy as np

from contact_curation.configs import check_not_negative, check_positive
from contact_curation.design.throw import Throw
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.arm.limits import JointLimits
from contact_curation.simulation.arm.path import JointPath


@dataclass(frozen=True)
class GateConfig:
    """Limits of commands; the defaults follow from throws that were made (method.md 5).

    Attributes:
        largest_speed: largest speed of a release [m/s].
        largest_spin: largest angular speed of a release [rad/s].
        lowest_release: smallest height of the body's centre at release [m].
        highest_release: largest height of the body's centre at release [m].
        workspace: largest distance of a release from the board's middle, in x and in y [m].
        keep_out_place: x and y of the axis of a cylinder around the arm's base [m].
        keep_out_radius: radius of that cylinder; releases lie outside of it [m].
        least_pause: shortest time between the starts of two throws, on a steady clock [s]; 0 for none.
        heartbeat_timeout: the safety gate disarms itself after this time without a heartbeat [s].
    """

    largest_speed: float = 1.4
    largest_spin: float = 11.0
    lowest_release: float = 0.09
    highest_release: float = 0.24
    workspace: float = 0.5
    keep_out_place: tuple[float, float] = (-0.307, -0.5)
    keep_out_radius: float = 0.25
    least_pause: float = 0.0
    heartbeat_timeout: float = 0.4

    def __post_init__(self) -> None:
        positive = ("largest_speed", "largest_spin", "lowest_release", "highest_release", "workspace", "heartbeat_timeout")
        check_positive(self, positive, "gate.")
        check_not_negative(self, ("keep_out_radius", "least_pause"), "gate.")
        if self.lowest_release >= self.highest_release:
            raise InvalidValueError("gate.lowest_release", self.lowest_release, f"less than {self.highest_release}")
        if np.shape(self.keep_out_place) != (2,) or not np.isfinite(self.keep_out_place).all():
            raise InvalidValueError("gate.keep_out_place", self.keep_out_place, "2 finite numbers [m]")
        if self.heartbeat_timeout > 0.5:
            raise InvalidValueError("gate.heartbeat_timeout", self.heartbeat_timeout, "at most 0.5 s")


def out_of_limits(throw: Throw, config: GateConfig) -> str | None:
    """One line that names the limit of commands that a throw violates; None if it violates none."""
    if not np.isfinite(throw.release).all():
        return "throw: found a number that is not finite, expected finite numbers"
    away = float(np.linalg.norm(throw.position[:2] - np.asarray(config.keep_out_place)))
    checks = (
        ("speed", float(np.linalg.norm(throw.linear_velocity)), 0.0, config.largest_speed, "m/s"),
        ("spin", float(np.linalg.norm(throw.angular_velocity)), 0.0, config.largest_spin, "rad/s"),
        ("release height", float(throw.position[2]), config.lowest_release, config.highest_release, "m"),
        ("release place", float(np.abs(throw.position[:2]).max()), 0.0, config.workspace, "m from the board's middle"),
        ("release place", away, config.keep_out_radius, np.inf, "m from the arm's foot"),
    )
    for name, found, lowest, highest, unit in checks:
        if not lowest <= found <= highest:
            expected = f"at least {lowest:g}" if found < lowest else f"at most {highest:g}"
            return f"{name}: found {found:.4g} {unit}, expected {expected}"
    return None


def path_out_of_limits(path: JointPath, limits: JointLimits) -> str | None:
    """One line that says why a motion must not be sent to the joints; None if it may. Repeats the planner's check."""
    if not all(np.isfinite(part).all() for part in (path.positions, path.speeds, path.accelerations)):
        return "path: found a number that is not finite, expected finite numbers"
    outside = np.maximum(path.positions - limits.highest, limits.lowest - path.positions)
    shares: tuple[tuple[str, Array], ...] = (
        ("position", 1.0 + outside),
        ("speed", limits.speed_use(path.positions, path.speeds)),
        ("acceleration", np.abs(path.accelerations) / limits.acceleration),
    )
    for name, share in shares:
        row, joint = np.unravel_index(int(share.argmax()), share.shape)
        if share[row, joint] > 1.0 + 1e-9:
            return f"{name} of joint {joint + 1}: found {share[row, joint]:.3f} of its limit, expected at most 1"
    return None


class SafetyGate:
    """Decides whether the arm may move. Its methods may be called from any thread.

    Args:
        config: limits of commands.
    """

    def __init__(self, config: GateConfig) -> None:
        self.config = config
        self._lock = threading.Lock()
        self._reason = "it was never armed"
        self._arming = 0
        self._armed = self._stopped = False
        self._heard = 0.0
        self._last_throw = -np.inf

    @property
    def arming(self) -> int:
        """Number of the present arming, from 1; 0 while the gate is disarmed."""
        with self._lock:
            return self._arming if self._armed else 0

    @property
    def reason(self) -> str:
        """Why the gate is disarmed; empty while it is armed."""
        with self._lock:
            return "" if self._armed else self._reason

    @property
    def was_stopped(self) -> bool:
        """Whether `stop` was called since the gate was armed; a missing heartbeat does not count."""
        with self._lock:
            return self._stopped

    def arm(self, now: float) -> int:
        """Arms the gate; counts as a heartbeat.

        Args:
            now: time of the steady clock [s].

        Returns:
            The number of this arming.
        """
        with self._lock:
            self._arming += 0 if self._armed else 1
            self._armed, self._stopped, self._heard = True, False, now
            return self._arming

    def stop(self, reason: str) -> None:
        """Disarms the gate until it is armed again. Of several reasons the first one is kept."""
        with self._lock:
            self._disarm(reason)
            self._stopped = True

    def heartbeat(self, now: float) -> None:
        """Records a heartbeat at time `now` [s]: the sender is there and could stop the arm."""
        with self._lock:
            began_anew = self._heard - now > self.config.heartbeat_timeout  # the clock: it may go back in simulations
            self._heard = now if began_anew else max(self._heard, now)

    def watch(self, now: float) -> bool:
        """Whether the arm may move at time `now` [s]; disarms the gate if the heartbeat is missing."""
        silent = self.silence(now)
        if silent > self.config.heartbeat_timeout:
            with self._lock:
                self._disarm(f"no heartbeat for {silent:.2f} s, expected one every {self.config.heartbeat_timeout:g} s")
        return self.arming > 0

    def silence(self, now: float) -> float:
        """Time since the last heartbeat [s]."""
        with self._lock:
            return now - self._heard

    def admits(self, throw: Throw, now: float) -> str | None:
        """One line that says why a throw may not begin at time `now` [s]; None if it may, whose start is then recorded."""
        if not self.watch(now):
            return f"the arm is disarmed ({self.reason}); arm it first"
        line = out_of_limits(throw, self.config)
        if line is not None:
            return line
        with self._lock:
            pause = now - self._last_throw
            if 0.0 <= pause < self.config.least_pause:  # a clock that was set back says nothing
                return f"pause since the last throw: found {pause:.2f} s, expected at least {self.config.least_pause:g} s"
            self._last_throw = now
        return None

    def _disarm(self, reason: str) -> None:
        """Disarms the gate; the caller holds the lock."""
        if self._armed:
            self._armed, self._reason = False, reason
