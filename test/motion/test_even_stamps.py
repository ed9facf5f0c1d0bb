"""Stamps of reception become even ones where the motion says so, and nowhere else."""

import json
import threading
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.geometry.quaternions import Array
from contact_curation.motion.body_tracker import BodyPose, TrackerConfig
from contact_curation.motion.even_stamps import EVEN, FARTHEST_BACK, StampEvener
from contact_curation.motion.ingest import IngestConfig, IngestEvent, TossIngest
from contact_curation.motion.pose_stream import BadPose, FramePose
from contact_curation.motion.toss import Rejected, Toss
from test.motion.streams import CUBE, PERIOD_NS, Throw, board_in_map, in_map, noisy, stream

type Delays = Callable[[int, np.random.Generator], Array]
"""What the stamps of so many frames are off [s]."""

THROWS, APART = 3, 6_000_000_000


def normal(frames: int, rng: np.random.Generator) -> Array:
    return 2e-3 * rng.standard_normal(frames)


def uniform(frames: int, rng: np.random.Generator) -> Array:
    return 2e-3 * rng.random(frames)


def queued(frames: int, rng: np.random.Generator) -> Array:
    """One-sided and heavy-tailed."""
    return rng.exponential(2e-3, frames)


def late_now_and_then(frames: int, rng: np.random.Generator) -> Array:
    return np.asarray(np.where(rng.random(frames) < 0.02, rng.uniform(5e-4, 2e-2, frames), 0.0))


def slight(frames: int, rng: np.random.Generator) -> Array:
    return 2e-4 * rng.standard_normal(frames)


def throws(rate: float, number: int = THROWS) -> list[BodyPose]:
    """So many throws of a cube that was held before, after each other."""
    period_ns = round(1e9 / rate)
    throw = Throw(carried=round(0.5 * rate), seen=round(1.3 * rate), position=(0.1, 0.2, 0.35), velocity=(0.6, 0.2, 0.5))
    return [one for k in range(number) for one in stream(throw, APART * (k + 1), period_ns)]


def stamped(poses: Sequence[BodyPose], delays: Delays, *, in_order: bool = False, seed: int = 0) -> list[BodyPose]:
    """The poses with stamps that are off; what is received one after the other has no earlier stamp than what came before."""
    off = delays(len(poses), np.random.default_rng(seed))
    stamps = np.array([one.stamp_ns for one in poses]) + np.rint(1e9 * off).astype(np.int64)
    if in_order:
        stamps = np.maximum.accumulate(stamps) + np.arange(len(poses))
    return [BodyPose(int(stamp_ns), one.pose) for stamp_ns, one in zip(stamps, poses, strict=True)]


def evened(poses: Sequence[BodyPose], evener: StampEvener | None = None) -> list[BodyPose | BadPose]:
    evener = evener or StampEvener("cube")
    return [*(given for one in poses for given in evener.push(one)), *evener.flush()]


def fresh() -> TossIngest:
    return TossIngest(IngestConfig(TrackerConfig("body_cube")), CUBE, source="/odom")


def ingested(poses: Sequence[BodyPose], ingest: TossIngest | None = None) -> list[IngestEvent]:
    ingest = ingest or fresh()
    measured: list[FramePose] = [board_in_map(), *in_map(poses)]
    return [*(event for one in measured for event in ingest.push(one)), *ingest.flush()]


@pytest.mark.slow
@pytest.mark.parametrize("rate", [60, 120, 148, 250])
@pytest.mark.parametrize(
    ("delays", "in_order"),
    [(slight, False), (normal, False), (normal, True), (uniform, False), (queued, True), (late_now_and_then, True)],
)
def test_stamps_of_reception_cost_no_toss(rate: int, delays: Delays, in_order: bool) -> None:
    poses = throws(rate)
    ingest = fresh()
    found = ingested(stamped(noisy(poses, 1.0), delays, in_order=in_order), ingest)
    assert [type(event) for event in found] == [Toss] * THROWS, [e.reasons for e in found if isinstance(e, Rejected)]
    for toss in (one for one in found if isinstance(one, Toss)):
        assert toss.frame_period == pytest.approx(1.0 / rate, rel=0.01)
    assert "jitter by" in ingest.stamps_done
    assert ingest.counts["evened"] > 0


