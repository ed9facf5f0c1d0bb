"""Frames in frames: static links for ever, moving links at their times, never across a hole."""

import pytest

from contact_curation.geometry.scalars import IDENTITY, ScalarPose, compose, inverse
from contact_curation.motion.frame_tree import HISTORY, KEPT_NS, MOST_FRAMES, MOST_KEPT, FrameTree, composed
from contact_curation.motion.pose_stream import FramePose
from test.motion.streams import BOARD, yawed

SECOND = 1_000_000_000


def at(x: float) -> ScalarPose:
    return ScalarPose((x, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


def moving(stamp_ns: int, pose: ScalarPose, parent: str = "map", child: str = "camera") -> FramePose:
    return FramePose(stamp_ns, parent, child, pose)


def tree(*links: FramePose) -> FrameTree:
    made = FrameTree()
    for link in links:
        assert made.take(link)
    return made


def test_a_path_composes_from_the_lowest_frame_to_the_topmost() -> None:
    lower, upper = ScalarPose((0.1, 0.2, 0.3), yawed(0.4)), BOARD
    known = tree(FramePose(0, "camera", "tag", lower, static=True), FramePose(0, "map", "camera", upper, static=True))
    path = known.path("tag", "map")
    assert path is not None
    found = composed(path, 5, SECOND)
    assert found is not None
    assert found.position == pytest.approx(compose(upper, lower).position)
    assert found.orientation_wxyz == pytest.approx(compose(upper, lower).orientation_wxyz)
    assert composed(known.path("map", "map") or [], 5, SECOND) == IDENTITY
    assert known.path("map", "tag") is None


def test_a_link_whose_quaternion_was_rounded_is_a_rotation() -> None:
    rounded = ScalarPose((0.1, 0.0, 0.0), (0.707, 0.0, 0.0, 0.707))
    known = tree(FramePose(0, "map", "board", rounded, static=True), moving(5, rounded, parent="board"))
    found = composed(known.path("camera", "map") or [], 5, SECOND)
    assert found is not None
    assert found.orientation_wxyz == pytest.approx((0.0, 0.0, 0.0, 1.0), abs=1e-12)
    assert found.position == pytest.approx((0.1, 0.1, 0.0), abs=1e-12)


def test_a_moving_link_is_exact_at_its_times_and_straight_between_two_that_are_alone() -> None:
    link = tree(moving(0, at(0.0)), moving(100, at(1.0)), moving(300, at(3.0)), moving(400, at(7.0))).links["camera"]
    found = [link.at(stamp, 100, ended=True) for stamp in (0, 50, 100, 150, 300, 350)]
    assert [one and one.position[0] for one in found] == [0.0, 0.5, 1.0, None, 3.0, 5.0]


def test_between_its_poses_a_moving_link_awaits_the_one_after_the_next() -> None:
    """As a cubic through four: x = s^3, in hundreds of nanoseconds."""
    known = tree(*(moving(100 * step, at(float(step**3))) for step in (0, 1, 2)))
    link = known.links["camera"]
    assert link.at(150, SECOND) is None
    known.take(moving(220, at(2.2**3)))  # too near to say more
    assert link.at(150, SECOND) is None
    known.take(moving(300, at(27.0)))
    found = link.at(150, SECOND)
    assert found is not None
    assert found.position[0] == pytest.approx(1.5**3)


def test_before_its_first_and_after_its_last_time_a_moving_link_is_unknown() -> None:
    link = tree(moving(100, at(0.0)), moving(200, at(1.0))).links["camera"]
    assert link.at(99, SECOND) is None
    assert link.at(201, SECOND) is None


@pytest.mark.parametrize(("gap", "known"), [(100, True), (99, False)])
def test_a_hole_in_a_moving_link_is_not_bridged(gap: int, known: bool) -> None:
    link = tree(moving(0, at(0.0)), moving(100, at(1.0))).links["camera"]
    assert (link.at(50, gap, ended=True) is not None) is known


def test_a_pose_that_is_not_newer_is_left_out() -> None:
    known = tree(moving(100, at(1.0)))
    assert not known.take(moving(100, at(2.0)))
    assert not known.take(moving(50, at(2.0)))
    assert known.links["camera"].poses == [at(1.0)]


def test_a_history_is_bounded_and_keeps_the_newest() -> None:
    known = tree(*(moving(stamp * 10**7, at(float(stamp))) for stamp in range(3 * HISTORY)))
    link = known.links["camera"]
    assert HISTORY // 2 <= len(link.poses) == len(link.stamps_ns) <= HISTORY
    assert link.newest_ns == (3 * HISTORY - 1) * 10**7


def test_transforms_at_a_kilohertz_are_kept_for_poses_that_come_late_and_bounded_nevertheless() -> None:
    link = tree(*(moving(stamp * 10**6, at(0.0)) for stamp in range(4 * HISTORY))).links["camera"]
    assert link.stamps_ns[0] <= link.newest_ns - KEPT_NS
    assert len(link.stamps_ns) == len(link.poses) < 1.1e-6 * KEPT_NS
    link = tree(*(moving(stamp, at(0.0)) for stamp in range(MOST_KEPT + HISTORY))).links["camera"]
    assert len(link.stamps_ns) < MOST_KEPT


def test_a_frame_that_gets_another_parent_starts_anew() -> None:
    known = tree(moving(100, at(1.0)), moving(200, at(2.0), parent="arm"))
    assert known.path("camera", "arm") == [known.links["camera"]]
    assert known.links["camera"].poses == [at(2.0)]


def test_frames_that_bite_their_own_tail_end_the_search() -> None:
    known = tree(FramePose(0, "b", "a", BOARD, static=True), FramePose(0, "a", "b", inverse(BOARD), static=True))
    assert [name for name, _ in known.ancestors("a")] == ["a", "b"]
    assert known.path("a", "map") is None


def test_what_moves_a_frame_is_the_first_moving_link_above_its_static_ones() -> None:
    known = tree(FramePose(0, "tag", "body", at(0.1), static=True), moving(5, at(1.0), "camera", "tag"))
    assert known.moving_ancestor("body") == "tag"
    assert known.moving_ancestor("tag") == "tag"
    assert known.moving_ancestor("unheard of") == "unheard of"


def test_after_a_clock_jump_links_that_know_the_future_are_forgotten() -> None:
    known = tree(moving(100, at(1.0)), moving(900, at(1.0), child="arm"), FramePose(950, "map", "board", BOARD, static=True))
    known.forget_after(500)
    assert sorted(known.links) == ["board", "camera"]


def test_a_tree_takes_so_many_frames_and_no_more() -> None:
    known = tree(*(FramePose(0, "room", f"frame_{number}", at(0.0), True) for number in range(MOST_FRAMES)))
    assert not known.take(FramePose(0, "room", "one_more", at(0.0), True))
    assert len(known.links) == MOST_FRAMES
    assert known.take(FramePose(0, "hall", "frame_3", at(1.0), True))  # what is known may change
    assert known.links["frame_3"].parent == "hall"
