"""What people call a toss: its number in the session and its time of day, as a link to its path in the scene.

A link `recording://PATH` in a page selects an entity, which the view that shows it then points out.
"""

from datetime import UTC, datetime

from contact_curation.dashboard.live.screen import FIRST_DATE_NS
from contact_curation.motion.toss import NANOSECONDS, first_stamp_in

PATHS = "scene/tosses"
"""Entity below which the path of each toss is, under its number."""


def path_of(number: int) -> str:
    """The entity of a toss's path."""
    return f"{PATHS}/{number}"


def linked(number: int | None) -> str:
    """A toss's number, as a link to its path; a dash for a toss without one."""
    return "-" if number is None else f"[#{number}](recording://{path_of(number)})"


def time_of(toss_id: str) -> str:
    """The time of day, in UTC, of a toss's first stamp; seconds in a simulation; an id that holds no stamp as it is."""
    stamp_ns = first_stamp_in(toss_id)
    if stamp_ns is None:
        return toss_id
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    if stamp_ns < FIRST_DATE_NS:
        return f"{seconds}.{nanoseconds // 100_000_000} s"
    return datetime.fromtimestamp(seconds, UTC).strftime("%H:%M:%S")


def zoned(toss_id: str) -> str:
    """The same with its zone, where it is a time of day."""
    stamp_ns = first_stamp_in(toss_id)
    return f"{time_of(toss_id)} UTC" if stamp_ns is not None and stamp_ns >= FIRST_DATE_NS else time_of(toss_id)
