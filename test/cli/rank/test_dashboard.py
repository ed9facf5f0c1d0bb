"""`rank --dashboard` and `--recording`."""

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from rerun.chunk import RrdReader

from contact_curation.contact.body import CONTACTNETS_CUBE as BODY
from contact_curation.dashboard.live.screen import number
from test.cli.commands import Cli, write_parameters
from test.dashboard.live.test_serving import free_port
from test.dashboard.recorded import Recorded

TOP = 5


def test_a_recording_shows_what_is_known_down_the_ranking(cli: Cli, golden: Path, tmp_path: Path) -> None:
    path = tmp_path / "ranking.rrd"
    outcome = cli("rank", golden, "--top", TOP, "--json", "--recording", path)
    assert outcome.status == 0
    written = Recorded(path)
    (page,) = written.texts("/ranking")
    assert f"{TOP} of 21 tosses selected" in page
    assert written.texts("/rejected")[-1].count("frames): ") == 3
    assert f"21 tosses: **{TOP} selected**, 16 not selected; 3 rejected." in written.texts("/session")[-1]
    assert len(written.scalars("/epsilon/epsilon")) == TOP
    worst = written.scalars("/known/worst")
    assert len(worst) == TOP + 1
    assert worst[-1] < 0.5 * worst[0]
    assert written.times("/scene/measured/trail", "toss") == list(range(1, TOP + 1))
    assert written.blueprints == 1
    assert len(RrdReader(path.with_suffix(".rbl")).blueprints()) == 1, "for `rerun OTHER.rrd ranking.rbl`"
    assert {one.name for one in tmp_path.iterdir()} == {"ranking.rrd", "ranking.rbl"}


def test_what_is_shown_follows_the_settings_and_the_body_of_the_parameters(cli: Cli, golden: Path, tmp_path: Path) -> None:
    scale = 2.0 * BODY.length_scale
    vertices = (BODY.vertices / scale).tolist()
    theta = write_parameters(tmp_path / "theta.json", vertices_normal=vertices, vertices_tangent=vertices, length_scale=scale)
    settings = ["--set", "ranking.prior=1", "--set", "ranking.cut=0.01"]
    path = tmp_path / "ranking.rrd"
    words = ["--params", theta, "--top", TOP, *settings, "--json", "--rrd", path]
    told = json.loads(cli("rank", golden, *words).out)
    written = Recorded(path)
    faces = written.column("/body/learned/faces", "Mesh3D:vertex_positions")[-1]
    assert np.abs(faces).max() == pytest.approx(np.abs(BODY.vertices).max())
    (page,) = written.texts("/ranking")
    shift = told["diagnostics"]["optimum_shift"]
    assert f"their estimate is {number(shift['distance'])} sigma from the full-data estimate" in page
    (tensor,) = written.column("/spectrum", "BarChart:values")[-1]
    assert np.asarray(tensor["buffer"]) == pytest.approx(told["diagnostics"]["spectrum"])


def test_a_ranking_that_fails_leaves_what_an_earlier_one_wrote(cli: Cli, golden: Path, tmp_path: Path) -> None:
    options = ["--recording", tmp_path / "ranking.rrd", "--out", tmp_path / "manifest.csv"]
    assert cli("rank", golden, "--top", TOP, "--no-figure", *options).status == 0
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert {path.suffix for path in before} >= {".csv", ".rbl", ".rrd"}
    assert cli("rank", tmp_path / "typo.mcap", "--no-figure", *options).status == 1
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_file_that_is_no_layout_of_ours_is_not_replaced_by_the_layout(cli: Cli, golden: Path, tmp_path: Path) -> None:
    (tmp_path / "ranking.rbl").write_text("mine")
    outcome = cli("rank", golden, "--rrd", tmp_path / "ranking.rrd")
    assert (outcome.status, outcome.out) == (1, "")
    expected = "expected a new name, or --overwrite to replace it"
    assert outcome.err_lines == [f"contact-curation: error: --rrd: found a file at {tmp_path / 'ranking.rbl'}, {expected}"]
    assert [path.name for path in tmp_path.iterdir()] == ["ranking.rbl"]


def test_a_taken_port_is_one_line_before_anything_is_read(cli: Cli, golden: Path) -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        outcome = cli("rank", golden, "--dashboard", "--web-port", holder.getsockname()[1])
    assert (outcome.status, outcome.out) == (1, "")
    assert len(outcome.err_lines) == 1
    assert "web_port: found" in outcome.err


def test_a_dashboard_is_served_until_ctrl_c(golden: Path) -> None:
    words = [
        "rank",
        str(golden),
        "--top",
        str(TOP),
        "--dashboard",
        "--web-port",
        str(free_port()),
        "--grpc-port",
        str(free_port()),
    ]
    command = [sys.executable, "-m", "contact_curation.cli.main", *words]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, env=os.environ) as process:
        assert process.stderr is not None
        line = next(line for line in process.stderr if "dashboard at" in line)
        address = line.split()[2]
        with urlopen(address.partition("?")[0], timeout=10.0) as answer:
            assert b"Rerun" in answer.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == 0
        assert "Traceback" not in process.stderr.read()


@pytest.mark.parametrize(("option", "value"), [("--web-port", "9191"), ("--grpc-port", "9192"), ("--bind", "0.0.0.0")])
def test_an_option_of_the_page_without_a_page_is_refused(cli: Cli, golden: Path, option: str, value: str) -> None:
    outcome = cli("rank", golden, option, value)
    assert outcome.status == 1
    assert f"{option}: found no --dashboard, expected --dashboard, which it belongs to" in outcome.err
