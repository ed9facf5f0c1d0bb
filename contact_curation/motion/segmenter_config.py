"""When a motion is a toss: ContactNets' published numbers (FIELD 1, arXiv 2009.11193), each to be changed."""

from dataclasses import dataclass, fields, replace
from math import inf, isfinite

from contact_curation.errors import InvalidValueError

WIDEST_FALL = 0.75
"""Of gravity: a body at rest does not fall, however noisy its poses are."""


@dataclass(frozen=True)
class SegmenterConfig:
    """When a toss starts and ends, and which motions are none.

    Attributes:
        gravity: [m/s^2].
        fall_tolerance: in free fall the upward acceleration stays under -gravity plus this [m/s^2].
        fall_mean_tolerance: and the mean of two frames within this of -gravity [m/s^2].
        release_clearance: every corner is higher than this at the start [m].
        region_x: where over the board a toss may start [m]; finite bounds also demand that the body was outside before it.
        region_y: likewise [m].
        settle_time: time without free fall that separates two motions [s].
        rest_displacement: a body at rest moves at most this from frame to frame [m].
        rest_frames: so many displacements in a row; more over 150 frames a second, for as long a time.
        flat_tolerance: a flat body has three corners at most this over its lowest [m].
        rest_height: at rest the body's origin is lower than this [m]; inf for no bound.
        shortest: a toss takes at least this long [s].
        lowest_corner: the lowest corner of a whole toss is within this of the board [m].
        airborne_clearance: a body with all corners higher than this, in all frames that an acceleration comes from, is in the
            air [m].
        airborne_acceleration: and accelerates as gravity does, up to this [m/s^2].
        frame_period: nominal time between frames [s]; None: the median of the stamp differences.
        largest_gap: longest time between frames, in frame periods.
        most_frames: a longer motion is given up.
        tracker_noise: how many times as noisy from frame to frame as the real rig's the poses are, 0.022 mm and 0.024 degrees
            per axis; bounds that noise reaches grow with it, those of the gates, too.
        filter_orientations: take the median of three of the orientations first, for raw trackers; ContactNets' files had that
            done.
    """

    gravity: float = 9.81
    fall_tolerance: float = 3.0
    fall_mean_tolerance: float = 1.0
    release_clearance: float = 0.010
    region_x: tuple[float, float] = (-inf, inf)
    region_y: tuple[float, float] = (-inf, inf)
    settle_time: float = 0.3
    rest_displacement: float = 0.3e-3
    rest_frames: int = 9
    flat_tolerance: float = 0.005
    rest_height: float = inf
    shortest: float = 0.3
    lowest_corner: float = 0.007
    airborne_clearance: float = 0.010
    airborne_acceleration: float = 9.81 / 2.0
    frame_period: float | None = None
    largest_gap: float = 1.5
    most_frames: int = 4096
    tracker_noise: float = 1.0
    filter_orientations: bool = False

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name.startswith("region_"):
                if len(value) != 2 or not value[0] < value[1]:
                    raise InvalidValueError(field.name, value, "two numbers, the lower first [m]")
            elif field.name != "filter_orientations" and value is not None and not value > 0.0:
                raise InvalidValueError(field.name, value, "a positive number")
        if not 1.0 <= self.tracker_noise < inf:
            raise InvalidValueError("tracker_noise", self.tracker_noise, "1 or more, in multiples of the real rig's")

    @property
    def widened(self) -> "SegmenterConfig":
        """With the bounds that noise reaches as `tracker_noise` wants them; those of free fall stay within `WIDEST_FALL`."""
        noise, widest = self.tracker_noise, WIDEST_FALL * self.gravity
        return replace(
            self,
            fall_tolerance=max(self.fall_tolerance, min(noise * self.fall_tolerance, widest)),
            fall_mean_tolerance=max(self.fall_mean_tolerance, min(noise * self.fall_mean_tolerance, widest)),
            rest_displacement=noise * self.rest_displacement,
            airborne_acceleration=noise * self.airborne_acceleration,
        )

    @property
    def bounded(self) -> bool:
        """Whether the region ends anywhere."""
        return any(isfinite(bound) for bound in (*self.region_x, *self.region_y))

    def over_board(self, x: float, y: float) -> bool:
        """Whether a toss may start at (x, y) [m]."""
        return self.region_x[0] <= x <= self.region_x[1] and self.region_y[0] <= y <= self.region_y[1]


CONTACTNETS_RULES = SegmenterConfig(rest_height=0.052, frame_period=1.0 / 148.0)
"""What cut the public tosses, but for the region: those are centred and turned at random.

The cube's half width is 0.0524 m and its data sit 1.2 mm low, so a rest at 0.052 m or higher went unseen: some public tosses
run on for seconds after the cube lay still, and one until a hand had pushed it on. Only data with that offset can use this
height.
"""
