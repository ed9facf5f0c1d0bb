"""Selected tosses as ContactNets' files: rows as in the public ones, whichever way the toss came here."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.geometry import quaternions
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.motion.toss import Toss
from contact_curation.pipeline.export import ExportJob, found_tosses
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.storage.datasets.contactnets import read_contactnets, read_contactnets_toss
from contact_curation.storage.datasets.tagslam_bag import TagslamRig, import_contactnets
from contact_curation.storage.export.contactnets import contactnets_rows, write_contactnets
from contact_curation.storage.export.selected import SelectedToss
from contact_curation.storage.inputs.inputs import open_inputs
from contact_curation.storage.inputs.records import InputsConfig
from contact_curation.storage.manifest.manifest import Manifest
from contact_curation.storage.provenance import TossProvenance
from test.motion.recorded_tosses import shaken
from test.motion.test_segmenter import cut, tossed
from test.storage.datasets.test_tagslam_bag import save_contactnets, synthetic_toss
from test.storage.manifest.test_manifest import RUN
from test.storage.selected_rows import row

CUBE = CONTACTNETS_CUBE


def kept(toss: Toss, origin: str = "") -> SelectedToss:
    return SelectedToss(toss, row(toss.toss_id), TossProvenance(origin))


def test_a_file_is_the_rows_of_the_toss_in_half_widths_as_contactnets_loads_it(tmp_path: Path) -> None:
    toss = synthetic_toss()
    write_contactnets([kept(synthetic_toss(0.25)), kept(toss)], CUBE, tmp_path)
    assert sorted(file.name for file in (tmp_path / "tosses_processed").iterdir()) == ["0.pt", "1.pt"]
    run = torch.load(tmp_path / "tosses_processed" / "1.pt")  # as its DataManager does
    assert (run.dtype, tuple(run.shape)) == (torch.float64, (1, toss.frames, 19))
    pairs = torch.stack([run[0, :-1], run[0, 1:]], dim=1)  # its process_run: previous and next state
    np.testing.assert_allclose(pairs[:, 1, 0:3].numpy() * 0.0524, toss.positions[1:], rtol=1e-15)
    np.testing.assert_array_equal(pairs[:, 0, 3:7].numpy(), toss.orientations_wxyz[:-1])
    np.testing.assert_allclose(run[0, :, 7:10].numpy() * 0.0524, toss.linear_velocities, rtol=1e-15)
    np.testing.assert_array_equal(run[0, :, 10:13].numpy(), toss.angular_velocities)
    assert not run[0, :, 13:].any()


def test_our_own_reader_gives_the_toss_back(tmp_path: Path) -> None:
    toss = synthetic_toss()
    write_contactnets([kept(toss)], CUBE, tmp_path)
    (again,) = (one for one in read_contactnets(tmp_path) if isinstance(one, Toss))
    np.testing.assert_allclose(again.positions, toss.positions, rtol=1e-15)
    np.testing.assert_array_equal(again.orientations_wxyz, toss.orientations_wxyz)
    np.testing.assert_array_equal(again.angular_velocities, toss.angular_velocities)
    assert again.frame_period == toss.frame_period


def test_files_hold_the_frame_that_a_tracker_follows_and_give_the_body_back(tmp_path: Path) -> None:
    toss, offset = synthetic_toss(), np.array([0.02, -0.01, 0.03])
    beside = replace(CUBE, center_of_mass=offset)
    write_contactnets([kept(toss)], beside, tmp_path)
    (tracked,) = (one for one in read_contactnets(tmp_path, beside) if isinstance(one, Toss))
    np.testing.assert_allclose(
        tracked.positions + quaternions.rotate(toss.orientations_wxyz, offset), toss.positions, atol=1e-15
    )
    steps = np.diff(tracked.positions, axis=0) / toss.frame_period
    assert np.median(np.abs(steps - tracked.linear_velocities[1:])) < 0.01, "they are the velocities of that frame"
    (again,) = (one for one in open_inputs([tmp_path], beside) if isinstance(one, Toss))
    np.testing.assert_allclose(again.positions, toss.positions, atol=1e-15)
    np.testing.assert_allclose(again.linear_velocities, toss.linear_velocities, atol=1e-14)
    import_contactnets(tmp_path, tmp_path / "bag.mcap", beside, TagslamRig(rules=SegmenterConfig()))
    (recorded,) = (one for one in open_inputs([tmp_path / "bag.mcap"], beside) if isinstance(one, Toss))
    np.testing.assert_allclose(recorded.positions, toss.positions, atol=1e-9)


def test_files_of_a_body_beside_its_tracked_frame_keep_the_stamps(tmp_path: Path) -> None:
    seen, beside = tossed(cut(shaken(3))), replace(CUBE, center_of_mass=np.array([0.02, -0.01, 0.03]))
    write_contactnets([kept(seen)], beside, tmp_path)
    report = import_contactnets(tmp_path, tmp_path / "bag.mcap", beside, TagslamRig(rules=SegmenterConfig()))
    assert report.inexact == ()
    (read,) = (one for one in open_inputs([tmp_path], beside) if isinstance(one, Toss))
    (recorded,) = (one for one in open_inputs([tmp_path / "bag.mcap"], beside) if isinstance(one, Toss))
    for again in (read, recorded):
        assert np.median(np.abs(np.diff(again.stamps_ns) - np.diff(seen.stamps_ns))) <= 1
        np.testing.assert_allclose(again.linear_velocities, seen.linear_velocities, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(again.positions, seen.positions, atol=1e-9)


def test_a_toss_of_such_a_file_is_that_file(tmp_path: Path) -> None:
    save_contactnets(tmp_path, 17, synthetic_toss())
    source, out = tmp_path / "17.pt", tmp_path / "out"
    out.mkdir()
    write_contactnets([kept(read_contactnets_toss(source), str(source))], CUBE, out)
    assert (out / "tosses_processed" / "0.pt").read_bytes() == source.read_bytes()


def test_another_frame_rate_is_refused_for_files_do_not_tell_it(tmp_path: Path) -> None:
    slow = replace(synthetic_toss(), frame_period=1.0 / 60.0)
    with pytest.raises(InvalidValueError, match=r"found 60 Hz, expected 148 Hz, .*; --format lerobot takes other rates"):
        contactnets_rows(slow, CUBE)
    almost = replace(slow, frame_period=1.005 / 148.0)
    assert contactnets_rows(almost, CUBE).shape == (almost.frames, 19)


def test_missing_frames_are_refused_for_files_are_read_as_if_there_were_none() -> None:
    whole = synthetic_toss()
    stamps = whole.stamps_ns + np.where(np.arange(whole.frames) < 5, 0, round(1e9 / 148.0))
    with pytest.raises(InvalidValueError, match=r"found 2 frame periods, expected 1: .*; --format lerobot has them"):
        contactnets_rows(replace(whole, stamps_ns=stamps), CUBE)


def test_real_tosses_that_were_imported_to_a_bag_come_back_but_for_their_random_heading(
    contactnets_folder: Path, tmp_path: Path
) -> None:
    """Where stamps gave the file's velocities back; the heading was thrown away on the way in and is no part of the physics."""
    bag = tmp_path / "real.mcap"
    report = import_contactnets(contactnets_folder, bag, chosen=lambda number: number < 12)
    found = [one for one in open_inputs([bag], CUBE) if isinstance(one, Toss)]
    rows = {toss.toss_id: row(toss.toss_id) for toss in found}
    job = ExportJob((bag,), ReadingConfig(CUBE), Path("m"), Manifest(RUN, tuple(rows.values())), rows)
    tosses = found_tosses(job, InputsConfig(as_stored=True)).tosses
    write_contactnets(tosses, CUBE, tmp_path)
    exported = [one for one in read_contactnets(tmp_path) if isinstance(one, Toss)]
    assert len(exported) == len(found) >= 0.8 * report.tosses
    compared = 0
    for ours, selected_toss in zip(exported, tosses):
        original = read_contactnets_toss(contactnets_folder / f"{selected_toss.origin.number}.pt")
        if original.frames != ours.frames:
            continue  # some public tosses run on after the cube lay still (method.md 1.0)
        between = quaternions.multiply(original.orientations_wxyz, quaternions.conjugate(ours.orientations_wxyz))
        heading = 2.0 * np.arctan2(between[0, 3], between[0, 0])
        turn = quaternions.exp(np.array([0.0, 0.0, heading]))
        np.testing.assert_allclose(quaternions.rotate(turn, ours.positions), original.positions, atol=1e-12)
        turned = quaternions.multiply(turn, ours.orientations_wxyz)
        assert quaternions.angle_between(turned, original.orientations_wxyz).max() < 3e-8
        off = np.abs(quaternions.rotate(turn, ours.linear_velocities) - original.linear_velocities)
        assert np.median(off) < 1e-6
        assert np.quantile(np.abs(ours.angular_velocities - original.angular_velocities), 0.95) < 1e-5
        compared += 1
    assert compared >= 8
