"""All that findings look at: the recordings, and what their poses show together, each worked out when it is first asked for."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contact_curation.contact.body import Body
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from contact_curation.learning.evaluation.misfit import DEEP, bounce_in_words, impact_depth, sliding_of, softness_in_words
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.pose_noise import MOST, RIG_NOISE
from contact_curation.motion.scales import size_of
from contact_curation.motion.survey.carried import Carried, Scatter, Wander, of_each_frame, scatter, wander
from contact_curation.motion.survey.falls import Survey, survey
from contact_curation.motion.survey.inertia import InertiaShape, inertia_shape
from contact_curation.motion.survey.mass_centre import MassCentre, mass_centre
from contact_curation.motion.survey.moved_board import BoardMove, board_move
from contact_curation.motion.survey.rests import on_board, rests_of
from contact_curation.motion.survey.rig import FEWEST_THROWS, RigEstimate, estimate_rig
from contact_curation.motion.survey.rigidity import Departure, departure
from contact_curation.motion.survey.series import SPAN, PoseSeries
from contact_curation.motion.survey.size import size_ratio
from contact_curation.motion.survey.sliding import Sliding
from contact_curation.motion.survey.tracked import TrackedFrame, tracked_frame
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.diagnosis.recording import Recording
from contact_curation.pipeline.reading import ReadingConfig

SYMBOLS = {"metres": "m", "feet": "ft", "inches": "in", "centimetres": "cm", "millimetres": "mm"}
"""Of units, as they are printed."""
UNITS = {"metres": 1.0, "feet": 3.28084, "inches": 39.3701, "centimetres": 100.0, "millimetres": 1000.0}
"""By name: so many of them are a metre."""

NEAREST_UNIT, NEAREST_OTHER = 1.5, 1.15
"""Times gravity in metres, or in another unit, either way: outside, an acceleration is gravity in none."""

CERTAIN_UNIT = 1.05
"""Likewise: within it a lasting fall along an axis is one in that unit, however much poses scatter if they were in metres."""

LASTING = 1.3
"""Windows: a parabola goes on for longer in half of the falls, and what noise makes look like one ends with its window."""

WORTH_MOVE = 0.03
"""Of a body's size: what its centre of mass may be away from where it is described."""

WIDEST = 20.0
"""[m] What poses in metres span at most; in centimetres, inches or millimetres a throw spans more."""

STEEPEST = 20.0
"""Degrees between gravity and an axis, from which on it is along none."""

DEPARTING = 3.0
"""Bodies do not move as rigid ones if the point that comes nearest to falling on a parabola departs from it by so many times
its scatter (`benchmarks.data.moving_parts`)."""

AIR, DRAG = 1.2, 1.2
"""Density [kg/m^3], and a blunt body's drag coefficient."""

AXES = {"-z": (0, 0, -1), "z": (0, 0, 1), "-x": (-1, 0, 0), "x": (1, 0, 0), "-y": (0, -1, 0), "y": (0, 1, 0)}


@dataclass(frozen=True, eq=False)
class Fall:
    """What bodies in the air say of unit and axes.

    Attributes:
        size: of the acceleration, in units of the poses per s^2.
        unit: the poses'; empty where it fits none.
        axis: along which bodies fall, e.g. "-z"; empty where they fall along none.
        angle: between the acceleration and -z [degrees].
    """

    size: float
    unit: str
    axis: str
    angle: float

    @property
    def sound(self) -> bool:
        """Metres, z up."""
        return self.unit == "metres" and self.axis == "-z"


