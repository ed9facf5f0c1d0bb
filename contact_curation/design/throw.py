"""A throw: the command to release the body in a state, why that state, and what became of it."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import StrEnum

import numpy as np

from contact_curation.configs import plain_values
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.poses import QUATERNION_TOLERANCE
from contact_curation.geometry.quaternions import Array

VECTORS = {"position": 3, "orientation_wxyz": 4, "linear_velocity": 3, "angular_velocity": 3}
TEXTS = ("throw_id", "body", "parameters_version")
LONGEST_TEXT = 200


@dataclass(frozen=True, eq=False)
class Throw:
    """Where and how the body leaves the gripper; checked when made.

    Attributes:
        throw_id: unique among the throws of a plan.
        body: name of the body.
        position: (3,) [m] in the board's frame.
        orientation_wxyz: (4,) unit quaternion, body to board.
        linear_velocity: (3,) [m/s] in the board's frame.
        angular_velocity: (3,) [rad/s] in the body's frame.
        expected_information: gain in log-det that was planned.
        parameters_version: the theta it was planned with; empty when it was planned without one.
    """

    throw_id: str
    body: str
    position: Array
    orientation_wxyz: Array
    linear_velocity: Array
    angular_velocity: Array
    expected_information: float = 0.0
    parameters_version: str = ""

    def __post_init__(self) -> None:
        for name in TEXTS:
            object.__setattr__(self, name, _checked_text(name, getattr(self, name)))
        for name, size in VECTORS.items():
            object.__setattr__(self, name, _checked_vector(self.throw_id, name, getattr(self, name), size))
        norm = float(np.linalg.norm(self.orientation_wxyz))
        if abs(norm - 1.0) > QUATERNION_TOLERANCE:
            raise InvalidValueError(
                f"quaternion norm of throw {self.throw_id}", f"{norm:.6g}", f"1 within {QUATERNION_TOLERANCE}"
            )
        object.__setattr__(self, "expected_information", _checked_number(self.throw_id, self.expected_information))

    @property
    def release(self) -> Array:
        """(13,) state in SI units: position, orientation wxyz, velocity (board's frame), angular velocity (body's)."""
        return np.concatenate([self.position, self.orientation_wxyz, self.linear_velocity, self.angular_velocity])

    def state(self, length_scale: float) -> Array:
        """(13,) the release with lengths in units of `length_scale` [m]."""
        return np.concatenate(
            [
                self.position / length_scale,
                self.orientation_wxyz,
                self.linear_velocity / length_scale,
                self.angular_velocity,
            ]
        )

    def to_mapping(self) -> dict[str, object]:
        """The throw as an object for JSON."""
        return plain_values(self)

    @staticmethod
    def from_mapping(data: Mapping[str, object]) -> "Throw":
        """A throw from parsed JSON, from whomever it comes; the plan's numbers may be missing.

        Raises:
            InvalidValueError: a key is missing or unknown, or its value is not what it should be.
        """
        known = {field.name for field in fields(Throw)}
        required = known - {"expected_information", "parameters_version"}
        missing, unknown = sorted(required - set(data)), sorted(str(key)[:40] for key in set(data) - known)
        if missing or unknown:
            found = [f"no {', '.join(missing)}"] * bool(missing) + [f"unknown {', '.join(unknown)[:80]}"] * bool(unknown)
            raise InvalidValueError("throw", " and ".join(found), f"the keys {', '.join(sorted(known))}")
        return Throw(**dict(data))  # type: ignore[arg-type]  # every value is checked when the throw is made


def throw_seed(throw_id: str) -> int:
    """A seed that follows from a throw's name alone: whatever is random about a throw, it is the same in every run."""
    return zlib.crc32(throw_id.encode())


def throw_of_state(throw_id: str, body: str, release: Array, expected: float = 0.0, version: str = "") -> Throw:
    """The throw that releases a body in state (13,), SI units as in `Throw.release`."""
    return Throw(throw_id, body, release[:3], release[3:7], release[7:10], release[10:], expected, version)


def _checked_text(name: str, found: object) -> str:
    if not isinstance(found, str) or len(found) > LONGEST_TEXT or not found.isprintable():
        raise InvalidValueError(f"throw {name}", repr(found)[:60], f"printable text of at most {LONGEST_TEXT} characters")
    if not found and name != "parameters_version":
        raise InvalidValueError(f"throw {name}", "nothing", "a name")
    return found


def _checked_vector(throw_id: str, name: str, found: object, size: int) -> Array:
    expected = f"{size} finite numbers"
    try:
        values = np.asarray(found)
    except ValueError as error:
        raise InvalidValueError(f"{name} of throw {throw_id}", "rows of different lengths", expected) from error
    if values.dtype.kind not in "iuf" or values.shape != (size,):
        raise InvalidValueError(f"{name} of throw {throw_id}", " ".join(repr(found).split())[:60], expected)
    if not np.isfinite(values).all():
        raise InvalidValueError(f"{name} of throw {throw_id}", "a value that is not finite", expected)
    return values.astype(float)


def _checked_number(throw_id: str, found: object) -> float:
    if isinstance(found, bool) or not isinstance(found, int | float | np.number) or not np.isfinite(found):
        raise InvalidValueError(f"expected_information of throw {throw_id}", repr(found)[:60], "a finite number")
    return float(found)


class ThrowKind(StrEnum):
    """Why a throw was chosen."""

    DESIGNED = "designed"
    EXPLORATION = "exploration"


class ThrowState(StrEnum):
    """How far a throw is; each but the second follows on the one before."""

    COMMANDED = "commanded"
    NOT_MADE = "not made"
    EXECUTED = "executed"
    SCORED = "scored"


@dataclass(frozen=True, eq=False)
class ThrowReport:
    """What is known of a throw.

    Attributes:
        kind: why it was chosen.
        state: how far it is.
        commanded: as planned.
        executed: as it left the thrower; None until then.
        released_ns: stamp of that; 0 until then.
        toss_id: its toss; empty until one was scored.
        planned: gain in log-det; once the toss was scored, predicted again at that theta and from what is known before it; 0
            for exploration.
        realised: gain of its toss over what was known before, at that theta; not a number until then, and for exploration.
        detail: why it explores, why it was not made, or why its motion was rejected.
    """

    kind: ThrowKind
    state: ThrowState
    commanded: Throw
    executed: Throw | None = None
    released_ns: int = 0
    toss_id: str = ""
    planned: float = 0.0
    realised: float = float("nan")
    detail: str = ""

    def __post_init__(self) -> None:
        name = f"report of throw {self.commanded.throw_id}"
        if (self.executed is None) == (self.state in (ThrowState.EXECUTED, ThrowState.SCORED)):
            found = "no executed throw" if self.executed is None else "an executed throw"
            raise InvalidValueError(name, f"{self.state} with {found}", "an executed throw once it was made, and not before")
        if bool(self.toss_id) != (self.state is ThrowState.SCORED):
            raise InvalidValueError(
                name, f"{self.state} with toss {self.toss_id!r}", "a toss once it was scored, and not before"
            )
        if self.executed is not None and self.executed.throw_id != self.commanded.throw_id:
            raise InvalidValueError(name, f"executed as {self.executed.throw_id}", "the same throw")
