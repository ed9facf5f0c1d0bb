"""The columns of a pose in a table, told by their names: times, positions and orientations of one body among others.

A name is cut into words, `/vicon/cube/pose/position/x`, `cubePosX` or `p_RS_R_x [m]`: one says which number it is, the others
whose. Columns of one body share these others; where there are several bodies, those of the one that is wanted are taken.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

from contact_curation.motion.toss import NANOSECONDS
from contact_curation.storage.datasets.orientations import ANGLES, FORMS

TUM = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
POSITION = ("x", "y", "z")
KINDS = {kind for form in FORMS for kind in (*POSITION, *form)}

POSITION_WORDS = {"p", "t", "pos", "position", "point", "trans", "translation", "location", "xyz"}
QUATERNION_WORDS, ANGLE_WORDS = {"q", "quat", "quaternion"}, {"euler", "angle", "angles", "rpy", "ypr"}
ORIENTATION_WORDS = {"orient", "orientation", "rot", "rotation", "attitude", *QUATERNION_WORDS, *ANGLE_WORDS}
MATRIX_WORDS = {"r", "m", "rot", "rotation", "mat", "matrix", "rotmat", "dcm"}
NAMED_ANGLES = {"roll": "ax", "pitch": "ay", "yaw": "az"}
WHOLE_SECONDS = {"sec", "secs", "seconds"}
BESIDE_SECONDS = {
    **dict.fromkeys(("nanosec", "nanosecs", "nsec", "nsecs", "nanoseconds"), 1),
    **dict.fromkeys(("microsec", "microsecs", "usec", "usecs", "microseconds"), 1_000),
    **dict.fromkeys(("millisec", "millisecs", "msec", "msecs", "milliseconds"), 1_000_000),
}
"""[ns] Units of what stands in a column of its own beside whole seconds."""
TIME_WORDS = {"t", "time", "timestamp", "stamp", "datetime", "ns", *WHOLE_SECONDS, *BESIDE_SECONDS}
DATE_WORD = "date"
"""Of a column of days, beside times of day."""
OTHER_WORDS = {"v", "vel", "velocity", "twist", "angular", "linear", "acc", "acceleration", "cov", "covariance", "b"}
"""Of columns that are no pose: EuRoC's ground truth has velocities and biases beside it."""

UNITS_OF_TIME = {
    "s": NANOSECONDS, "seconds": NANOSECONDS, "secs": NANOSECONDS, "sec": NANOSECONDS,
    "min": 60 * NANOSECONDS, "minutes": 60 * NANOSECONDS, "h": 3600 * NANOSECONDS, "hours": 3600 * NANOSECONDS,
    "ms": 1_000_000, "milliseconds": 1_000_000, "us": 1_000, "microseconds": 1_000, "ns": 1, "nanoseconds": 1,
}  # fmt: skip
UNITS_OF_ANGLE = {
    **dict.fromkeys(("deg", "degree", "degrees", "°"), "deg"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
}
UNITS_OF_LENGTH = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 0.001),
    **dict.fromkeys(("um", "micrometer", "micrometers", "micrometre", "micrometres"), 1e-6),
    **dict.fromkeys(("dm", "decimeter", "decimeters", "decimetre", "decimetres"), 0.1),
    **dict.fromkeys(("yd", "yard", "yards"), 0.9144),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 0.01),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
}
"""[m] Others are metres."""

UNITS = {*UNITS_OF_TIME, *UNITS_OF_ANGLE, *UNITS_OF_LENGTH}
SURE_UNITS = {unit for unit in UNITS_OF_LENGTH if unit in ("mm", "cm", "um") or re.match("(mill|cent|dec)i|micro", unit)}
"""Of lengths, wherever they stand in a name, `position_mm.x`; but in front cm is the centre of mass, `cm_pos_x`."""

IDENTIFIER = re.compile(r"\b[0-9A-Fa-f]{8,}(-[0-9A-Fa-f]{4,})*\b")
"""Of a body, as Motive writes: no words."""

SHOWN = 12
"""Names of columns in a message."""


class ColumnsError(Exception):
    """Names that tell no pose: what is lacking, or one too much."""


