"""A checkpoint, a manifest and a file of throws carry the body; two different bodies are one line; older files carry none."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.design.throw import throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.geometry.polytopes import box
from contact_curation.learning.checkpoints.safetensors_bytes import pack, unpack
from contact_curation.learning.checkpoints.stored_model import model_bytes
from contact_curation.pipeline.carried_body import CarriedBody, carried_body
from contact_curation.storage.manifest.file import FORMATS, read_manifest, write_manifest
from contact_curation.storage.manifest.manifest import Manifest
from contact_curation.storage.throws_file import read_throws, write_throws
from test.cli.commands import ASSUMES_THE_CUBE, Cli
from test.storage.manifest.test_manifest import RUN

BRICK = Body(
    name="brick",
    vertices=box([0.03, 0.04, 0.06]).vertices,
    mass=0.3,
    inertia=np.array([[5.2e-4, 1e-5, 0.0], [1e-5, 4.5e-4, 0.0], [0.0, 0.0, 2.5e-4]]),
    friction=0.2,
    length_scale=1.0 / 23.0,
    center_of_mass=np.array([0.1, 1.0 / 3.0, 0.0]),
)
STATE = np.array([0.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 2.0, 3.0])


def checkpoint(folder: Path, body: Body = BRICK) -> Path:
    file = folder / f"{body.name}.safetensors"
    file.write_bytes(model_bytes(PolytopeModel(ContactGeometry.of_body(body), body, Form.PHYSICAL)))
    return file


def throws_file(folder: Path, body: Body | None) -> Path:
    write_throws(folder / "throws.json", [throw_of_state("throw-0", "brick", STATE)], body)
    return folder / "throws.json"


def manifest_file(folder: Path, body: Body | None, ending: str = ".json") -> Path:
    write_manifest(Manifest(replace(RUN, body=None if body is None else body.to_mapping()), ()), folder / f"manifest{ending}")
    return folder / f"manifest{ending}"


def test_a_checkpoint_and_throws_carry_the_body_to_the_last_digit(tmp_path: Path) -> None:
    for found in (carried_body([checkpoint(tmp_path)]), carried_body(throws=throws_file(tmp_path, BRICK))):
        assert found is not None
        assert (found.body.name, found.body.first_difference(BRICK)) == ("brick", "")


@pytest.mark.parametrize("ending", list(FORMATS))
def test_a_manifest_carries_the_body_in_every_format(tmp_path: Path, ending: str) -> None:
    found = carried_body(manifest=manifest_file(tmp_path, BRICK, ending))
    assert found is not None
    assert (found.body.name, found.body.first_difference(BRICK)) == ("brick", "")


def test_older_manifests_and_throws_carry_no_body_and_older_checkpoints_one_without_offset(tmp_path: Path) -> None:
    assert carried_body(manifest=manifest_file(tmp_path, None), throws=throws_file(tmp_path, None)) is None
    document = json.loads((tmp_path / "manifest.json").read_text())
    del document["body"]
    (tmp_path / "manifest.json").write_text(json.dumps(document))
    assert read_manifest(tmp_path / "manifest.json").run.body is None
    assert "body" not in json.loads((tmp_path / "throws.json").read_text())
    assert len(read_throws(tmp_path / "throws.json")) == 1
    packed = unpack(checkpoint(tmp_path).read_bytes(), "brick")
    del packed.documents["model"]["body"]["center_of_mass"]
    (tmp_path / "old.safetensors").write_bytes(pack(packed.arrays, packed.documents))
    found = carried_body([tmp_path / "old.safetensors"])
    assert found is not None
    assert found.body.center_of_mass.tolist() == [0.0, 0.0, 0.0]


def test_two_different_bodies_are_one_line_that_names_both_files_and_the_value(tmp_path: Path) -> None:
    model, manifest = checkpoint(tmp_path), manifest_file(tmp_path, replace(BRICK, mass=0.4))
    with pytest.raises(InvalidValueError, match=r"found 'brick', not the 'brick' of .*manifest.json \(other mass\)"):
        carried_body([model], manifest)
    cube = CarriedBody(CONTACTNETS_CUBE, "--body cube.yaml")
    with pytest.raises(
        InvalidValueError, match=r"found 'cube', not the 'brick' of .* \(other vertices\), .*: leave out --body cube"
    ):
        carried_body([model], given=cube)


def test_a_body_that_is_given_and_has_the_same_numbers_wins_by_its_name(tmp_path: Path) -> None:
    found = carried_body([checkpoint(tmp_path)], given=CarriedBody(replace(BRICK, name="other"), "--body other.yaml"))
    assert found is not None
    assert found.body.name == "other"


@pytest.mark.slow
def test_simulate_takes_the_body_from_the_throws_and_design_from_the_checkpoint(cli: Cli, tmp_path: Path) -> None:
    level = replace(BRICK, center_of_mass=np.zeros(3))
    designed = cli(
        "design",
        "--checkpoint",
        checkpoint(tmp_path, level),
        "--baseline",
        "prior",
        "--throws",
        1,
        "--out",
        tmp_path / "t.json",
    )
    assert designed.status == 0, designed.err
    assert ASSUMES_THE_CUBE not in designed.err  # a busy machine adds lines of progress
    assert read_throws(tmp_path / "t.json")[0].body == "brick"
    made = cli("simulate", tmp_path / "t.json", "--out", tmp_path / "t.mcap")
    assert made.status == 0, made.err
    assert made.err == ""


def test_without_a_body_one_line_says_that_the_cube_is_assumed(cli: Cli, tmp_path: Path) -> None:
    write_throws(tmp_path / "throws.json", [throw_of_state("throw-0", "cube", STATE)])
    made = cli("simulate", tmp_path / "throws.json", "--out", tmp_path / "t.mcap", "--json")
    assert made.err_lines == [ASSUMES_THE_CUBE]
    assert made.json["tosses"] == 1


def test_what_a_file_leaves_open_needs_the_file(cli: Cli, tmp_path: Path) -> None:
    done = cli("simulate", tmp_path / "throws.json", "--out", tmp_path / "t.mcap", "--mass", 0.3)
    assert (done.status, done.err_lines) == (
        1,
        ["contact-curation: error: --mass: found no --body, expected --body FILE, which it belongs to"],
    )
