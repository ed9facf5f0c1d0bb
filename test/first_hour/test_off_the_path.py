"""Off the path of a new user at fifty places: each is answered with one line that says what was found and what to do.

A row is a place: a command, the exit status, and what its answer must hold. The answer of `check` is its verdict, the first
line of what it prints; that of every other command is the one line of its standard error.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array
from test.cli.commands import Cli
from test.first_hour.recordings import BOARD, SLED, SLED_URDF, WEDGE, session, wedge_yaml, write_stamped

pytestmark = pytest.mark.slow

BODY, SLED_BODY = "--body wedge.yaml", "--body sled.urdf --friction 0.25"
POSES = "--topic /mocap/wedge/pose --board-frame table"
OWN = f"{BODY} {POSES}"

CHECKS = (
    ("poses in millimetres", f"check mm.mcap {OWN}", r"millimetres\? expected metres .*: publish poses in metres"),
    ("z down", f"check down.mcap {OWN}", r"accelerate upwards .* is the board frame z-down\?"),
    ("wxyz in place of xyzw", f"check swapped.mcap {OWN}", r"wxyz where xyzw is expected\? publish .* as x, y, z, w"),
    ("no transform", f"check nowhere.mcap {BODY}", r"nothing leads to the board 'body_surface'.* say --board-frame ''"),
    ("no frame", f"check unframed.mcap {OWN}", r"without a header.frame_id .* say --board-frame ''"),
    (
        "nothing moves",
        f"check still.mcap {OWN}",
        r"the object never moved .* record while it is thrown, and check that --topic",
    ),
    ("another body", f"check wedge.mcap {SLED_BODY} {POSES}", r"off every face of sled .* right --body"),
)

PLACES = (
    ("no such recording", 1, f"rank nothing.mcap {BODY}", r"nothing\.mcap: .*No such file"),
    ("a misspelt recording", 1, f"rank wegde.mcap {BODY}", r"No such file .*; did you mean wedge\.mcap\?"),
    ("no such folder", 1, f"rank bags/wedge.mcap {BODY}", r"No such file .*; there is no folder bags"),
    ("an empty folder", 1, f"rank empty {BODY}",
     r"empty: is a folder without storage files; expected .mcap or .db3 files"),
    ("not a recording", 1, f"rank garbage.mcap {BODY}", r"garbage\.mcap: begins with .*; expected an MCAP file"),
    ("millimetres", 1, f"rank mm.mcap {OWN}", r"fall at 981\d per s\^2: millimetres\? .*publish poses in metres"),
    ("z down", 1, f"rank down.mcap {OWN}", r"accelerate upwards .*is the board frame z-down\?"),
    ("wrong order of quaternions", 1, f"rank swapped.mcap {OWN}", r"wxyz where xyzw is expected\? publish"),
    ("nothing moves", 1, f"rank still.mcap {OWN}",
     r"the object never moved \(largest speed 0.00 m/s in 600 poses\): record while"),
    ("nothing moves on the rig", 1, f"rig still.mcap {OWN}",
     r"the object never moved \(largest speed 0.00 m/s in 600 poses\): record while"),
    ("no such topic", 1, f"rank wedge.mcap {BODY} --topic /mocap/wegde/pose", r"did you mean /mocap/wedge/pose\?"),
    ("no such board", 1, f"rank wedge.mcap {BODY} --board-frame tabel", r"frame 'tabel'.* frames there: .*mocap, table"),
    ("no board said", 1, f"rank wedge.mcap {BODY}",
     r"'body_surface'.* frames there: .*mocap, table: .*say --board-frame ''"),
    ("no such body", 1, f"rank wedge.mcap --body wegde.yaml {POSES}",
     r"wegde\.yaml: .*No such file .*; did you mean wedge\.yaml\?"),
    ("grams", 1, f"rank wedge.mcap --body grams.yaml {POSES}", r"mass: found 216 kg .* is it in grams \(0\.216 kg\)\?"),
    ("a body in mm", 1, "body mm.yaml", r"a body 100 m wide .* expected metres: are they in mm\?"),
    ("a misspelt key", 1, "body misspelt.yaml", r"unknown key 'vertexes': did you mean 'vertices'\?"),
    ("a missing key", 1, "body massless.yaml", r"missing key: mass \(e\.g\. "),
    ("friction 30", 1, "body rough.yaml", r"friction: found 30, expected a coefficient, .* degrees .* or percent"),
    ("inertia in kg mm^2", 1, "body heavy.yaml", r"expected kg m\^2: is it in kg mm\^2\?"),
    ("a length scale in mm", 1, "body long.yaml",
     r"length_scale: found 45 m for a body 0\.1 m wide, .* in mm \(0\.045 m\)\?"),
    ("not YAML", 1, "body broken.yaml", r"broken\.yaml: found no YAML .* expected the description of a body"),
    ("a URDF without a shape", 1, "body bare.urdf", r"bare\.urdf: found no link with a <collision>"),
    ("a misspelt verb", 2, "rnak wedge.mcap", r"unknown rnak: did you mean rank\?"),
    ("a misspelt option", 2, f"rank wedge.mcap {OWN} --critereon trace",
     r"unknown option --critereon: did you mean --criterion\?"),
    ("a misspelt criterion", 2, f"rank wedge.mcap {OWN} --criterion traces", r"unknown traces: did you mean trace\?"),
    ("a misspelt model", 2, f"train wedge.mcap {OWN} --model polytop --out new.st",
     r"unknown polytop: did you mean polytope\?"),
    ("a misspelt field", 1, f"rank wedge.mcap {OWN} --set gates.dpth=0.01",
     r"--set gates\.dpth: did you mean gates\.depth\?"),
    ("a word for a number", 1, f"rank wedge.mcap {OWN} --set gates.depth=deep",
     r"--set: found gates\.depth=deep, expected .* float"),
    ("none selected", 2, f"rank wedge.mcap {OWN} --top 0", r"--top: found 0, expected a whole number from 1 to "),
    ("no input", 2, "rank", r"required: INPUT \(usage: contact-curation rank --help\)"),
    ("an unknown ending", 2, f"rank wedge.mcap {OWN} --out ranked.xls",
     r"ranked\.xls, expected a name ending in \.parquet or \.csv"),
    ("a file for a folder", 1, f"rank wedge.mcap {OWN} --out wedge.yaml/ranked.csv", r"wedge\.yaml"),
    ("no such parameters", 1, f"rank wedge.mcap {OWN} --params theta.json",
     r"theta\.json: cannot be read: No such file"),
    ("held out of range", 1, f"rank wedge.mcap {OWN} --held-out 100-200",
     r"found numbers 100-200, expected some of the 6 .* 0 to 5"),
    ("held out of training", 1, f"train wedge.mcap {OWN} --held-out 100-200 --out new.safetensors",
     r"expected some of the 6 "),
    ("the manifest of another body", 1, f"train sled.mcap {SLED_BODY} --manifest ranked.csv --out new.safetensors",
     r"found 'sled', not the 'wedge' of ranked\.csv"),
    ("the manifest of another bag", 1, f"train again.mcap {POSES} --manifest ranked.csv --out new.safetensors",
     r"ranked\.csv.*wedge\.mcap"),
    ("an output that is there", 1, f"train wedge.mcap {OWN} --out there.safetensors",
     r"there\.safetensors, expected .*--overwrite"),
    ("no such model", 1, f"evaluate nothing.safetensors wedge.mcap {POSES}",
     r"nothing\.safetensors: cannot be read: No such file"),
    ("no model at all", 1, f"evaluate ranked.csv wedge.mcap {POSES}",
     r"ranked\.csv: is not JSON .* or a checkpoint, a \.safetensors file"),
    ("no parameters to score at", 2, f"score wedge.mcap {OWN} --out scores.npz", r"required: -p/--params"),
    ("an unknown format", 2, "export wedge.mcap --manifest ranked.csv --format hdf5 --out there",
     r"unknown hdf5: expected one of .*mcap"),
    ("no throws", 1, "simulate throws.json --out throws.mcap", r"throws\.json: cannot be read: No such file"),
    ("no place for throws", 2, "design --throws 2", r"required: -o/--out"),
    ("no ContactNets", 1, "import contactnets empty --out new.mcap",
     r"empty: found no \.pt files, expected ContactNets' N\.pt"),
    ("no parameters of nodes", 1, "online --throws 1 --params-file wedge.yaml",
     r"wedge\.yaml: expected ros__parameters under the name of each node"),
)  # fmt: skip


def written(folder: Path) -> None:
    """The recordings and descriptions that the places are about."""
    poses, six = session(WEDGE, 2), session(WEDGE, 6, seed=3)
    half_turn = np.array([0.0, 1.0, 0.0, 0.0])

    def turned(orientations: Array) -> Array:
        return np.asarray(quaternions.multiply(np.tile(half_turn, (len(orientations), 1)), orientations))

    below = np.concatenate([quaternions.rotate(half_turn, poses[:, :3]), turned(poses[:, 3:])], axis=1)
    in_mm = np.array([1e3] * 3 + [1.0] * 4)
    write_stamped(folder / "wedge.mcap", six, "wedge")
    write_stamped(folder / "again.mcap", session(WEDGE, 3, seed=4), "wedge", first_s=1_710_000_000)
    write_stamped(folder / "mm.mcap", poses * in_mm, "wedge", board=BOARD * in_mm)
    write_stamped(folder / "down.mcap", below, "wedge")
    swapped = np.concatenate([six[:, :3], np.roll(six[:, 3:], 1, axis=1)], axis=1)
    write_stamped(folder / "swapped.mcap", swapped, "wedge", board=None, frame="table")
    write_stamped(folder / "nowhere.mcap", poses, "wedge", board=None)
    write_stamped(folder / "unframed.mcap", poses, "wedge", board=None, frame="")
    write_stamped(folder / "still.mcap", np.tile(poses[:1], (600, 1)), "wedge")
    (folder / "garbage.mcap").write_bytes(b"nothing" * 1000)
    (folder / "empty").mkdir()
    body = WEDGE.body
    descriptions = {
        "wedge": wedge_yaml(),
        "grams": wedge_yaml(mass=1e3 * body.mass),
        "mm": wedge_yaml(vertices=(1e3 * body.vertices).tolist()),
        "misspelt": wedge_yaml().replace("vertices", "vertexes"),
        "massless": wedge_yaml(mass=None),
        "rough": wedge_yaml(friction=30),
        "heavy": wedge_yaml(inertia=(1e6 * body.inertia).tolist()),
        "long": wedge_yaml(length_scale=45),
        "broken": "{name: [",
    }
    for name, text in descriptions.items():
        (folder / f"{name}.yaml").write_text(text)
    (folder / "bare.urdf").write_text('<robot name="bare"><link name="bare"/></robot>')
    (folder / "sled.urdf").write_text(SLED_URDF.format(mass=SLED.body.mass, moments=np.diag(SLED.body.inertia)))
    (folder / "there.safetensors").write_bytes(b"something")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("off_the_path")
    written(folder)
    return folder


@pytest.fixture
def said(place: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], tuple[int, str, str]]:
    """Runs a command in the folder."""
    monkeypatch.chdir(place)
    if not (place / "ranked.csv").exists():
        assert cli("rank", "wedge.mcap", *OWN.split(), "--out", "ranked.csv", "--top", "3").status == 0

    def run(command: str) -> tuple[int, str, str]:
        status, out, err = cli(*command.split())
        assert "Traceback" not in out + err
        return status, out, err

    return run


@pytest.mark.parametrize(("command", "expected"), [one[1:] for one in CHECKS], ids=[one[0] for one in CHECKS])
def test_check_names_the_fault_in_its_first_line(
    said: Callable[[str], tuple[int, str, str]], command: str, expected: str
) -> None:
    status, out, _ = said(command)
    assert status == 1
    assert re.search(expected, out.splitlines()[0]), out
    assert "\nnext: contact-curation " in out


@pytest.mark.parametrize(("status", "command", "expected"), [one[1:] for one in PLACES], ids=[one[0] for one in PLACES])
def test_every_other_command_answers_with_one_line_that_helps(
    said: Callable[[str], tuple[int, str, str]], status: int, command: str, expected: str
) -> None:
    found, _, err = said(command)
    assert found == status, err
    assert len(err.splitlines()) == 1, err
    assert re.match(r"contact-curation( \w+)?: error: ", err), err
    assert re.search(expected, err), err
