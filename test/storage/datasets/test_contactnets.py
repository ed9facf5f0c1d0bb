"""ContactNets' files become tosses in SI units; anything else is one line, and nothing is ever unpickled."""

import pickle
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import UnreadableInputError
from contact_curation.geometry import quaternions
from contact_curation.motion.calibration import RigCalibration
from contact_curation.motion.toss import Toss
from contact_curation.storage.datasets import contactnets
from contact_curation.storage.datasets.contactnets import (
    contactnets_files,
    read_contactnets,
    read_contactnets_toss,
    read_contactnets_tosses,
    restored_of,
)
from contact_curation.storage.inputs.records import Found, InputsConfig

FRAMES = 6


def rows(**changed: Any) -> torch.Tensor:
    """A tensor as ContactNets saves it, with columns set to other values."""
    content = torch.zeros((1, FRAMES, 19), dtype=torch.float64)
    content[0, :, :3] = torch.arange(3 * FRAMES).reshape(FRAMES, 3)
    content[0, :, 3:7] = torch.tensor(quaternions.exp([0.1, -0.4, 0.3]))
    content[0, :, 7:13] = torch.tensor([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    for column, value in changed.items():
        content[0, 2, int(column.removeprefix("c"))] = value
    return content


def saved(file: Path, content: Any) -> Path:
    torch.save(content, file)
    return file


def test_a_file_is_a_toss_in_metres_with_even_stamps(tmp_path: Path) -> None:
    toss = read_contactnets_toss(saved(tmp_path / "12.pt", rows()))
    assert (toss.toss_id, toss.body, toss.source, toss.frame_period) == ("12", "cube", "12.pt", 1.0 / 148.0)
    np.testing.assert_allclose(toss.positions[1], 0.0524 * np.array([3.0, 4.0, 5.0]))
    np.testing.assert_allclose(toss.orientations_wxyz[0], quaternions.exp([0.1, -0.4, 0.3]))
    np.testing.assert_allclose(toss.linear_velocities[0], 0.0524 * np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(toss.angular_velocities[0], [4.0, 5.0, 6.0])
    assert toss.stamps_ns.tolist() == [round(number * 1e9 / 148) for number in range(FRAMES)]


def test_a_centre_of_mass_is_in_metres_whatever_scale_corrects_the_lengths(tmp_path: Path) -> None:
    file, center = saved(tmp_path / "0.pt", rows()), np.array([0.01, 0.0, -0.02])
    body, config = (
        replace(CONTACTNETS_CUBE, center_of_mass=center),
        InputsConfig(rig=RigCalibration(scale=1.05)),
    )
    (found,) = [one for one in read_contactnets_tosses(file, body, config) if isinstance(one, Found)]
    tracked = restored_of(read_contactnets_toss(file), body).toss
    expected = 1.05 * tracked.positions + quaternions.rotate(tracked.orientations_wxyz, center)
    np.testing.assert_allclose(found.toss.positions, expected, atol=1e-12)


def test_a_folder_is_read_in_the_order_of_its_numbers_and_bad_files_are_told_in_between(tmp_path: Path) -> None:
    for number in (10, 2, 0):
        saved(tmp_path / f"{number}.pt", rows())
    (tmp_path / "1.pt").write_bytes(b"not a tensor")
    (tmp_path / "readme.txt").write_text("not read")
    found = list(read_contactnets(tmp_path))
    assert [item.toss_id if isinstance(item, Toss) else type(item).__name__ for item in found] == [
        "0",
        "UnreadableInputError",
        "2",
        "10",
    ]


def test_the_public_repository_s_data_folder_may_be_named(tmp_path: Path) -> None:
    (tmp_path / "tosses_processed").mkdir()
    saved(tmp_path / "tosses_processed" / "3.pt", rows())
    assert [file.name for file in contactnets_files(tmp_path)] == ["3.pt"]


def test_a_tensor_that_a_training_has_left_is_read_as_its_numbers(tmp_path: Path) -> None:
    kept = read_contactnets_toss(saved(tmp_path / "1.pt", rows()))
    learned = read_contactnets_toss(saved(tmp_path / "2.pt", torch.nn.Parameter(rows())))
    assert learned.positions.tolist() == kept.positions.tolist()


class Exploit:
    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return Path.touch, (Path("exploited"),)  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (
            torch.zeros((1, 5, 18), dtype=torch.float64),
            r"found torch.float64 of shape \(1, 5, 18\), expected one",
        ),
        (torch.zeros((2, 5, 19), dtype=torch.float64), r"shape \(2, 5, 19\)"),
        (torch.zeros((5, 19), dtype=torch.float64), r"shape \(5, 19\)"),
        (torch.zeros((1, 5, 19)), "found torch.float32 of shape"),
        (torch.zeros((1, 1, 19), dtype=torch.float64), r"shape \(1, 1, 19\), .* with T >= 2"),
        (torch.zeros((1, 0, 19), dtype=torch.float64), r"shape \(1, 0, 19\)"),
        ({"weights": torch.zeros(3)}, "found a dict, expected one float64 tensor"),
        (rows(c4=float("nan")), "found a value of nan, expected at most 1e\\+06"),
        (rows(c3=3.0), "quaternion norm"),
        (rows(c0=1e200), "found a value of 1e\\+200"),
        (rows(c14=1.0), "found a control that is not zero"),
        (rows()[:, :1].expand(1, 60_000_000, 19), r"found 60000000 frames in \d+ bytes, expected a tensor"),
        (Exploit(), "pickled objects are never unpickled"),
    ],
)
def test_another_content_is_refused_with_the_file_s_name_and_what_was_found(tmp_path: Path, content: Any, why: str) -> None:
    file = saved(tmp_path / "7.pt", content)
    with pytest.raises(UnreadableInputError, match=why) as caught:
        read_contactnets_toss(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


def test_code_in_a_pickle_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "7.pt"
    file.write_bytes(pickle.dumps(Exploit()))
    with pytest.raises(UnreadableInputError, match="pickled objects are never unpickled"):
        read_contactnets_toss(file)
    assert not (tmp_path / "exploited").exists()


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut off", b"\x80\x02.", b"\x00" * 100])
def test_bytes_that_are_no_tensor_are_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "7.pt"
    file.write_bytes(content)
    with pytest.raises(UnreadableInputError, match="found no plain tensor"):
        read_contactnets_toss(file)


@pytest.mark.parametrize("as_zip", [True, False])
def test_a_file_cut_anywhere_is_refused(tmp_path: Path, as_zip: bool) -> None:
    torch.save(rows(), tmp_path / "7.pt", _use_new_zipfile_serialization=as_zip)
    whole = (tmp_path / "7.pt").read_bytes()
    for length in range(0, len(whole) - 1, 37):
        (tmp_path / "8.pt").write_bytes(whole[:length])
        with pytest.raises(UnreadableInputError):
            read_contactnets_toss(tmp_path / "8.pt")


@pytest.mark.parametrize("as_zip", [True, False])
def test_a_file_with_any_byte_changed_is_read_or_refused_but_never_anything_else(tmp_path: Path, as_zip: bool) -> None:
    torch.save(rows(), tmp_path / "7.pt", _use_new_zipfile_serialization=as_zip)
    whole, rng = (tmp_path / "7.pt").read_bytes(), np.random.default_rng(4)
    refused = 0
    for _ in range(300):
        changed = bytearray(whole)
        changed[rng.integers(len(whole))] = rng.integers(256)
        (tmp_path / "8.pt").write_bytes(changed)
        try:
            assert read_contactnets_toss(tmp_path / "8.pt").frames >= 2
        except UnreadableInputError:
            refused += 1
    assert refused > 20


def test_a_small_file_that_unpacks_to_a_huge_one_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    file = tmp_path / "7.pt"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"\x00" * (contactnets.LARGEST_FILE + 1))
    assert file.stat().st_size < 100_000
    with pytest.raises(UnreadableInputError, match="bytes unpacked, expected at most"):
        read_contactnets_toss(file)


def test_no_files_are_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(UnreadableInputError, match=r"found no \.pt files, expected ContactNets' N\.pt"):
        list(read_contactnets(tmp_path))
    with pytest.raises(UnreadableInputError, match="found nothing there"):
        list(read_contactnets(tmp_path / "gone"))


def test_all_570_public_tosses_are_read(contactnets_folder: Path) -> None:
    tosses = [item for item in read_contactnets(contactnets_folder) if isinstance(item, Toss)]
    assert [toss.toss_id for toss in tosses] == [str(number) for number in range(570)]
    assert sum(toss.frames for toss in tosses) == 59_953
    resting = np.array([toss.positions[-1, 2] for toss in tosses]) / 0.0524
    assert resting.mean() == pytest.approx(0.978, abs=1e-3)
