"""How a rig tracked, estimated from bodies that fall and come to rest: board, length scale, and the marker in the body.

    acceleration in the air = -g u / s          of the described origin: a marker beside it circles around it

with u the board's normal and s the length scale; `rests` has the equations of board and marker. Each needs a little of the
other, so they are estimated in turn. What the throws cannot tell apart is said, and corrected as the board's: turn and place of
the marker count only where they are certain and larger than what is worth correcting.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.polytopes import Polytope
from contact_curation.geometry.quaternions import Array
from contact_curation.geometry.scalars import vector
from contact_curation.motion.calibration import NO_CORRECTION, RigCalibration
from contact_curation.motion.survey.falls import Survey, acceleration_of
from contact_curation.motion.survey.rests import PLACE, TURN, RestEstimate, estimate_rests, rests_of

FEWEST_THROWS = 4
"""From which anything is estimated."""

CONFIDENCE = 0.975
"""Quantile at the upper end of a 95 % interval."""

SMALLEST_SCALE = 5e-4
"""The standard deviation of a length scale is no smaller, however many throws there are."""

OUTLYING = 4.0
"""Accelerations are left out that are so many times the median distance away."""

IN_TURN = 3
"""Rounds of estimating scale, then board and marker."""

AT_ORIGIN = np.zeros(3)
"""[m] A centre of mass in the origin of the tracked frame."""


type Triple = tuple["Estimate", "Estimate", "Estimate"]


class Estimate(NamedTuple):
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float

    @property
    def holds_none(self) -> bool:
        """Whether the interval holds 0."""
        return self.low <= 0.0 <= self.high


@dataclass(frozen=True, eq=False)
class RigEstimate:
    """What throws say of their rig.

    Attributes:
        throws, rests, falls: how many there are, come to rest on a face, and are long enough in the air.
        rig: what corrects poses, all of it.
        tilt: of the board about x and y [rad].
        height: of the board's surface [m].
        scale: relative length error, s - 1.
        marker_turn: w [rad]; zeros where it is not corrected.
        marker_place: o [m]; likewise.
        tilt_or_turn: whether a tilted board cannot be told from a turned marker.
        height_or_place: whether the board's height cannot be told from the marker's place.
        rest_depths: (K,) of the described origin over the faces that they lie on [m].
        left_over: residual of the heights after it that three rests in four keep to [m].
    """

    throws: int
    rests: int
    falls: int
    rig: RigCalibration
    tilt: tuple[Estimate, Estimate]
    height: Estimate
    scale: Estimate
    marker_turn: Triple
    marker_place: Triple
    tilt_or_turn: bool
    height_or_place: bool
    rest_depths: Array
    left_over: float

    @property
    def doubts(self) -> tuple[str, ...]:
        """One line for each error that may be another's as well, with what would tell."""
        tilted, raised = not all(one.holds_none for one in self.tilt), not self.height.holds_none
        lines = []
        if self.tilt_or_turn and tilted:
            lines.append(
                "these rests cannot tell a tilted board from a turned marker: it is taken for the board's; "
                "let the body come to rest on other faces, under other headings, at places further apart"
            )
        if self.height_or_place and raised:
            lines.append(
                "these rests cannot tell a height of the board from a marker that sits aside: it is taken for the board's; "
                "let the body come to rest on other faces"
            )
        return tuple(lines)

    @property
    def tilt_degrees(self) -> float:
        return float(np.degrees(self.rig.tilt))

    @property
    def tilt_interval(self) -> Estimate:
        """Of the whole angle [degrees]."""
        half = float(np.degrees(max(0.5 * (one.high - one.low) for one in self.tilt)))
        low = 0.0 if all(one.holds_none for one in self.tilt) else max(self.tilt_degrees - half, 0.0)
        return Estimate(self.tilt_degrees, low, self.tilt_degrees + half)

    @property
    def length_scale(self) -> Estimate:
        """What lengths are multiplied with."""
        return Estimate(*(1.0 + value for value in self.scale))

    @property
    def needs_none(self) -> bool:
        """Whether the intervals of tilt, height and scale hold 0 and the marker sits where it is described."""
        return all(one.holds_none for one in (*self.tilt, self.height, self.scale)) and not (self.rig.has_marker)


