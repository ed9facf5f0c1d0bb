"""`body` of a checkpoint: what a polytope learned, as lines, as JSON and as files; a network has nothing to show."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE, Body
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.impulse_noise import ImpulseNoise
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form, form_of_geometry
from contact_curation.errors import InvalidValueError
from contact_curation.storage.checkpoint_file import save_model
from test.cli.commands import Cli
from test.contact.model_cases import model_of

CUBE = replace(CONTACTNETS_CUBE, center_of_mass=np.array([0.001, 0.002, -0.005]))
SHIFTS = 0.02 * np.random.default_rng(3).standard_normal((8, 3))
TRUE = ContactGeometry.of_body(CUBE)
LEARNED = replace(
    TRUE,
    vertices_normal=TRUE.vertices_normal + SHIFTS,
    vertices_tangent=TRUE.vertices_normal + SHIFTS,
    tangents=0.23 * np.eye(2, 3),
)
"""What the tests' checkpoint learned."""


def checkpoint_of(path: Path, geometry: ContactGeometry) -> Path:
    save_model(path, PolytopeModel(geometry, CUBE, form_of_geometry(geometry)))
    return path


@pytest.fixture
def checkpoint(tmp_path: Path) -> Path:
    return checkpoint_of(tmp_path / "cube.safetensors", LEARNED)


def test_the_learned_object_is_shown_with_what_is_as_described(cli: Cli, checkpoint: Path) -> None:
    done = cli("body", checkpoint)
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines()[0] == f"{checkpoint}: cube"
    assert "friction      0.23\n" in done.out
    assert done.out.endswith("note: learned: vertices, friction; as described: all else\n")
    found = cli("body", checkpoint, "--json").json
    np.testing.assert_allclose(found["vertices"], CUBE.length_scale * LEARNED.vertices_normal, atol=1e-15)
    assert found["friction"] == pytest.approx(0.23)
    assert (found["mass"], found["length_scale"], found["restitution"]) == (CUBE.mass, CUBE.length_scale, None)
    assert found["center_of_mass"] == CUBE.center_of_mass.tolist()


@pytest.mark.parametrize("ending", [".xml", ".urdf", ".yaml"])
def test_the_next_command_reads_the_learned_object_from_its_file(
    ending: str, cli: Cli, checkpoint: Path, tmp_path: Path
) -> None:
    path = tmp_path / f"learned{ending}"
    done = cli("body", checkpoint, "--out", path)
    assert (done.status, done.err) == (0, "")
    told = dict(line.split(": ", 1) for line in done.out.splitlines()[1:] if line.startswith(("object", "next")))
    assert told["object"].split()[0] == str(path)
    again = cli(*told["next"].split()[1:], "--json").json
    learned = cc.load_model(checkpoint).learned_body()
    found = Body.from_mapping({name: again[name] for name in learned.to_mapping()})
    np.testing.assert_allclose(np.sort(found.vertices, axis=0), np.sort(learned.vertices, axis=0), atol=1e-9)
    assert found.first_difference(replace(learned, vertices=found.vertices)) == ""


def test_a_learned_restitution_is_shown_and_said_to_be_in_no_file(cli: Cli, tmp_path: Path) -> None:
    bouncing = replace(LEARNED, restitution=0.35, noise=ImpulseNoise())
    done = cli("body", checkpoint_of(tmp_path / "ball.safetensors", bouncing), "--out", tmp_path / "ball.xml")
    assert "restitution   0.35" in done.out
    assert "note: learned: vertices, friction, restitution; as described: all else" in done.out
    assert "note: restitution 0.35 is not in the file: the format has none" in done.out
    assert cc.load_model(tmp_path / "ball.safetensors").restitution == pytest.approx(0.35)


def test_friction_at_vertices_of_its_own_is_a_note(cli: Cli, tmp_path: Path) -> None:
    apart = replace(LEARNED, vertices_tangent=TRUE.vertices_normal)
    done = cli("body", checkpoint_of(tmp_path / "a.safetensors", apart))
    assert "note: friction was learned at vertices of its own: those of the gaps are shown" in done.out


def test_a_network_is_one_line(cli: Cli, tmp_path: Path) -> None:
    save_model(tmp_path / "deep.safetensors", model_of("deep", Form.PHYSICAL))
    line = f"{tmp_path}/deep.safetensors: found a network (deep), which has no vertices, expected a polytope for its shape"
    done = cli("body", tmp_path / "deep.safetensors", "--out", tmp_path / "deep.xml")
    assert (done.status, done.out, done.err_lines) == (1, "", [f"contact-curation: error: {line}"])
    assert not (tmp_path / "deep.xml").exists()
    with pytest.raises(InvalidValueError, match="found a network"):
        cc.load_model(tmp_path / "deep.safetensors").learned_body()


def test_a_shape_that_no_body_has_is_one_line(cli: Cli, tmp_path: Path) -> None:
    away = LEARNED.vertices_normal + np.array([3.0, 0.0, 0.0])
    path = checkpoint_of(tmp_path / "a.safetensors", replace(LEARNED, vertices_normal=away, vertices_tangent=away))
    done = cli("body", path, "--out", tmp_path / "a.yaml")
    assert done.status == 1
    assert done.err.startswith(
        f"contact-curation: error: {path}: vertices: found the centre of mass, their origin, lies outside"
    )
    assert not (tmp_path / "a.yaml").exists()


def test_values_of_options_are_refused_beside_a_checkpoint(cli: Cli, checkpoint: Path) -> None:
    done = cli("body", checkpoint, "--friction", 0.5)
    assert done.err_lines == [
        "contact-curation: error: --friction: found 0.5, expected none beside a checkpoint, which has its body"
    ]


def test_an_edited_object_and_a_foreign_mesh_are_replaced_only_with_overwrite(
    cli: Cli, checkpoint: Path, tmp_path: Path
) -> None:
    urdf, mesh = tmp_path / "a.urdf", tmp_path / "a.obj"
    mesh.write_text("v 0 0 0\n")
    done = cli("body", checkpoint, "--out", urdf)
    assert done.err_lines == [
        f"contact-curation: error: --out: found a file at {mesh}, expected a new name, or --overwrite to replace it"
    ]
    assert (mesh.read_text(), urdf.exists()) == ("v 0 0 0\n", False)
    assert cli("body", checkpoint, "--out", urdf, "--overwrite").status == 0
    assert cli("body", checkpoint, "--out", urdf).status == 0  # as it was written
    urdf.write_text(urdf.read_text().replace('name="cube"', 'name="die"'))
    assert cli("body", checkpoint, "--out", urdf).status == 1
