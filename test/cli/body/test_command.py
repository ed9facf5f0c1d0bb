"""`body`: what was understood, as lines, as JSON and as a picture."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from contact_curation.contact.body import Body
from test.cli.commands import Cli
from test.contact.test_body_formats import corners_mm, stl_text

CUBE_FILE = Path(__file__).resolve().parents[3] / "contact_curation" / "config" / "cube.yaml"
LINK = """<robot name="ell"><link name="l"><collision><geometry><box size="0.04 0.04 0.16"/></geometry></collision>
<collision><origin xyz="0.06 0 -0.06"/><geometry><box size="0.08 0.04 0.04"/></geometry></collision></link></robot>"""


def test_json_has_the_body_in_si_units_and_nothing_else_is_printed(cli: Cli) -> None:
    done = cli("body", CUBE_FILE, "--json")
    assert (done.status, done.err) == (0, "")
    body = Body.from_file(CUBE_FILE)
    assert done.json["vertices"] == body.vertices.tolist()
    assert done.json["inertia"] == body.inertia.tolist()
    assert (done.json["mass"], done.json["length_scale"], done.json["warnings"]) == (0.37, 0.0524, [])
    assert (done.json["name"], done.json["friction"], done.json["approximation_mm"]) == ("cube", 0.18, 0.0)


def test_a_urdf_is_told_with_its_centre_of_mass_and_what_was_assumed_and_drawn(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "ell.urdf").write_text(LINK)
    done = cli("body", tmp_path / "ell.urdf", "--density", 700, "--out", tmp_path / "ell.png")
    assert done.status == 0, done.err
    assert "shape         10 vertices, 120 x 40 x 160 mm" in done.out
    assert "centre of mass: at (20, 0, -20) mm in the file's frame" in done.out
    assert "warning: friction: none given, 0.5 assumed: give --friction" in done.out
    assert (tmp_path / "ell.png").read_bytes().startswith(b"\x89PNG")


def test_normals_that_are_no_numbers_are_not_needed_and_print_nothing(tmp_path: Path) -> None:
    mesh = tmp_path / "brick.stl"
    mesh.write_text(stl_text(corners_mm()).replace("normal 0 0 0", "normal -1.#IND -1.#IND -1.#IND"))
    command = [sys.executable, "-m", "contact_curation.cli.main", "body", str(mesh), "--mesh-scale", "0.001"]
    done = subprocess.run([*command, "--mass", "0.3", "--friction", "0.2"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "shape         8 vertices, 60 x 80 x 120 mm" in done.stdout


def test_the_picture_shows_the_edges_of_the_hull_and_both_origins(tmp_path: Path) -> None:
    from contact_curation.dashboard.figures.body import BodyPicture, body_figure

    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-2, 2) for z in (-3, 3)]) / 100.0
    figure = body_figure(BodyPicture("brick", corners, np.array([0.01, 0.0, 0.0]), 0.3, np.eye(3)))
    whole, *views = figure.axes
    assert len(whole.lines) == 12  # edges of a box, without the diagonals of its triangles
    assert len(views) == 3
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "vertices, which touch the board",
        "centre of mass",
        "origin of the tracked frame",
    ]


def test_a_mistake_ends_with_one_line(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "body.yaml").write_text(CUBE_FILE.read_text().replace("half_extents", "half_extent"))
    done = cli("body", tmp_path / "body.yaml")
    assert done.status == 1
    assert done.err_lines == [
        f"contact-curation: error: {tmp_path}/body.yaml: unknown key 'half_extent': did you mean 'half_extents'?"
    ]