def estimate_rig(
    survey: Survey,
    polytope: Polytope,
    gravity: float = 9.81,
    *,
    center: Array | None = None,
    described: Array = AT_ORIGIN,
    fewest: int = FEWEST_THROWS,
) -> RigEstimate:
    """The rig of some throws.

    Args:
        survey: of poses of one body by one rig [m], z up.
        polytope: the body's.
        gravity: the true one [m/s^2].
        center: (3,) centre of mass seen from the origin of the poses, if it is known not to be there [m].
        described: (3,) centre of mass seen from the tracked frame, to which poses were moved as if their lengths were true [m].
        fewest: throws.

    Raises:
        InvalidValueError: fewer than `fewest` throws fall, or come to rest on a face of the body.
    """
    throws, rests = survey.throws, rests_of(survey.throws, polytope)
    for what, count in (("fall freely", len(throws)), ("come to rest on a face", len(rests))):
        if count < fewest:
            raise InvalidValueError(f"throws that {what}", count, f"at least {fewest}, to estimate the rig from")
    centre = np.array([*np.median(rests.places[:, :2], axis=0), 0.0])
    scale = _scale(survey, gravity, center)
    for _ in range(IN_TURN):
        moved = described / (1.0 + scale.value) - described
        found = estimate_rests(rests.seen_from(moved), 1.0 + scale.value, centre)
        rig = RigCalibration(
            normal=vector(found.up),
            centre=vector(centre),
            scale=1.0 + scale.value,
            height=float(found.values[2]),
            marker_turn=vector(found.values[TURN]),
            marker_offset=vector(found.values[PLACE]),
        )
        if center is not None or not (any(rig.marker_offset) or moved.any()):
            break
        askew = quaternions.conjugate(quaternions.exp(rig.marker_turn))
        scale = _scale(survey, gravity, moved + quaternions.rotate(askew, rig.marker_offset) / rig.scale)
    return RigEstimate(
        throws=len(throws),
        rests=len(rests),
        falls=len(throws),
        rig=replace(rig, scale=1.0 + scale.value),
        tilt=(_estimated(found, 0), _estimated(found, 1)),
        height=_wider(_estimated(found, 2), float(np.median(rests.depths)) * (scale.high - scale.value)),
        scale=scale,
        marker_turn=(_estimated(found, 3), _estimated(found, 4), _estimated(found, 5)),
        marker_place=(_estimated(found, 6), _estimated(found, 7), _estimated(found, 8)),
        tilt_or_turn=found.tilt_or_turn,
        height_or_place=found.height_or_place,
        rest_depths=rests.depths,
        left_over=found.left_over,
    )


def worth_correcting(found: RigEstimate) -> RigCalibration:
    """The calibration without those parts whose intervals hold 0."""
    rig = found.rig
    if all(one.holds_none for one in found.tilt):
        rig = replace(rig, normal=NO_CORRECTION.normal)
    if found.height.holds_none:
        rig = replace(rig, height=0.0)
    if found.scale.holds_none:
        rig = replace(rig, scale=1.0)
    unused = rig.normal == NO_CORRECTION.normal and rig.scale == 1.0
    return replace(rig, centre=NO_CORRECTION.centre) if unused else rig


def _scale(survey: Survey, gravity: float, center: Array | None) -> Estimate:
    """S - 1; the spread of the throws' accelerations along their mean gives the interval.

    Args:
        survey: of the poses.
        gravity: the true one.
        center: (3,) what falls on a parabola, seen from the origin of the poses; None for that origin.
    """
    accelerations = np.array([throw.acceleration for throw in survey.throws])
    if center is not None:
        places = [one.positions + quaternions.rotate(one.orientations_wxyz, center) for one in survey.series]
        spans = [throw.span for throw in survey.throws]
        accelerations = np.array(
            [
                acceleration_of(places[one.series][one.first : one.stop], survey.series[one.series].times[one.first : one.stop])
                for one in spans
            ]
        )
    weights = np.array([throw.frames**5.0 for throw in survey.throws])
    off = np.linalg.norm(accelerations - np.median(accelerations, axis=0), axis=1)
    near = off <= max(OUTLYING * float(np.median(off)), 1e-9)
    mean = weights[near] @ accelerations[near] / weights[near].sum()
    length = float(np.linalg.norm(mean))
    along = accelerations[near] @ (mean / length) - length
    error = float(np.sqrt(np.sum((weights[near] * along) ** 2)) / weights[near].sum())
    value = gravity / length
    equal = float(weights[near].sum() ** 2 / np.square(weights[near]).sum())  # throws of one weight that say as much
    return _estimate(value - 1.0, float(np.hypot(value * error / length, SMALLEST_SCALE)), max(equal - 1.0, 1.0))


def _estimated(found: RestEstimate, at: int) -> Estimate:
    return _estimate(found.values[at], found.errors[at], found.free)


def _wider(one: Estimate, by: float) -> Estimate:
    """With an independent error of so large a half width."""
    half = float(np.hypot(one.high - one.value, by))
    return Estimate(one.value, one.value - half, one.value + half)


def _estimate(value: float, error: float, free: float) -> Estimate:
    from scipy.special import stdtrit  # takes a tenth of a second to import

    half = float(stdtrit(free, CONFIDENCE)) * error
    return Estimate(float(value), float(value) - half, float(value) + half)
