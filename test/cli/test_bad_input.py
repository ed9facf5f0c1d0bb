"""Bad input ends in one clear line, and good data beside it is still ranked."""

import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from rosbags.typesys import Stores, get_typestore

from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.bags.writer import BagWriter
from test.cli.commands import Cli, write_parameters

BRICK = """
name: brick
half_extents: [0.0524, 0.0524, 0.0524]
mass: 0.37
inertia: [0.00081, 0.00081, 0.00081]
friction: 0.18
length_scale: 0.0524
"""

ODOMETRY = "/tagslam/odom/body_cube"


def copied(golden: Path, bag: Path, topics: tuple[str, ...] | None, spoilt: Callable[[object], None] | None = None) -> Path:
    """Some topics of the golden bag, each message of them spoilt."""
    with BagReader(golden) as reader, BagWriter(bag) as writer:
        for message in reader.messages(topics):
            if spoilt is not None and message.topic == ODOMETRY:
                spoilt(message.message)
            writer.write(message.topic, message.message, message.log_time_ns, latched=message.topic == "/tf_static")
    return bag


def nan_poses(message: object) -> None:
    message.pose.pose.position.x = float("nan")  # type: ignore[attr-defined]


def thousandfold(message: object) -> None:
    position = message.pose.pose.position  # type: ignore[attr-defined]
    position.x, position.y, position.z = 1e3 * position.x, 1e3 * position.y, 1e3 * position.z