def test_the_line_says_by_how_much_stamps_jitter_and_how_many_are_even_now() -> None:
    ingest = fresh()
    ingested(stamped(throws(148.0), normal), ingest)
    said = ingest.stamps_done
    assert said.startswith("header stamps jitter by ")
    assert float(said.split()[4]) == pytest.approx(2.0, rel=0.15)
    assert float(said.partition("an even ")[2].split()[0]) == pytest.approx(148.0, rel=0.005)
    assert f"{ingest.counts['evened']} poses took even stamps" in said


def test_even_stamps_and_those_of_the_real_rig_stay_as_they_are() -> None:
    def of_the_rig(frames: int, rng: np.random.Generator) -> Array:
        return np.asarray(np.clip(3e-5 * rng.standard_normal(frames), -1e-4, 1e-4))

    for poses in (throws(148.0), stamped(throws(148.0), of_the_rig)):
        ingest = fresh()
        assert [one.stamp_ns for one in evened(poses)] == [one.stamp_ns for one in poses]
        ingested(poses, ingest)
        assert (ingest.stamps_done, ingest.counts["evened"]) == ("", 0)


@pytest.mark.parametrize("rate", [60.0, 90.0])
@pytest.mark.parametrize("seen", [10, 15, 16, 17])
def test_even_stamps_stay_as_they_are_after_a_pause_that_comes_early(rate: float, seen: int) -> None:
    """A part of a recording may begin shortly before one."""
    period_ns = 1e9 / rate
    poses = [BodyPose(round(period_ns * (n + (120 if n >= seen else 0))), one.pose) for n, one in enumerate(throws(rate, 1))]
    assert [one.stamp_ns for one in evened(poses)] == [one.stamp_ns for one in poses]


def test_even_stamps_wait_for_nothing_once_the_stream_has_begun() -> None:
    evener = StampEvener("cube")
    given = [len(evener.push(one)) for one in throws(148.0)]
    assert sum(given[:20]) == 20
    assert set(given[20:]) == {1}


@pytest.mark.parametrize("rate", [50.0, 148.0])
@pytest.mark.parametrize("missing", [(1,), (3,), (9,), (9, 5), (9, 70), (5, 9, 17)])
def test_frames_missing_in_an_even_stream_change_no_stamp(rate: float, missing: tuple[int, ...]) -> None:
    """A body may be hidden again soon, and for longer than a pause."""
    poses, at = throws(rate, 2), 40
    for frames in missing:
        poses, at = [*poses[:at], *poses[at + frames :]], at + 10
    evener = StampEvener("cube")
    assert [one.stamp_ns for one in evened(poses, evener)] == [one.stamp_ns for one in poses]
    assert (evener.done, evener.counts["evened"]) == ("", 0)


def test_what_is_said_of_jitter_amid_missing_frames_is_what_was_moved() -> None:
    poses = [one for k, one in enumerate(throws(148.0)) if k % 266 not in range(150, 159)]
    late = stamped(poses, normal)
    evener = StampEvener("cube")
    given = evened(late, evener)
    moved = np.array([one.stamp_ns - new.stamp_ns for one, new in zip(late, given, strict=True)])
    assert evener.scatter == pytest.approx(1e-9 * float(moved[moved != 0].std()), rel=0.05)


@pytest.mark.parametrize("delays", [slight, uniform])
def test_a_frame_that_is_missing_among_jitter_is_a_gap(delays: Delays) -> None:
    poses = throws(148.0, 2)
    lost = next(k for k, one in enumerate(poses) if one.stamp_ns > poses[0].stamp_ns + 700_000_000)  # in the air
    first, second = ingested(stamped([*poses[:lost], *poses[lost + 3 :]], delays))
    assert isinstance(first, Rejected)
    assert first.reasons[0].startswith("gap: ")
    assert isinstance(second, Toss)


