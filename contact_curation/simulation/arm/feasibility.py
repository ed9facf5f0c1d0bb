"""Which throws the arm can make, and for the others the nearest feasible throw."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.design.throw import Throw
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import IDENTITY
from contact_curation.simulation.arm.safety import GateConfig, out_of_limits
from contact_curation.simulation.arm.throw_motion import Refused, ThrowMotion, ThrowPlanner

HALVINGS = 7
"""Number of bisection steps towards a feasible throw: the result is accurate to 1 % of the distance to it."""

EASY_PLACE, EASY_VELOCITY = (-0.307, 0.0, 0.17), (0.6, 0.0, 0.0)
"""A throw in the middle of the feasible ones: position [m] and velocity [m/s] of the release, without spin."""


@dataclass(frozen=True, eq=False)
class ArmFeasibility:
    """Decides which throws of one body the arm can make. The object can be called as the safety set of a design requires.

    Attributes:
        planner: planner of the arm's motions.
        gate: limits of commands.
    """

    planner: ThrowPlanner
    gate: GateConfig

    def __call__(self, throws: Sequence[Throw]) -> tuple[str | None, ...]:
        """For each throw None if it can be made, else one line that names the violated limit."""
        return tuple(self.refusal(throw) for throw in throws)

    def refusal(self, throw: Throw) -> str | None:
        """One line that says why a throw cannot be made; None if it can."""
        answer = self.motion(throw)
        return None if isinstance(answer, ThrowMotion) else answer

    def motion(self, throw: Throw) -> ThrowMotion | str:
        """The arm's motion for a throw, or one line that says why there is none."""
        if throw.body != self.planner.body.name:
            return f"body: found {throw.body}, expected {self.planner.body.name}"
        line = out_of_limits(throw, self.gate)
        if line is not None:
            return line
        answer = self.planner.plan(throw)
        return str(answer) if isinstance(answer, Refused) else answer

    def nearest(self, throw: Throw) -> Throw | None:
        """The nearest feasible throw on a line from an infeasible one to a feasible one; None if none is found.

        The first line keeps the pose and reduces the twist to zero. If the pose itself is out of reach, the second line leads
        to a throw in the middle of the feasible ones.
        """
        still = replace(throw, linear_velocity=np.zeros(3), angular_velocity=np.zeros(3))
        easy = replace(still, position=np.array(EASY_PLACE), linear_velocity=np.array(EASY_VELOCITY))
        level = replace(easy, orientation_wxyz=IDENTITY)
        for known in (still, easy, level):
            if self.refusal(known) is None:
                return nearest_on_line(known, throw, self.refusal)
        return None


def feasible(throws: Sequence[Throw], body: Body) -> tuple[str | None, ...]:
    """Decides which throws of a body the arm can make with default settings; `ArmFeasibility` is faster for more than one call.

    Returns:
        For each throw None, or one line that says why the arm cannot make it.
    """
    return ArmFeasibility(ThrowPlanner(body), GateConfig())(throws)


def nearest_on_line(known: Throw, wanted: Throw, refusal: Callable[[Throw], str | None]) -> Throw:
    """The last feasible throw on the line from a feasible throw to an infeasible one, found by bisection."""
    low, high, found = 0.0, 1.0, known
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        between = blended(known, wanted, share)
        if refusal(between) is None:
            low, found = share, between
        else:
            high = share
    return found


def blended(one: Throw, other: Throw, share: float) -> Throw:
    """Interpolates between two throws; 0 is the first one, 1 the second."""
    turn = quaternions.log(quaternions.multiply(quaternions.conjugate(one.orientation_wxyz), other.orientation_wxyz))
    return replace(
        other,
        position=one.position + share * (other.position - one.position),
        orientation_wxyz=quaternions.normalized(quaternions.multiply(one.orientation_wxyz, quaternions.exp(share * turn))),
        linear_velocity=one.linear_velocity + share * (other.linear_velocity - one.linear_velocity),
        angular_velocity=one.angular_velocity + share * (other.angular_velocity - one.angular_velocity),
    )


def described(throw: Throw) -> str:
    """Describes a throw in one line."""
    place = np.array2string(throw.position, precision=3)
    velocity = np.array2string(throw.linear_velocity, precision=3)
    spin = np.array2string(throw.angular_velocity, precision=2)
    return f"from {place} m at {velocity} m/s with {spin} rad/s"
