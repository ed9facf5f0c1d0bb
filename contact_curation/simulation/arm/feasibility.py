"""Which throws the arm can make, and the nearest one that it can instead."""

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
"""Halvings of the way to a feasible throw: the nearest one is found within a hundredth of that way."""

EASY_PLACE, EASY_VELOCITY = (-0.307, 0.0, 0.17), (0.6, 0.0, 0.0)
"""A throw in the middle of what the arm can do: where [m] and how fast [m/s], without spin."""


@dataclass(frozen=True, eq=False)
class ArmFeasibility:
    """Answers for throws, as the safety set of a design asks; an object of it is such a function.

    Attributes:
        planner: planner of the arm's motions.
        gate: limits of commands.
    """

    planner: ThrowPlanner
    gate: GateConfig

    def __call__(self, throws: Sequence[Throw]) -> tuple[str | None, ...]:
        """None for each throw that can be made, else one line that names the limit."""
        return tuple(self.refusal(throw) for throw in throws)

    def refusal(self, throw: Throw) -> str | None:
        """Why a throw cannot be made."""
        answer = self.motion(throw)
        return None if isinstance(answer, ThrowMotion) else answer

    def motion(self, throw: Throw) -> ThrowMotion | str:
        """How a throw is made, or why it cannot be."""
        if throw.body != self.planner.body.name:
            return f"body: found {throw.body}, expected {self.planner.body.name}"
        line = out_of_limits(throw, self.gate)
        if line is not None:
            return line
        answer = self.planner.plan(throw)
        return str(answer) if isinstance(answer, Refused) else answer

    def nearest(self, throw: Throw) -> Throw | None:
        """The feasible throw nearest to one that is not, on a line to one that is; None if nothing is found.

        The line first keeps the pose and takes the twist down to nothing; where the pose itself is out of reach, it goes to a
        throw in the middle of what the arm can do.
        """
        still = replace(throw, linear_velocity=np.zeros(3), angular_velocity=np.zeros(3))
        easy = replace(still, position=np.array(EASY_PLACE), linear_velocity=np.array(EASY_VELOCITY))
        level = replace(easy, orientation_wxyz=IDENTITY)
        for known in (still, easy, level):
            if self.refusal(known) is None:
                return nearest_on_line(known, throw, self.refusal)
        return None


def feasible(throws: Sequence[Throw], body: Body) -> tuple[str | None, ...]:
    """Judges throws of a body by an arm with default settings; `ArmFeasibility` is faster for more than one call.

    Returns:
        For each throw None, or in one line why the arm cannot make it.
    """
    return ArmFeasibility(ThrowPlanner(body), GateConfig())(throws)


def nearest_on_line(known: Throw, wanted: Throw, refusal: Callable[[Throw], str | None]) -> Throw:
    """The last feasible throw that halving finds on the way from one that is feasible to one that is not."""
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
    """The throw that has gone a share of the way from one to another."""
    turn = quaternions.log(quaternions.multiply(quaternions.conjugate(one.orientation_wxyz), other.orientation_wxyz))
    return replace(
        other,
        position=one.position + share * (other.position - one.position),
        orientation_wxyz=quaternions.normalized(quaternions.multiply(one.orientation_wxyz, quaternions.exp(share * turn))),
        linear_velocity=one.linear_velocity + share * (other.linear_velocity - one.linear_velocity),
        angular_velocity=one.angular_velocity + share * (other.angular_velocity - one.angular_velocity),
    )


def described(throw: Throw) -> str:
    """A throw in one line, for who asked for another."""
    place = np.array2string(throw.position, precision=3)
    velocity = np.array2string(throw.linear_velocity, precision=3)
    spin = np.array2string(throw.angular_velocity, precision=2)
    return f"from {place} m at {velocity} m/s with {spin} rad/s"