@pytest.mark.parametrize("missing", [(4,), (20,), (60, 66), (20, 60, 160)])
@pytest.mark.parametrize("delays", [slight, uniform])
def test_frames_missing_anywhere_after_a_pause_are_gaps(delays: Delays, missing: tuple[int, ...]) -> None:
    poses = throws(148.0)
    each = len(poses) // THROWS
    seen = [one for n, one in enumerate(poses) if n % each not in missing]
    given = [one for one in evened(stamped(seen, delays)) if isinstance(one, BodyPose)]
    assert len(given) == len(seen)
    rows = zip(pairwise(seen), pairwise(given), strict=True)
    steps = [(after.stamp_ns - before.stamp_ns, late.stamp_ns - soon.stamp_ns) for (before, after), (soon, late) in rows]
    off = [abs(true - found) for true, found in steps if true < APART // 4]
    assert max(off) < 0.3 * PERIOD_NS


def test_two_cameras_that_take_turns_keep_their_stamps_while_the_body_moves() -> None:
    """Their steps are 2 and 11.5 ms: uneven, and right."""
    period_ns = 500_000
    fine = stream(Throw(carried=1000, seen=600, position=(0.1, 0.2, 0.5)), period_ns=period_ns)
    poses = [one for k, one in enumerate(fine) if k % 27 in (0, 4)]
    given = evened(poses)
    moved = [one.stamp_ns for one in poses[8:]]
    assert [one.stamp_ns for one in given[8:]] == moved


def test_a_stream_that_goes_over_to_another_rate_is_followed() -> None:
    slow, fast = throws(60.0, 2), throws(148.0, 2)
    later_ns = slow[-1].stamp_ns + 1_000_000_000 - fast[0].stamp_ns
    poses = [*slow, *(BodyPose(one.stamp_ns + later_ns, one.pose) for one in fast)]
    found = ingested(stamped(poses, uniform))
    periods = [one.frame_period for one in found if isinstance(one, Toss)]
    assert periods == pytest.approx([1 / 60, 1 / 60, 1 / 148, 1 / 148], rel=0.01)


@pytest.mark.parametrize("delays", [normal, late_now_and_then])
def test_an_evener_killed_anywhere_goes_on_from_its_written_state(delays: Delays) -> None:
    poses = stamped(throws(148.0, 2), delays)
    undisturbed = fresh()
    whole = ingested(poses, undisturbed)
    for killed_at in range(7, len(poses), 61):
        before, after = fresh(), fresh()
        events = [event for one in [board_in_map(), *in_map(poses[:killed_at])] for event in before.push(one)]
        after.restore(json.loads(json.dumps(before.snapshot())))
        events += [event for one in in_map(poses[killed_at:]) for event in after.push(one)]
        events += after.flush()
        assert [one.digest() for one in events if isinstance(one, Toss)] == [
            one.digest() for one in whole if isinstance(one, Toss)
        ]
        assert after.counts == undisturbed.counts


def test_a_state_from_before_there_was_an_evener_is_taken_up() -> None:
    state = fresh().snapshot()
    del state["stamps"]
    fresh().restore(state)
    with pytest.raises(InvalidValueError, match="stamps state: found"):
        StampEvener("cube").restore({"held": []})


@pytest.mark.parametrize(
    ("back_ns", "why"),
    [(0, "the same one twice"), (1_000_000, "one that goes back by 0.001"), (990_000_000, "one that goes back")],
)
def test_a_stamp_of_an_even_stream_that_repeats_or_goes_back_is_flagged_and_left_out(back_ns: int, why: str) -> None:
    poses = throws(148.0, 1)
    late = BodyPose(poses[99].stamp_ns - back_ns, poses[99].pose)
    given = evened([*poses[:100], late, *poses[100:]])
    (bad,) = [one for one in given if isinstance(one, BadPose)]
    assert bad.why.startswith(f"stamp: found {why}")
    assert bad.kind == "stamp"
    assert [one.stamp_ns for one in given if one is not bad] == [one.stamp_ns for one in poses]


def test_stamps_that_jitter_go_on_whatever_comes() -> None:
    rng = np.random.default_rng(1)
    steps = rng.choice([-3 * FARTHEST_BACK, -1_000_000, 0, 1, EVEN, PERIOD_NS, 40 * PERIOD_NS], 3000)
    poses = [BodyPose(int(ns), one.pose) for ns, one in zip(10**10 + np.cumsum(steps), throws(148.0, 30))]
    given = [one.stamp_ns for one in evened(poses) if isinstance(one, BodyPose)]
    assert all(later > earlier for earlier, later in pairwise(given))


@pytest.mark.slow
def test_stamps_that_go_to_and_fro_do_not_pile_up() -> None:
    evener, pose = StampEvener("cube"), throws(148.0, 1)[0].pose
    given = sum(len(evener.push(BodyPose(10**10 + 1_000_000 * (k % 3), pose))) for k in range(3000))
    assert given > 1500


def test_the_scatter_may_be_asked_for_while_another_thread_evens_stamps() -> None:
    evener, ended = StampEvener("cube"), threading.Event()

    def add() -> None:
        while not ended.is_set():
            evener._delays.append(1.0)

    thread = threading.Thread(target=add)
    thread.start()
    try:
        assert {evener.scatter for _ in range(200)} <= {0.0}
    finally:
        ended.set()
        thread.join()