@dataclass(frozen=True, eq=False)
class Evidence:
    """What findings look at.

    Attributes:
        config: how the recordings were read.
        recordings: in the order given, at least one.
    """

    config: ReadingConfig
    recordings: tuple[Recording, ...]

    @property
    def body(self) -> Body:
        return self.config.body

    @cached_property
    def outcomes(self) -> tuple[Toss | Rejected, ...]:
        """All motions that were cut, each once."""
        seen: dict[str, Toss | Rejected] = {}
        for recording in self.recordings:
            for one in recording.outcomes:
                seen.setdefault((one.toss if isinstance(one, Rejected) else one).toss_id, one)
        return tuple(seen.values())

    @cached_property
    def tosses(self) -> tuple[Toss, ...]:
        """Those that were accepted."""
        return tuple(one for one in self.outcomes if isinstance(one, Toss))

    @cached_property
    def bounce(self) -> str:
        """How fast corners leave first impacts, if a body without restitution does not leave them so; else empty."""
        return bounce_in_words(self.tosses, self.body)

    @cached_property
    def softness(self) -> str:
        """How far corners go below where they rest, if a firm board would not let them; else empty."""
        return softness_in_words(self.tosses, self.body)

    @cached_property
    def gives_way(self) -> bool:
        """Whether corners go so far below where they rest, rejected motions counted in: no filter of poses does this."""
        motions = [one.toss if isinstance(one, Rejected) else one for one in self.outcomes]
        return bool(motions) and impact_depth(motions, self.body) > DEEP * self.body.length_scale

    @cached_property
    def sliding(self) -> Sliding | None:
        """Frictions of the tosses that slide; None of too few."""
        return sliding_of(self.tosses, self.body)

    @cached_property
    def rejected(self) -> tuple[Rejected, ...]:
        """Those that were not."""
        return tuple(one for one in self.outcomes if isinstance(one, Rejected))

    @property
    def poses(self) -> int:
        """On the board, of all recordings."""
        return sum(one.poses for one in self.recordings)

    @property
    def mostly_rejected(self) -> bool:
        """Whether fewer than half of the motions, or of the falls that were seen, are tosses."""
        found = [one for recording in self.recordings for one in recording.outcomes]
        accepted = sum(isinstance(one, Toss) for one in found)
        return 2 * accepted < max(len(found), len(self.survey.throws), 1)

    @cached_property
    def series(self) -> tuple[tuple[Recording, PoseSeries], ...]:
        """The poses on the board, of one camera each, and where they come from; each once, whatever is given twice."""
        found: dict[bytes, tuple[Recording, PoseSeries]] = {}
        for recording in self.recordings:
            for one in recording.series:
                found.setdefault(one.digest(), (recording, one.of_one_camera()))
        return tuple(found.values())

    @cached_property
    def survey(self) -> Survey:
        """Falls and rests in the poses on the board."""
        return on_board(survey([one for _, one in self.series]), self.body.polytope)

    @property
    def carried(self) -> tuple[tuple[Carried, ...], ...]:
        """Poses of each frame that transforms move; images that show the board, too, need none."""
        moved = [one for one in self.recordings if one.tags is None or not one.tags.has_board]
        return of_each_frame(carried for one in moved for carried in one.carried)

    @cached_property
    def wanders(self) -> tuple[Wander, ...]:
        """How bodies that lie still move as what carries the camera does; for each frame of which that is known."""
        return tuple(filter(None, map(wander, self.carried)))

    @cached_property
    def scatters(self) -> tuple[Scatter, ...]:
        """By what they scatter on the board and in what carries the camera; likewise."""
        return tuple(filter(None, map(scatter, self.carried)))

    @cached_property
    def mass_centre(self) -> MassCentre | None:
        """Where bodies have their centre of mass, by what they turn about in the air; None where it cannot be told."""
        return mass_centre(self.survey)

    @cached_property
    def gravity(self) -> Array | None:
        """(3,) the acceleration of what falls; None where nothing falls freely."""
        centre = self.mass_centre
        return centre.acceleration if centre is not None and centre.is_elsewhere else self.survey.gravity

    @cached_property
    def fall(self) -> Fall | None:
        """None where nothing falls freely, what seems to is gravity in no unit, or noise may seem to."""
        if self.gravity is None:
            return None
        size = float(np.linalg.norm(self.gravity))
        ratios = {name: size / (self.body.gravity * unit) for name, unit in UNITS.items()}
        unit = min(ratios, key=lambda name: abs(np.log(ratios[name])))
        nearest = NEAREST_UNIT if unit == "metres" else NEAREST_OTHER
        if not 1.0 / nearest < ratios[unit] < nearest:
            return None
        angles = {name: _degrees(self.gravity, np.array(axis, float)) for name, axis in AXES.items()}
        axis = min(angles, key=lambda name: angles[name])
        found = Fall(size, unit, axis if angles[axis] < STEEPEST else "", angles["-z"])
        lasting = float(np.median([throw.frames for throw in self.survey.throws] or [0])) * self.period > LASTING * SPAN
        certain = found.sound or (found.axis and lasting and 1.0 / CERTAIN_UNIT < ratios[unit] < CERTAIN_UNIT)
        return None if self.is_too_noisy and not certain else found

    @cached_property
    def is_too_noisy(self) -> bool:
        """Whether poses in metres scatter so much that no fall can be seen in them; in other units bodies are far larger."""
        spans = [float(np.ptp(one.positions, axis=0).max()) for _, one in self.series if len(one)]
        return max(spans, default=0.0) < WIDEST and self.survey.noise > MOST * RIG_NOISE

    @cached_property
    def departure(self) -> Departure | None:
        """How far the best point of bodies in the air departs from a parabola, if they do not move as rigid ones; else None.

        The air slows a light body more in one orientation than in another: what its drag could do is no sign of moving parts.
        """
        found = departure(self.survey, RIG_NOISE) if self.fall is not None and self.fall.sound else None
        if found is None or found.times < DEPARTING:
            return None
        spans = np.sort(np.ptp(self.body.vertices @ np.linalg.svd(self.body.vertices)[2].T, axis=0))
        drag = 0.5 * AIR * DRAG * spans[1] * spans[2] / self.body.mass
        return found if found.size > drag * found.slowed else None

    @cached_property
    def board_move(self) -> BoardMove | None:
        """How what bodies rest on was moved between two throws; None where it was not, or poses are not in metres with z up."""
        sound = self.fall is not None and self.fall.sound
        return board_move(rests_of(self.survey.throws, self.body.polytope)) if sound else None

    @property
    def rests_on_board(self) -> bool:
        """Whether bodies come to rest at the height of the board, but for what may be chance."""
        return self.rig is not None and self.rig.height.holds_none

    def moved_centre(self, rig: RigCalibration) -> MassCentre | None:
        """The centre of mass seen from where it is described, where it is certainly and noticeably not there; needs `rig`.

        None of bodies that do not move as rigid ones: these turn about no point of theirs.

        Args:
            rig: what corrects the poses.
        """
        if self.rig is None or self.mass_centre is None or self.departure is not None or self.tracked is not None:
            return None
        found = self.mass_centre.seen_from_described(rig, self.body.center_of_mass)
        return found if found.is_elsewhere and found.distance > WORTH_MOVE * size_of(self.body.vertices) else None

    @cached_property
    def inertia(self) -> InertiaShape | None:
        """How moments and products of inertia are in relation, by free flights, in the described axes; needs `rig`."""
        found = inertia_shape(self.survey) if self.departure is None else None
        if found is None or self.rig is None:
            return None
        return found.turned(quaternions.to_matrix(quaternions.exp(np.array(self.rig.rig.marker_turn))))

    @property
    def center(self) -> Array | None:
        """(3,) the centre of mass seen from the origin of the poses, in their unit, where it is certainly not there."""
        centre = self.mass_centre
        return centre.place if centre is not None and centre.is_elsewhere else None

    @property
    def true_fall(self) -> float:
        """Acceleration of falling bodies if lengths are right: gravity, or the measured one of bodies that are not rigid."""
        return self.body.gravity if self.departure is None or self.fall is None else self.fall.size

    @cached_property
    def rig(self) -> RigEstimate | None:
        """None where poses are not in metres with z up, throws are too few, or there are two: before and after a move."""
        if self.fall is None or not self.fall.sound or self.board_move is not None:
            return None
        try:
            return self.estimated_rig()
        except InvalidValueError:
            return None

    def estimated_rig(self, fewest: int = FEWEST_THROWS) -> RigEstimate:
        """The rig by at least so many throws.

        Raises:
            InvalidValueError: they are fewer.
        """
        body, center = self.body, self.center
        described = body.center_of_mass
        return estimate_rig(self.survey, body.polytope, self.true_fall, center=center, described=described, fewest=fewest)

    @cached_property
    def size(self) -> float | None:
        """The body's size over its description's; None where it cannot be told."""
        return None if self.rig is None else size_ratio(self.survey, self.body.polytope, self.rig)

    @cached_property
    def tracked(self) -> TrackedFrame | None:
        """The frame that is tracked, where it is another one than the described body's."""
        if self.fall is None or not self.fall.sound or self.board_move is not None:
            return None
        seen = self.center if self.departure is None else None
        return tracked_frame(self.survey, self.body.vertices, self.body.center_of_mass, seen)

    @cached_property
    def period(self) -> float:
        """Of the poses, median [s]; NaN where there are none."""
        series = [one for recording in self.recordings for one in recording.series if len(one) > 1]
        periods = [0.5 * one.pair_period or one.period for one in series]
        return float(np.median(periods)) if periods else float("nan")


def _degrees(one: np.ndarray, other: np.ndarray) -> float:
    cosine = float(one @ other / (np.linalg.norm(one) * np.linalg.norm(other)))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
