"""When a motion is a toss: ContactNets' published rules (arXiv 2009.11193), in the scales of the body and its tracker."""

from dataclasses import dataclass, fields
from math import inf, isfinite

from contact_curation.configs import check_positive, ranged
from contact_curation.errors import InvalidValueError
from contact_curation.motion.gate_config import LENGTH_NOISE, airborne_noise
from contact_curation.motion.pose_noise import RIG, RIG_NOISE, TrackerScale
from contact_curation.motion.scales import BodyScale
from contact_curation.motion.smoothing import kinematic_noise_growth, noise_growth, noise_without_filter

RIG_GRAVITY = 9.81
"""Under which the public tosses fell [m/s^2]."""

FALL_TOLERANCE, FALL_MEAN_TOLERANCE = 3.0 / RIG_GRAVITY, 1.0 / RIG_GRAVITY
"""Of gravity."""

WIDEST_FALL = 0.75
"""Of gravity: a body at rest does not fall, however noisy its poses are."""

ON_AN_EDGE, FLATTEST = 1.0 / 3.0, 0.01
"""Shares of `BodyScale.balanced_rise`, and of the reach: no body is described better, or lies flatter."""

STILL_NOISE = 8.0
"""A body at rest may move by so many standard deviations of a position."""


SHORTEST = 0.3
"""[s] No toss need be longer: a large body falls from no higher than a cube of 105 mm, and its bounds are for that one."""


@dataclass(frozen=True)
class SegmenterConfig:
    """When a toss starts and ends, and which motions are not tosses.

    None derives a bound from the body and its tracker. `size` is half the width of a cube with the same spread of vertices,
    `reach` the distance of the farthest vertex from the centre of mass (`motion.scales`), g gravity. In brackets stands the
    derived bound of ContactNets' cube at the noise of its rig.

    Attributes:
        gravity: gravitational acceleration [m/s^2]; by default the body's.
        fall_tolerance: largest upward acceleration of a body in free fall, above -gravity [m/s^2]; by default 0.306 g [3].
        fall_mean_tolerance: largest difference of a falling body's mean acceleration over two frames from -gravity [m/s^2]; by
            default 0.102 g [1].
        release_clearance: height over which all vertices are at the start of a toss [m]; by default 0.191 size [0.010].
        region_x: range of x in which a toss may start [m]; with finite bounds the body must also have been outside before.
        region_y: range of y in which a toss may start [m].
        settle_time: time without free fall that separates two motions [s]; by default 4.1 sqrt(size / g) [0.3].
        rest_displacement: largest displacement between frames of a body at rest [m]; by default 0.0057 size [0.0003].
        rest_frames: number of successive displacements of a body at rest; over 150 frames a second more, for the same time.
        flat_tolerance: largest height over the lowest vertex of the three vertices on which a body lies flat [m]; by default
            0.055 reach [0.005], or less where a body that is balanced on an edge is nearly as flat: a third of how high both
            faces beside it rise, at least 0.01 reach.
        rest_height: largest height of the tracked frame's origin at rest [m]; inf for no bound.
        shortest: shortest duration of a toss [s]; by default 4.1 sqrt(size / g), at most 0.3.
        lowest_corner: largest distance from the board to the lowest vertex of a whole toss [m]; by default 0.134 size
            [0.007].
        airborne_clearance: height over which all vertices of a body in the air are, in all frames that an acceleration comes
            from [m]; by default 0.191 size [0.010].
        airborne_acceleration: largest difference of the acceleration in the air from gravity [m/s^2]; by default 0.5 g, or
            what the tracker's noise can make at its rate, if that is more [4.905; 8.5 at 148 frames a second].
        frame_period: nominal time between frames [s]; by default as the stamp differences say, missing frames aside.
        largest_gap: longest time between frames, in frame periods; one transition spans a gap.
        most_frames: a motion with more frames than this is dropped.
        tracker_noise: noise of the poses between frames as a multiple of that of ContactNets' rig, 0.022 mm and 0.024 degrees
            per axis; the bounds of segmenter and gates that noise reaches grow with it; by default it is measured.
        filter_orientations: whether a median of three is applied to orientations first, for raw trackers; ContactNets' files
            are filtered already.
        closed_up: whether the stamps were made from a rate, without those of frames that were lost: a toss gets the periods
            back that its flights give away (`survey.lost_frames`), and may have gaps there.
    """

    gravity: float | None = ranged(None, 0.0, 100.0)
    fall_tolerance: float | None = ranged(None, 0.0, 100.0)
    fall_mean_tolerance: float | None = ranged(None, 0.0, 100.0)
    release_clearance: float | None = ranged(None, 0.0, 10.0)
    region_x: tuple[float, float] = (-inf, inf)
    region_y: tuple[float, float] = (-inf, inf)
    settle_time: float | None = ranged(None, 0.0, 1e3)
    rest_displacement: float | None = ranged(None, 0.0, 1.0)
    rest_frames: int = ranged(9, 1, 1000)
    flat_tolerance: float | None = ranged(None, 0.0, 10.0)
    rest_height: float = inf
    shortest: float | None = ranged(None, 0.0, 1e3)
    lowest_corner: float | None = ranged(None, 0.0, 10.0)
    airborne_clearance: float | None = ranged(None, 0.0, 10.0)
    airborne_acceleration: float | None = ranged(None, 0.0, 1e5)
    frame_period: float | None = ranged(None, 0.0, 1.0)
    largest_gap: float = ranged(1.5, 1.0, 1e3)
    most_frames: int = ranged(4096, 2, 1_000_000)
    tracker_noise: float | None = ranged(None, 0.0, 1e3)
    filter_orientations: bool = False
    closed_up: bool = False

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name.startswith("region_"):
                if len(value) != 2 or not value[0] < value[1]:
                    raise InvalidValueError(each.name, value, "two numbers, the lower first [m]")
            elif not isinstance(value, bool) and value is not None:
                check_positive(self, (each.name,), infinite=True)
        if self.tracker_noise is not None and not 1.0 <= self.tracker_noise < inf:
            raise InvalidValueError("tracker_noise", self.tracker_noise, "1 or more, in multiples of that of ContactNets' rig")

    @property
    def bounded(self) -> bool:
        """Whether the region ends anywhere."""
        return any(isfinite(bound) for bound in (*self.region_x, *self.region_y))

    def over_board(self, x: float, y: float) -> bool:
        """Whether a toss may start at (x, y) [m]."""
        return self.region_x[0] <= x <= self.region_x[1] and self.region_y[0] <= y <= self.region_y[1]

    @property
    def tracker(self) -> TrackerScale:
        """How noisy the tracker is, as its user says; where he says nothing, as ContactNets' rig until it is measured."""
        return RIG if self.tracker_noise is None else TrackerScale(self.tracker_noise, self.tracker_noise)

    def bounds(self, body: BodyScale, tracker: TrackerScale) -> "SegmenterBounds":
        """The bounds for a body and its tracker."""
        gravity = self.gravity or body.gravity
        vertex, position = LENGTH_NOISE * tracker.at(body.reach), RIG_NOISE * tracker.position
        flat = min(0.005 / 0.09075946 * body.reach, max(body.balanced_rise * ON_AN_EDGE, FLATTEST * body.reach))
        quiet = self.rest_displacement or 0.3e-3 / 0.0524 * body.size
        displacement = self.rest_displacement or max(quiet, STILL_NOISE * position)
        return SegmenterBounds(
            gravity=gravity,
            fall_tolerance=self.fall_tolerance or FALL_TOLERANCE * gravity,
            fall_mean_tolerance=self.fall_mean_tolerance or FALL_MEAN_TOLERANCE * gravity,
            release_clearance=self.release_clearance or max(0.010 / 0.0524 * body.size, vertex),
            settle_time=self.settle_time or 4.1047822 * body.time,
            rest_displacement=displacement,
            rest_travel=max(self.rest_frames * quiet, displacement),
            flat_tolerance=self.flat_tolerance or max(flat, vertex),
            shortest=self.shortest or min(4.1047822 * body.time, SHORTEST),
            lowest_corner=self.lowest_corner or max(0.007 / 0.0524 * body.size, vertex),
            airborne_clearance=self.airborne_clearance or max(0.010 / 0.0524 * body.size, vertex),
            airborne_acceleration=self.airborne_acceleration or 0.5 * gravity,
            airborne_noise=0.0 if self.airborne_acceleration else airborne_noise(tracker),
            noise=tracker.position,
            reach=body.reach,
        )