class PoseColumns(NamedTuple):
    """Where the columns are: of times, what is beside whole seconds, position and orientation, and days beside times.

    Times, and what is beside them, have units of so many nanoseconds, positions one of so many metres; of the orientation
    `form` tells what its columns are, one of `FORMS`, and `angle_unit` the unit that names of angles say. `other_time` is a
    column of times that may as well be meant.
    """

    time: int | None
    beside: int | None
    time_unit: int | None
    pose: tuple[int, ...]
    length: float
    date: int | None
    form: tuple[str, ...]
    angle_unit: str
    other_time: int | None = None
    beside_unit: int = 1

    @property
    def fewest(self) -> int:
        """Values of a row with all of them."""
        return 1 + max(at for at in (self.time, self.beside, self.date, *self.pose) if at is not None)


class _Name(NamedTuple):
    """What a name says: one of `KINDS`, time or date, else empty; whose; and if it is certain without the others of a pose."""

    kind: str
    whose: tuple[str, ...] = ()
    is_sure: bool = True


def columns_of(names: Sequence[str], body: str = "", length_unit: str = "") -> PoseColumns:
    """The columns that names tell.

    Args:
        names: of all columns.
        body: whose pose is wanted, where there are several.
        length_unit: of positions whose names say none.

    Raises:
        ColumnsError: they tell no pose, or several.
    """
    angles = not any(_told(name).kind == "qw" for name in names)
    told = [_told(name, angles=angles) for name in names]
    pose = _of_one_body(told, body) or _of_all(names, told)
    form = tuple(told[at].kind for at in pose[len(POSITION) :])
    units = {UNITS_OF_ANGLE.get(_unit(names[at]), "") for at in pose[len(POSITION) :]} if form == ANGLES else {""}
    if len(units) > 1:
        raise ColumnsError(f"angles of different units ({', '.join(names[at] for at in pose[len(POSITION) :])})")
    near = set(words_of(names[pose[0]]))

    def doubt(at: int) -> tuple[bool, int, int]:
        return _doubt(set(words_of(names[at])), near)

    times, dates = (sorted((at for at, one in enumerate(told) if one.kind == kind), key=doubt) for kind in ("time", DATE_WORD))
    first = UNITS_OF_LENGTH.get(_unit(names[pose[0]]), UNITS_OF_LENGTH.get(length_unit.lower(), 1.0))
    length, *other_lengths = {UNITS_OF_LENGTH.get(_unit(names[at]), first) for at in pose[: len(POSITION)]}
    if other_lengths:
        raise ColumnsError(f"positions of different units ({', '.join(names[at] for at in pose[: len(POSITION)])})")
    for at in times:
        for beside in times:
            words, others = set(words_of(names[at])), set(words_of(names[beside]))
            smaller = [unit for word, unit in BESIDE_SECONDS.items() if word in others]
            if smaller and words & WHOLE_SECONDS and words - WHOLE_SECONDS == others - set(BESIDE_SECONDS):
                return PoseColumns(at, beside, NANOSECONDS, pose, length, None, form, units.pop(), None, smaller[0])
    time, date = next(iter([*times, *dates]), None), next(iter(dates), None)
    time_unit = None if time is None else UNITS_OF_TIME.get(_unit(names[time]))
    other = next((at for at in times[1:2] if doubt(at) == doubt(times[0])), None)
    return PoseColumns(time, None, time_unit, pose, length, date, form, units.pop(), other)


def words_of(name: str) -> list[str]:
    """The parts of a name in lower case, `cubePosX` as `cube_pos_x`, without a unit in brackets."""
    plain = IDENTIFIER.sub("", re.sub(r"[\[(][^\[\]()]*[\])]", "", _with_micro(name)))
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+", plain)]


def _of_one_body(told: Sequence[_Name], body: str) -> tuple[int, ...]:
    """The columns of the one body that has a whole pose, of several those of the wanted one; empty where none has."""
    poses: dict[tuple[str, ...], list[int]] = {}
    for whose in dict.fromkeys(one.whose for one in told if one.kind in KINDS):
        for form in FORMS:
            found = [[at for at, one in enumerate(told) if one[:2] == (kind, whose)] for kind in (*POSITION, *form)]
            if all(len(places) == 1 for places in found):
                poses.setdefault(whose, [places[0] for places in found])
    wanted = set(words_of(body))
    named = [whose for whose in poses if wanted and wanted <= set(whose)]
    shortest = [whose for whose in named if all(set(whose) <= set(other) for other in named)]  # brick beside brick2
    chosen = shortest or named or list(poses)
    if len(chosen) > 1:
        listed = ", ".join(" ".join(whose) or "columns without a name" for whose in chosen[:SHOWN])
        raise ColumnsError(f"poses of several: {listed}, none or several of them of {body or 'one body'} (--body-name)")
    return tuple(poses[chosen[0]]) if chosen else ()