class Malice:
    """What a pickle may do when it is read."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return exec, ("raise SystemExit('executed')",)


def empty_folder(folder: Path, golden: Path) -> Path:
    (folder / "empty").mkdir()
    return folder / "empty"


def other_tensors(folder: Path, golden: Path) -> Path:
    own = folder / "weights"
    own.mkdir()
    torch.save(torch.zeros(3, 4), own / "0.pt")
    torch.save({"layer.weight": torch.zeros(2)}, own / "1.pt")
    return own


def pickled(folder: Path, golden: Path) -> Path:
    path = folder / "0.pt"
    path.write_bytes(pickle.dumps(Malice()))
    return path


def pickle_in_a_torch_file(folder: Path, golden: Path) -> Path:
    path = folder / "0.pt"
    torch.save({"toss": Malice()}, path)
    return path


def without_poses(folder: Path, golden: Path) -> Path:
    path = folder / "words.mcap"
    with BagWriter(path) as writer:
        words = get_typestore(Stores.ROS2_JAZZY).types["std_msgs/msg/String"](data="no pose")
        for stamp_ns in range(3):
            writer.write("/chatter", words, stamp_ns)
    return path


def frames_only(folder: Path, golden: Path) -> Path:
    return copied(golden, folder / "frames.mcap", ("/tf_static",))


def with_nan(folder: Path, golden: Path) -> Path:
    return copied(golden, folder / "nan.mcap", None, nan_poses)


def no_bag(folder: Path, golden: Path) -> Path:
    path = folder / "text.mcap"
    path.write_text("this is no bag")
    return path


def cut_in_its_head(folder: Path, golden: Path) -> Path:
    path = folder / "head.mcap"
    path.write_bytes(golden.read_bytes()[:100])
    return path


def in_millimetres(folder: Path, golden: Path) -> Path:
    return copied(golden, folder / "mm.mcap", None, thousandfold)


def folders_in_a_folder(folder: Path, golden: Path) -> Path:
    path = folder / "recordings"
    (path / "run").mkdir(parents=True)
    (path / "run" / "run.mcap").write_bytes(golden.read_bytes())
    return path


def missing(folder: Path, golden: Path) -> Path:
    return folder / "missing.mcap"


def missing_folder(folder: Path, golden: Path) -> Path:
    return folder / "missing"


BAD = [
    (empty_folder, "empty"),
    (other_tensors, "none of them a toss"),
    (pickled, "pickled objects are never unpickled"),
    (pickle_in_a_torch_file, "pickled objects are never unpickled"),
    (without_poses, "found /chatter (std_msgs/msg/String); expected one topic with poses of cube"),
    (frames_only, "found no toss in 0 poses of /tf_static"),
    (with_nan, "expected finite numbers"),
    (cut_in_its_head, "cut short at byte"),
    (in_millimetres, "in metres"),
    (folders_in_a_folder, "expected .mcap or .db3 files directly in it, or .pt files of ContactNets' tosses"),
    (no_bag, "text.mcap"),
    (missing, "missing.mcap"),
    (missing_folder, "missing"),
]
bad_inputs = pytest.mark.parametrize(("make", "says"), BAD, ids=[make.__name__ for make, _ in BAD])
Make = Callable[[Path, Path], Path]


@bad_inputs
@pytest.mark.parametrize("verb", ["rank", "score"])
def test_alone_it_is_an_error_that_says_why(cli: Cli, golden: Path, tmp_path: Path, make: Make, says: str, verb: str) -> None:
    path = make(tmp_path, golden)
    parameters = write_parameters(tmp_path / "true.json")
    options = ("--params", parameters, "--out", tmp_path / "s.npz") if verb == "score" else ()
    done = cli(verb, path, *options)
    assert done.status == 1
    assert done.out == ""
    assert says in done.err_lines[-1]
    assert done.err_lines[-1].startswith(f"contact-curation: error: {path}")
    assert len(done.err_lines) == 1
    assert not (tmp_path / "s.npz").exists()


def test_good_data_beside_all_of_it_is_still_ranked(cli: Cli, golden: Path, tmp_path: Path) -> None:
    paths = []
    for make, _ in BAD:
        own = tmp_path / make.__name__
        own.mkdir()
        paths.append(make(own, golden))
    done = cli("rank", *paths, golden, "--jobs", "1", "--json")
    assert done.status == 0
    assert done.json["outcomes"]["selected"] == 21
    for path, (_, says) in zip(paths, BAD, strict=True):
        assert [line for line in done.json["warnings"] if line.startswith(str(path)) and says in line]
    clean = cli("rank", golden, "--json").json
    assert [row["score"] for row in done.json["tosses"][:21]] == [row["score"] for row in clean["tosses"][:21]]


def test_a_bad_input_in_a_worker_process_stops_nobody(cli: Cli, golden: Path, tmp_path: Path) -> None:
    done = cli("rank", no_bag(tmp_path, golden), golden, missing(tmp_path, golden), "--jobs", "3", "--json")
    assert (done.status, len(done.json["warnings"]), done.json["outcomes"]["selected"]) == (0, 2, 21)


@pytest.mark.parametrize("verb", ["rank", "score"])
def test_a_topic_that_is_not_there_lists_those_that_are(cli: Cli, golden: Path, tmp_path: Path, verb: str) -> None:
    options = ("--params", write_parameters(tmp_path / "t.json"), "--out", tmp_path / "s.npz") if verb == "score" else ()
    done = cli(verb, golden, "--topic", "/nowhere", *options)
    assert done.status == 1
    assert "/nowhere" in done.err_lines[0]
    assert ODOMETRY in done.err_lines[0]


def test_a_board_frame_that_is_not_there_is_said(cli: Cli, golden: Path) -> None:
    done = cli("rank", golden, "--board-frame", "table")
    assert done.status == 1
    assert "'table'" in done.err
    assert done.err_lines[-1].startswith("contact-curation: error: ")


@pytest.mark.parametrize("content", ["", "[]", '{"normal": 1}', "no json"])
@pytest.mark.parametrize("verb", ["rank", "score"])
def test_unreadable_parameters_are_one_line_before_anything_is_read(
    cli: Cli, golden: Path, tmp_path: Path, content: str, verb: str
) -> None:
    path = tmp_path / "params.json"
    path.write_text(content)
    options = ("--out", tmp_path / "s.npz") if verb == "score" else ()
    done = cli(verb, golden, "--params", path, *options)
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert done.err.startswith(f"contact-curation: error: {path}")


def test_an_unreadable_body_is_one_line(cli: Cli, golden: Path, tmp_path: Path) -> None:
    done = cli("rank", golden, "--body", tmp_path / "none.yaml")
    assert (done.status, len(done.err_lines)) == (1, 1)


@pytest.mark.parametrize("option", ["--out", "--figure"])
def test_an_output_that_cannot_be_written_is_one_line(cli: Cli, golden: Path, tmp_path: Path, option: str) -> None:
    path = tmp_path / "missing" / ("m.csv" if option == "--out" else "f.png")
    done = cli("rank", golden, option, path)
    assert done.status == 1
    assert done.err_lines[-1].startswith("contact-curation: error: ")
    assert str(path) in done.err_lines[-1]


def test_a_map_of_tags_that_is_not_there_is_said_once_and_not_of_every_input(cli: Cli, golden: Path, tmp_path: Path) -> None:
    done = cli("rank", golden, golden, "--tag-map", tmp_path / "tags.yaml")
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert done.err.startswith(f"contact-curation: error: {tmp_path / 'tags.yaml'}: cannot be read")


def test_a_recording_of_another_body_is_ranked_with_a_warning_that_names_its_topic(
    cli: Cli, golden: Path, tmp_path: Path
) -> None:
    body = tmp_path / "brick.yaml"
    body.write_text(BRICK)
    warned = cli("rank", golden, "--body", body, "--json")
    assert warned.status == 0
    assert warned.err_lines == [f"contact-curation: warning: {line}" for line in warned.json["warnings"]]
    assert warned.json["warnings"][0] == (
        f"{golden}: found no topic named after brick, expected one, or a name for it: took {ODOMETRY}"
    )
    for named in (("--topic", ODOMETRY), ("--body-frame", "body_cube")):
        assert cli("rank", golden, "--body", body, *named, "--json").json["warnings"] == []


@pytest.mark.parametrize("verb", ["rank", "score", "evaluate"])
def test_a_recording_in_the_place_of_a_checkpoint_is_one_line_that_says_what_is_accepted(
    cli: Cli, golden: Path, tmp_path: Path, verb: str
) -> None:
    words = {
        "rank": (golden, "--params", golden),
        "score": (golden, "--params", golden, "--out", tmp_path / "s.npz"),
        "evaluate": (golden, golden),
    }
    done = cli(verb, *words[verb])
    assert (done.status, done.out, len(done.err_lines)) == (1, "", 1)
    assert done.err.startswith(f"contact-curation: error: {golden}: is not JSON (it is no text), expected a JSON object with")
    assert done.err.endswith("or a checkpoint, a .safetensors file\n")


def test_everything_gated_is_an_error_that_says_by_what_and_the_manifest_lists_it(
    cli: Cli, golden: Path, tmp_path: Path
) -> None:
    out = tmp_path / "m.json"
    done = cli("rank", golden, "--set", "gates.depth=1e-9", "--out", out)
    assert done.status == 1
    assert "depth in the board" in done.err_lines[-1]
    assert out.exists()
    assert np.all([line.count('"rejected": true') for line in out.read_text().splitlines() if '"toss_id"' in line])


@pytest.mark.parametrize(("words", "said"), [(("rank", ""), "inputs"), (("play", ""), "BAG"), (("body", ""), "file")])
def test_no_word_is_no_path_though_python_takes_it_for_the_current_folder(cli: Cli, words: tuple[str, ...], said: str) -> None:
    done = cli(*words)
    assert (done.status > 0, done.out, len(done.err_lines)) == (True, "", 1)
    assert "found ''" in done.err
    assert said.lower() in done.err.lower()


def test_an_input_whose_name_is_too_long_leaves_the_others_to_be_ranked(cli: Cli, golden: Path) -> None:
    done = cli("rank", f"{'a' * 300}.mcap", golden, "--top", 2, "--no-figure")
    assert done.status == 0
    assert sum("File name too long" in line for line in done.err_lines) == 1
    assert "24 tosses of 2 inputs: 21 ranked" in done.out


def test_a_single_recording_that_cannot_be_read_is_named(cli: Cli, tmp_path: Path) -> None:
    done = cli("check", tmp_path / "nope.mcap")
    assert done.status == 1
    assert done.out.startswith("cannot be read: nope.mcap: cannot be opened: No such file")
