"""What is held out: by number, id or digest, the same in files and in the bag made of them; duplicates are not trained on."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.learning.evaluation.held_out import (
    SAME_MOTION,
    Duplicate,
    HeldOutRule,
    NumberedToss,
    outline_of,
    possible_duplicates,
    split,
    toss_number,
)
from contact_curation.motion.toss import Toss
from contact_curation.storage.datasets.tagslam_bag import import_contactnets
from contact_curation.storage.inputs.inputs import open_inputs
from test.simulated import simulated_tosses

LEAKING = {84, 163, 164, 165, 166, 167, 226, 227, 228, 229, 230, 321, 322, 323, 324, 363, 364}
"""Public tosses below 400 with a duplicate from 400 on, by their velocities: `python -m benchmarks.data.duplicates`."""


@pytest.fixture(scope="module")
def tosses() -> tuple[Toss, ...]:
    return simulated_tosses(6, seed=3)


def numbered(tosses: tuple[Toss, ...]) -> list[NumberedToss]:
    return [NumberedToss(toss, toss_number(toss, place)) for place, toss in enumerate(tosses)]


def ids(tosses: tuple[Toss, ...]) -> list[str]:
    return [toss.toss_id for toss in tosses]


def turned(toss: Toss, yaw: float, toss_id: str) -> Toss:
    """The same motion under another heading of the board."""
    turn = quaternions.exp(np.array([0.0, 0.0, yaw]))
    return replace(
        toss,
        toss_id=toss_id,
        positions=quaternions.rotate(turn, toss.positions) + np.array([0.3, -0.2, 0.0]),
        orientations_wxyz=quaternions.multiply(turn, toss.orientations_wxyz),
        linear_velocities=quaternions.rotate(turn, toss.linear_velocities),
    )


def test_a_span_holds_out_its_numbers_with_both_ends(tosses: tuple[Toss, ...]) -> None:
    parts = split(numbered(tosses), HeldOutRule(spans=((0, 0), (2, 3))))
    assert ids(parts.held_out) == [tosses[k].toss_id for k in (0, 2, 3)]
    assert ids(parts.training) == [tosses[k].toss_id for k in (1, 4, 5)]


def test_the_empty_rule_holds_nothing_out(tosses: tuple[Toss, ...]) -> None:
    parts = split(numbered(tosses), HeldOutRule())
    assert (ids(parts.training), parts.held_out, parts.duplicates) == (ids(tosses), (), ())


def test_ids_hold_out_those_tosses(tosses: tuple[Toss, ...]) -> None:
    parts = split(numbered(tosses), HeldOutRule(ids=frozenset({tosses[4].toss_id, "a toss of another day"})))
    assert ids(parts.held_out) == [tosses[4].toss_id]


def test_a_file_is_numbered_by_its_name_and_a_toss_of_a_recording_by_its_place(tosses: tuple[Toss, ...]) -> None:
    assert toss_number(replace(tosses[0], source="417.pt"), 3) == 417
    assert toss_number(replace(tosses[0], source="/tagslam/odom/body_cube"), 3) == 3
    assert toss_number(replace(tosses[0], source="toss_417.pt"), 3) == 3
    assert toss_number(replace(tosses[0], source="417"), 3) == 3


def test_a_share_holds_out_about_as_many_and_later_tosses_move_none_across(tosses: tuple[Toss, ...]) -> None:
    many = [NumberedToss(replace(tosses[0], toss_id=f"cube-{k}-aa"), k) for k in range(2000)]
    rule = HeldOutRule(share=0.3)
    alone = [one.number for one in many[:100] if rule.holds_out(one)]
    assert [one.number for one in many if rule.holds_out(one)][: len(alone)] == alone
    assert sum(map(rule.holds_out, many)) == pytest.approx(600, abs=60)
    larger = HeldOutRule(share=0.5)
    assert all(larger.holds_out(one) for one in many if rule.holds_out(one))


def test_a_duplicate_of_a_held_out_toss_is_not_trained_on(tosses: tuple[Toss, ...]) -> None:
    duplicate = turned(tosses[0], 1.1, "duplicate")
    together = numbered((*tosses, duplicate))
    parts = split(together, HeldOutRule(spans=((0, 0),)))
    assert parts.duplicates == (Duplicate("duplicate", tosses[0].toss_id),)
    assert ids(parts.training) == ids(tosses[1:])
    published = split(together, HeldOutRule(spans=((0, 0),)), with_duplicates=True)
    assert (ids(published.training), published.duplicates) == ([*ids(tosses[1:]), "duplicate"], ())


def test_duplicates_on_one_side_stay_there(tosses: tuple[Toss, ...]) -> None:
    together = numbered((*tosses, turned(tosses[0], 1.1, "duplicate")))
    assert split(together, HeldOutRule(spans=((1, 1),))).duplicates == ()
    both = split(together, HeldOutRule(spans=((0, 0),), ids=frozenset({"duplicate"})))
    assert (len(both.held_out), both.duplicates) == (2, ())


def test_a_motion_that_differs_by_a_hundredth_of_a_millimetre_is_another_one(tosses: tuple[Toss, ...]) -> None:
    other = replace(tosses[0], toss_id="other", positions=tosses[0].positions + np.array([0.0, 0.0, 1e-5]))
    assert split(numbered((*tosses, other)), HeldOutRule(spans=((0, 0),))).duplicates == ()


def test_outlines_are_alike_for_duplicates_and_for_hardly_anything_else(tosses: tuple[Toss, ...]) -> None:
    outlines = {toss.toss_id: outline_of(toss) for toss in tosses[1:]}
    close = replace(tosses[0], positions=tosses[0].positions + np.array([0.0, 0.0, 0.99 * SAME_MOTION]))
    outlines |= {"turned": outline_of(turned(tosses[0], 1.1, "turned")), "close": outline_of(close)}
    held_out = {tosses[0].toss_id: outline_of(tosses[0])}
    upwards = quaternions.rotate(quaternions.conjugate(tosses[0].orientations_wxyz), np.array([0.0, 0.0, 1.0])).mean(axis=0)
    assert outline_of(tosses[0]) == pytest.approx((tosses[0].frames, tosses[0].positions[:, 2].mean(), *upwards), abs=1e-12)
    assert possible_duplicates(outlines, held_out) == {tosses[0].toss_id, "turned", "close"}
    assert possible_duplicates({"far": (100.0, 0.1 + 1e-5, 0.0, 0.0, 1.0)}, {"near": (100.0, 0.1, 0.0, 0.0, 1.0)}) == set()
    assert possible_duplicates(outlines, {}) == possible_duplicates({}, held_out) == set()


@pytest.mark.parametrize("rule", [{"share": -0.1}, {"share": 1.0}, {"spans": ((5, 4),)}, {"spans": ((-1, 4),)}])
def test_a_rule_without_sense_is_refused(rule: dict[str, object]) -> None:
    with pytest.raises(InvalidValueError, match="held out"):
        HeldOutRule(**rule)  # type: ignore[arg-type]


def read(path: Path) -> list[NumberedToss]:
    items = [item for item in open_inputs([path], CONTACTNETS_CUBE) if isinstance(item, Toss)]
    return [NumberedToss(toss, toss_number(toss, place)) for place, toss in enumerate(items)]


def check_the_public_split(tosses: list[NumberedToss]) -> None:
    numbers = {one.toss.toss_id: one.number for one in tosses}
    parts = split(tosses, HeldOutRule(spans=((400, 569),)))
    assert [numbers[toss_id] for toss_id in ids(parts.held_out)] == list(range(400, 570))
    assert {numbers[duplicate.left_out] for duplicate in parts.duplicates} == LEAKING
    assert [numbers[toss_id] for toss_id in ids(parts.training)] == sorted(set(range(400)) - LEAKING)


@pytest.mark.slow
def test_the_public_files_are_split_by_their_names(contactnets_folder: Path) -> None:
    check_the_public_split(read(contactnets_folder))


@pytest.mark.slow
def test_the_bag_made_of_the_public_files_is_split_as_they_are(contactnets_folder: Path, tmp_path: Path) -> None:
    bag = tmp_path / "all.mcap"
    import_contactnets(contactnets_folder, bag)
    check_the_public_split(read(bag))
    assert [one.toss.frames for one in read(bag)] == [one.toss.frames for one in read(contactnets_folder)]


def test_a_bag_holds_the_tosses_of_the_first_files_under_their_numbers(contactnets_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "first"
    folder.mkdir()
    for number in range(11):  # so that 10 comes after 9, and not after 1
        (folder / f"{number}.pt").symlink_to(contactnets_folder / f"{number}.pt")
    import_contactnets(folder, tmp_path / "first.mcap")
    files, bag = read(folder), read(tmp_path / "first.mcap")
    assert [one.number for one in bag] == [one.number for one in files] == list(range(11))
    assert all(np.allclose(a.toss.orientations_wxyz[0], b.toss.orientations_wxyz[0], atol=1e-9) for a, b in zip(files, bag))