def _of_all(names: Sequence[str], told: Sequence[_Name]) -> tuple[int, ...]:
    """The columns of a pose whose position and orientation are named differently, as EuRoC's."""
    kinds = [one.kind for one in told]
    form = max(FORMS, key=lambda form: (len(set(form) & set(kinds)) == len(form), len(set(form) & set(kinds))))
    found = {kind: [at for at, one in enumerate(told) if one.kind == kind and one.is_sure] for kind in (*POSITION, *form)}
    for kind, places in found.items():
        if len(places) > 1:
            raise ColumnsError(f"{len(places)} columns of {kind} ({names[places[0]]}, {names[places[1]]})")
    missing = [kind for kind, places in found.items() if not places]
    if missing:
        shown = ", ".join(name for name in names[:SHOWN] if name) + (", ..." if len(names) > SHOWN else "")
        raise ColumnsError(f"no column of {', '.join(missing)} in {shown}")
    pose = tuple(places[0] for places in found.values())
    position, orientation = (set(told[at].whose) for at in (pose[0], pose[len(POSITION)]))
    if not (position <= orientation or orientation <= position):
        raise ColumnsError(f"a position and an orientation of different names ({names[pose[0]]}, {names[pose[3]]})")
    return pose


def _told(name: str, *, angles: bool = False) -> _Name:
    """What a name says; orientations with x, y and z are angles where no column is a quaternion's w."""
    words = words_of(name)
    if len(words) > 1 and (words[-1] in UNITS_OF_LENGTH or words[-1] in UNITS_OF_ANGLE):
        del words[-1]
    units = _sure_units(words)
    words = [word for word in words if word not in units]
    letters = [word for word in words if not word.isdigit()]
    if not letters or set(letters) & OTHER_WORDS:
        return _Name("")
    *others, last = letters
    behind = words[len(words) - words[::-1].index(last) :]
    if last in MATRIX_WORDS and behind:  # r11, rot_0, m_1_2
        return _Name("m" + "".join(behind), _whose([word for word in words[: -len(behind)] if word not in MATRIX_WORDS]))
    if last in NAMED_ANGLES:
        return _Name(NAMED_ANGLES[last], _whose([word for word in words if word != last]))
    axis = re.fullmatch(r"([qptr]?)([wxyz])", last)
    if axis is None and others and set(letters[1:]) <= POSITION_WORDS | ORIENTATION_WORDS:  # x_position
        others, axis = letters[1:], re.fullmatch(r"()([wxyz])", letters[0])
    if axis is None:
        return _Name("time" if set(letters) & TIME_WORDS else DATE_WORD if DATE_WORD in letters else "")
    whose = _whose([word for word in words if word.isdigit() or word in others])
    if axis[1] == "q" or axis[2] == "w" or set(others) & QUATERNION_WORDS:
        return _Name("q" + axis[2], whose)
    if axis[1] == "r" or set(others) & ORIENTATION_WORDS:
        return _Name(("a" if angles or set(others) & ANGLE_WORDS else "q") + axis[2], whose)
    return _Name(axis[2], whose, bool(axis[1] or not others or set(others) & POSITION_WORDS))


def _whose(words: Sequence[str]) -> tuple[str, ...]:
    """The words of a name that say whose number it is."""
    return tuple(word for word in words if word not in POSITION_WORDS | ORIENTATION_WORDS)


def _doubt(words: set[str], near: set[str]) -> tuple[bool, int, int]:
    """Orders names of times: of a header, of the same body, and without words of another time, `time` before `recv_time`."""
    return "header" not in words, -len(near & words), len(words - TIME_WORDS)


def _unit(name: str) -> str:
    """The unit of a column: in the last brackets that hold one, else the name's last word, or one of `SURE_UNITS`."""
    bracketed = [one.lower() for one in re.findall(r"[\[(]\s*(\w+|°)\s*[\])]", _with_micro(name))]
    words = words_of(name) or [""]
    told = [one for one in bracketed if one in UNITS] or _sure_units(words) or words
    return told[-1]


def _sure_units(words: Sequence[str]) -> list[str]:
    return [word for at, word in enumerate(words) if word in SURE_UNITS and (at or word != "cm")]


def _with_micro(name: str) -> str:
    """With u for the signs of micro."""
    return name.replace("\u00b5", "u").replace("\u03bc", "u")
