"""`rig`: the lean of a board and the length of a metre, out of recordings."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

import contact_curation as cc
from benchmarks.data.check_faults import marked, raised, simulated_session, write
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.geometry import quaternions
from contact_curation.motion.calibration import RigCalibration, apply_calibration
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.storage.bags.writer import BagWriter
from contact_curation.storage.datasets.tagslam_bag import TagslamRig, record
from test.cli.commands import Cli
from test.simulated import simulated_tosses
from test.storage.datasets.test_tagslam_bag import save_contactnets

LEAN, METRE = np.radians([1.0, 0.0, 0.0]), 0.97


@pytest.fixture(scope="module")
def crooked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve tosses as seen by a rig whose frame leans by a degree and whose metre is 3 % short."""
    tosses = simulated_tosses(12, 3)
    undo = quaternions.rotate(quaternions.exp(-LEAN), np.array([0.0, 0.0, 1.0]))
    folder, wrong = tmp_path_factory.mktemp("crooked"), RigCalibration(tuple(undo), scale=METRE)
    for number, toss in enumerate(tosses):
        save_contactnets(folder, number, apply_calibration(toss, wrong))
    return folder


@pytest.fixture(scope="module")
def leaning(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of tosses over a board that leans by 1.6 degrees, more than a gate lets pass, by a metre that is 2 % short."""
    path = tmp_path_factory.mktemp("leaning") / "leaning.mcap"
    across, up = np.sin(np.radians(1.6)), np.cos(np.radians(1.6))
    with BagWriter(path) as bag:
        record(
            bag,
            CONTACTNETS_CUBE,
            (apply_calibration(toss, RigCalibration((across, 0.0, up), scale=0.98)) for toss in simulated_tosses(12, 3)),
            TagslamRig(rules=SegmenterConfig()),
        )
    return path


def test_tilt_and_length_scale_have_intervals(cli: Cli, crooked: Path) -> None:
    done = cli("rig", crooked, "--json")
    told = done.json
    assert (told["tosses"], told["at_rest"]) == (12, 12)
    assert told["tilt_degrees"]["value"] == pytest.approx(1.0, abs=0.1)
    assert told["scale"]["value"] == pytest.approx(1.0 / METRE, rel=0.01)
    for name in ("tilt_degrees", "scale", "height_mm"):
        assert told[name]["low"] <= told[name]["value"] <= told[name]["high"]
    assert np.linalg.norm(told["normal"][:2]) == pytest.approx(np.sin(LEAN[0]), abs=2e-3)  # along which heading a file forgets


def test_people_are_told_the_same(cli: Cli, crooked: Path) -> None:
    lines = cli("rig", crooked).out.splitlines()
    assert lines[0].startswith("12 tosses: 12 come to rest")
    assert lines[1].startswith(("tilt    the board is tilted by 1.0", "tilt    the board is tilted by 0.9"))
    assert "% too short: multiply them by 1.0" in lines[2]
    assert "mm under the board" in lines[3] or "mm over the board" in lines[3]


@pytest.mark.slow
def test_what_it_says_puts_tosses_right(cli: Cli, leaning: Path, tmp_path: Path) -> None:
    told = cli("rig", leaning, "--json").json
    assert told["tilt_degrees"]["value"] == pytest.approx(1.6, abs=0.1)
    settings = told["settings"].split()
    assert cli("rig", leaning).out.splitlines()[-1].endswith(told["settings"])
    mended = cli("rig", leaning, *settings, "--json").json
    assert mended["tilt_degrees"]["value"] < 0.05
    assert mended["scale"]["value"] == pytest.approx(1.0, abs=0.003)
    assert mended["settings"] == ""
    as_recorded = cli("rank", leaning, "--top", 2, "--out", tmp_path / "as_recorded.csv")
    assert "the board is tilted by 1.60 degrees" in as_recorded.err
    ranked = cli("rank", leaning, "--top", 2, "--out", tmp_path / "apply_calibration.csv", "--json", *settings)
    assert sum(not row["rejected"] for row in ranked.json["tosses"]) >= 11
    assert "at rest" not in ranked.out


def test_of_a_board_that_was_moved_from_one_recording_to_the_next_no_settings_are_given(cli: Cli, tmp_path: Path) -> None:
    write(tmp_path / "before.mcap", simulated_session(7, 6))
    write(tmp_path / "after.mcap", raised(0.004)(simulated_session(8, 6), np.random.default_rng(0)))
    told = cli("rig", tmp_path / "before.mcap", tmp_path / "after.mcap", "--json").json
    assert any("after.mcap) bodies lie 4.0 mm " in line for line in told["warnings"])
    assert (told["settings"], told["correction_needed"]) == ("", True)


@pytest.mark.slow
def test_other_commands_say_that_a_model_learned_from_tosses_calibrated_otherwise(
    cli: Cli, golden: Path, tmp_path: Path
) -> None:
    settings = ["--set", "rig.scale=1.00500"]
    learned = cc.train(cc.read(golden, config={"rig.scale": 1.005}), steps=1, protocol="budgeted")
    learned.save(tmp_path / "cube.safetensors")
    start, out = ["--params", tmp_path / "cube.safetensors"], tmp_path / "out"
    commands = (
        ["rank", golden, *start, "--top", "2"],
        ["train", golden, *start, "--protocol", "budgeted", "--steps", "1", "--out", out / "a.safetensors"],
        ["design", *start, "--known", golden, "--throws", "1", "--baseline", "prior", "--out", out / "a.json"],
    )
    out.mkdir()
    line = "cube.safetensors: it learned from tosses calibrated by --set rig.normal=0.00000,0.00000,1.00000"
    for words in (*commands, ["score", golden, *start, "--out", out / "a.npz"]):
        assert line in cli(*words, "--json").err, words
    for words in commands[:2]:
        done = cli(*words, *settings, "--overwrite")
        assert (done.status, line in done.err) == (0, False), done.err
    assert [one for one in cc.score(cc.read(golden), model=learned).warnings if "and those here are as recorded" in one]


@pytest.mark.slow
def test_a_model_of_tosses_corrected_is_judged_by_such(cli: Cli, golden: Path, tmp_path: Path) -> None:
    settings, checkpoint = "--set rig.scale=1.00500", tmp_path / "cube.safetensors"
    trained = cli("train", golden, *settings.split(), "--protocol", "exact", "--held-out", "0.3", "--out", checkpoint)
    assert trained.status == 0
    assert trained.out.endswith(f"{settings}\n")  # the next command reads alike
    assert "corrected" not in cli("evaluate", checkpoint, golden, *settings.split()).err
    warned = cli("evaluate", checkpoint, golden).err
    assert "it learned from tosses calibrated by --set rig.normal=0.00000,0.00000,1.00000" in warned
    assert "and those here are as recorded" in warned


def test_a_rig_that_the_gates_would_keep_back_is_told_all_the_same(cli: Cli, golden: Path) -> None:
    done = cli("rig", golden, "--json")
    assert done.status == 0
    assert done.json["tilt_degrees"]["value"] < 0.05
    assert done.json["scale"]["value"] == pytest.approx(1.0, abs=0.005)
    assert (done.json["correction_needed"], done.json["settings"]) == (False, "")
    assert "no correction needed" in cli("rig", golden).out.splitlines()[-1]


def test_no_setting_hides_that_the_body_has_another_size(cli: Cli, golden: Path, tmp_path: Path) -> None:
    large = tmp_path / "large.yaml"
    cc.write_body(large, replace(CONTACTNETS_CUBE, vertices=1.1 * CONTACTNETS_CUBE.vertices))
    done = cli("rig", golden, "--body", large, "--json")
    assert (done.json["correction_needed"], done.json["settings"]) == (True, "")
    assert "the body is 9 % smaller than cube as described" in done.json["warnings"][0]


@pytest.mark.slow
@pytest.mark.parametrize("millimetres", [10.0, -80.0])
def test_a_height_that_loses_every_toss_is_found_and_corrected(cli: Cli, tmp_path: Path, millimetres: float) -> None:
    bag = tmp_path / "a.mcap"
    write(bag, raised(1e-3 * millimetres)(simulated_session(tosses=9), np.random.default_rng(0)))
    assert cli("rank", bag, "--top", 2).status == 1
    told = cli("rig", bag, "--json").json
    assert told["height_mm"]["value"] == pytest.approx(millimetres, abs=0.3)
    assert told["height_mm"]["low"] < millimetres < told["height_mm"]["high"]
    assert told["settings"].startswith("--set rig.height=")
    ranked = cli("rank", bag, "--top", 2, "--json", *told["settings"].split())
    assert ranked.json["outcomes"]["selected"] + ranked.json["outcomes"]["not selected"] == 8


@pytest.mark.slow
@pytest.mark.parametrize("beside", [(0.0, 0.0, 0.0), (0.003, -0.004, 0.002)])
def test_the_marker_s_offset_is_what_the_described_centre_of_mass_leaves(
    cli: Cli, tmp_path: Path, beside: tuple[float, float, float]
) -> None:
    """The tracked frame sits in a corner of the body, which its file says, or says wrongly by some millimetres."""
    described = np.array([0.008, 0.005, -0.006])
    body = replace(CONTACTNETS_CUBE, center_of_mass=described)
    (tmp_path / "cube.yaml").write_text(yaml.safe_dump(body.to_mapping()))
    bag, true = tmp_path / "a.mcap", described + beside
    write(bag, marked(offset=-true)(simulated_session(tosses=20), np.random.default_rng(0)))
    told = cli("rig", bag, "--body", tmp_path / "cube.yaml", "--json").json
    assert [one["value"] for one in told["marker"]["offset_mm"]] == pytest.approx([1e3 * one for one in beside], abs=0.3)
    assert told["scale"]["low"] <= 1.0 <= told["scale"]["high"]
    assert ("marker_offset" in told["settings"]) == any(beside)
    mended = cli("rig", bag, "--body", tmp_path / "cube.yaml", *told["settings"].split(), "--json").json
    assert mended["correction_needed"] is False


@pytest.mark.slow
def test_a_centre_of_mass_that_is_not_where_it_is_described_is_found_by_free_flights(cli: Cli, tmp_path: Path) -> None:
    """The shape is described where it is, the centre of mass 15 mm beside."""
    off = CONTACTNETS_CUBE.about([0.01, -0.005, 0.01])
    (tmp_path / "cube.yaml").write_text(yaml.safe_dump(off.to_mapping()))
    bag = tmp_path / "a.mcap"
    write(bag, simulated_session(tosses=20))
    told = cli("rig", bag, "--body", tmp_path / "cube.yaml", "--json").json
    assert [one["value"] for one in told["mass_centre"]["offset_mm"]] == pytest.approx([-10.0, 5.0, -10.0], abs=0.3)
    assert told["correction_needed"]
    option = told["mass_centre"]["option"]
    assert told["settings"] == option, "as check has it"
    checked = cli("check", bag, "--body", tmp_path / "cube.yaml", "--json")
    assert re.search(r"turn about a point 15\.\d mm from the described centre of mass", checked.json["verdict"])
    assert option in checked.json["next"]
    corrected = cli("check", bag, "--body", tmp_path / "cube.yaml", option, "--json")
    assert (corrected.status, corrected.json["ok"]) == (0, True)
    assert cli("rig", bag, "--body", tmp_path / "cube.yaml", option, "--json").json["mass_centre"]["option"] == ""


def test_too_few_tosses_are_one_line(cli: Cli, folder: Path) -> None:
    done = cli("rig", folder)
    assert done.status == 1
    assert "throws that fall freely: found 6, expected at least 8" in done.err


def test_a_toss_that_comes_twice_counts_once(cli: Cli, crooked: Path) -> None:
    done = cli("rig", crooked, crooked, "--json")
    assert done.json["tosses"] == 12
    assert done.json["warnings"] == ["12 series of poses are in the inputs twice: each counts once"]