@dataclass(frozen=True)
class SegmenterBounds:
    """The bounds of `SegmenterConfig` for a body and its tracker, every field a number.

    Attributes:
        rest_travel: how far a body at rest may come within `rest_frames` [m].
        airborne_noise: noise may change a displacement in the air by so much from frame to frame [m]; zero where the user has
            set `airborne_acceleration`.
        noise: of positions, in multiples of that of ContactNets' rig.
        reach: of the body [m].
    """

    gravity: float
    fall_tolerance: float
    fall_mean_tolerance: float
    release_clearance: float
    settle_time: float
    rest_displacement: float
    rest_travel: float
    flat_tolerance: float
    shortest: float
    lowest_corner: float
    airborne_clearance: float
    airborne_acceleration: float
    airborne_noise: float
    noise: float
    reach: float

    def acceleration_noise(self, frame_period: float) -> float:
        """How much noisier the accelerations of a `FallDetector` are than those of ContactNets' rig, at least 1."""
        return noise_growth(frame_period, self.noise, 2)

    def airborne_bound(self, frame_period: float) -> float:
        """`airborne_acceleration` as noise wants it [m/s^2]."""
        least = self.airborne_noise * noise_without_filter(frame_period) / frame_period**2
        growth = 1.0 if least else kinematic_noise_growth(frame_period, self.noise, 2)
        return max(self.airborne_acceleration * growth, least)

    def fall_tolerances(self, frame_period: float) -> tuple[float, float]:
        """`fall_tolerance` and `fall_mean_tolerance` as noise wants them, within `WIDEST_FALL`, [m/s^2]."""
        noise, widest = self.acceleration_noise(frame_period), WIDEST_FALL * self.gravity
        return (
            max(self.fall_tolerance, min(noise * self.fall_tolerance, widest)),
            max(self.fall_mean_tolerance, min(noise * self.fall_mean_tolerance, widest)),
        )


CONTACTNETS_RULES = SegmenterConfig(rest_height=0.052, frame_period=1.0 / 148.0)
"""What cut the public tosses, but for the region: those are centred and turned at random.

The cube's half width is 0.0524 m and its data sit 1.2 mm low, so a rest at 0.052 m or higher went unseen: some public tosses
run on for seconds after the cube lay still, and one until a hand had pushed it on. Only data with that offset can use this
height.
"""
