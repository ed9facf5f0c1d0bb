"""The tree of frames: static and moving links, as /tf and odometry give them.

A link that moves has a history. Asked for a time between two of its poses it is interpolated, by a cubic through these and
one more on either side: straight lines at 30 Hz cut the bends of a camera that an arm moves by more than tracking noise, which
looks like forces on the body. Only the rig (boards, cameras, robots) is looked up here, never the tossed body, which is not
interpolated over contact.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field

from contact_curation.geometry.scalars import IDENTITY, ScalarPose, compose, interpolated, unit
from contact_curation.motion.pose_stream import FramePose

HISTORY = 2048
"""Poses that a moving link remembers; the oldest half goes when it is full, but for those of the last `KEPT_NS`."""
KEPT_NS, MOST_KEPT = 5_000_000_000, 8 * HISTORY
"""[ns] Body poses may come so late, and transforms at 1 kHz; so many poses stay at most."""
APART = 0.5
"""Of the time between the two poses around it: nearer ones add their noise to an interpolated pose, and no bend."""

MOST_FRAMES = 10_000
"""Links that a tree takes; far more than any robot has."""


@dataclass(slots=True)
class Link:
    """A child frame in its parent; `stamps_ns` is empty for a static link, which has one pose.

    Attributes:
        parent: frame.
        static: holds for all times.
        stamps_ns: of a moving link, increasing.
        poses: likewise.
    """

    parent: str
    static: bool
    stamps_ns: list[int] = field(default_factory=list)
    poses: list[ScalarPose] = field(default_factory=list)

    @property
    def newest_ns(self) -> int:
        return self.stamps_ns[-1]

    def at(self, stamp_ns: int, largest_gap_ns: float, *, ended: bool = False) -> ScalarPose | None:
        """The pose at a time.

        Args:
            stamp_ns: the time.
            largest_gap_ns: between poses that are interpolated.
            ended: nothing more will come.

        Returns:
            None where the two poses around it are missing or too far apart, and as long as the one after these may come.
        """
        if self.static:
            return self.poses[0]
        after = bisect_left(self.stamps_ns, stamp_ns)
        if after < len(self.stamps_ns) and self.stamps_ns[after] == stamp_ns:
            return self.poses[after]
        if not 0 < after < len(self.stamps_ns):
            return None
        start_ns, end_ns = self.stamps_ns[after - 1], self.stamps_ns[after]
        if end_ns - start_ns > largest_gap_ns:
            return None
        apart_ns = APART * (end_ns - start_ns)
        before, later = bisect_right(self.stamps_ns, start_ns - apart_ns) - 1, bisect_left(self.stamps_ns, end_ns + apart_ns)
        if later == len(self.stamps_ns) and not ended:
            return None
        places = [after - 1, after]
        if before >= 0 and start_ns - self.stamps_ns[before] <= largest_gap_ns:
            places.append(before)
        if later < len(self.stamps_ns) and self.stamps_ns[later] - end_ns <= largest_gap_ns:
            places.append(later)
        times = [float(self.stamps_ns[place] - start_ns) for place in places]
        return interpolated(times, [self.poses[place] for place in places], float(stamp_ns - start_ns))


class FrameTree:
    """The links that are known, by child frame.

    Attributes:
        links: by child frame.
        shape: changes whenever a frame gets another link, or one at all; a moving link that gets poses stays the same.
    """

    def __init__(self) -> None:
        self.links: dict[str, Link] = {}
        self.shape = 0

    @property
    def frames(self) -> list[str]:
        """The names of all frames that are known, in order."""
        return sorted({name for child, link in self.links.items() for name in (child, link.parent) if name})

    def take(self, frame_pose: FramePose, history: int = HISTORY) -> bool:
        """Adds a pose; False when it is left out: older than the link's newest, or of one frame too many.

        Args:
            frame_pose: measured.
            history: poses that a moving link remembers.

        Quaternions may be rounded, as launch files have them; links are products of many and hold unit ones.
        """
        link = self.links.get(frame_pose.child)
        if link is None and len(self.links) >= MOST_FRAMES:
            return False
        pose = ScalarPose(frame_pose.pose.position, unit(frame_pose.pose.orientation_wxyz))
        if frame_pose.static:
            self._put(frame_pose.child, Link(frame_pose.parent, True, poses=[pose]))
            return True
        if link is None or link.static or link.parent != frame_pose.parent:
            link = self._put(frame_pose.child, Link(frame_pose.parent, False))
        if link.stamps_ns and frame_pose.stamp_ns <= link.newest_ns:
            return False
        if len(link.stamps_ns) >= history:
            gone = len(link.stamps_ns) - history // 2
            if HISTORY <= len(link.stamps_ns) < MOST_KEPT:
                gone = min(gone, bisect_left(link.stamps_ns, frame_pose.stamp_ns - KEPT_NS))
            del link.stamps_ns[:gone], link.poses[:gone]
        link.stamps_ns.append(frame_pose.stamp_ns)
        link.poses.append(pose)
        return True

    def _put(self, child: str, link: Link) -> Link:
        self.links[child] = link
        self.shape += 1
        return link

    def forget_after(self, stamp_ns: int) -> None:
        """Drops the moving links that know times after `stamp_ns`: the clock has jumped back."""
        self.links = {child: link for child, link in self.links.items() if link.static or link.newest_ns <= stamp_ns}
        self.shape += 1

    def ancestors(self, frame: str) -> Iterator[tuple[str, Link | None]]:
        """The frame and those above it, each with its link to the next; ends where the tree does, or bites its tail."""
        seen: set[str] = set()
        while frame not in seen:
            seen.add(frame)
            link = self.links.get(frame)
            yield frame, link
            if link is None:
                return
            frame = link.parent

    def path(self, frame: str, top: str) -> list[Link] | None:
        """The links from `frame` up to `top`; None where `top` is not above it."""
        links: list[Link] = []
        for name, link in self.ancestors(frame):
            if name == top:
                return links
            if link is not None:
                links.append(link)
        return None

    def moving_ancestor(self, frame: str) -> str:
        """The frame whose measurements move `frame`: itself, or the first moving one above its static links."""
        for name, link in self.ancestors(frame):
            if link is None or not link.static:
                return name
        return frame


def composed(links: list[Link], stamp_ns: int, largest_gap_ns: float, *, ended: bool = False) -> ScalarPose | None:
    """The pose of the lowest frame of a path in the topmost, at a time; None where a link does not know that time."""
    pose = IDENTITY
    for link in links:
        step = link.at(stamp_ns, largest_gap_ns, ended=ended)
        if step is None:
            return None
        pose = compose(step, pose)
    return pose
