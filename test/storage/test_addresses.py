"""Recordings on servers: the same tosses as on a disk, in few requests, and of a large bag no more than the poses."""

import sys
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from pickle import dumps, loads
from threading import Thread

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.tosses import input_paths
from contact_curation.storage.addresses import Address, coalesced
from contact_curation.storage.bags.file import file_sha256
from contact_curation.storage.bags.reader import BagReader
from contact_curation.storage.inputs.inputs import Problem, open_inputs
from test.cli.commands import Cli
from test.storage.inputs.test_inputs import mcap_file
from test.storage.object_server import ObjectServer, object_server

# Not importorskip, by which every process of the tests would import both.
pytestmark = pytest.mark.skipif(not (find_spec("s3fs") and find_spec("moto")), reason="pip install s3fs moto[server]")


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ObjectServer]:
    with object_server(monkeypatch) as running:
        yield running


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """A recording of two tosses."""
    return mcap_file(tmp_path)


def digests(*paths: Path) -> list[str]:
    """Of all motions, in their order."""
    items = list(open_inputs(paths, CONTACTNETS_CUBE))
    assert not [item for item in items if isinstance(item, Problem)]
    return [(item.toss if isinstance(item, Rejected) else item).digest() for item in items if not isinstance(item, Problem)]


def with_camera(bag: Path, target: Path, chunk: int = 1 << 16) -> int:
    """The bag with pictures between its poses; returns the bytes of the chunks that hold poses."""
    noise = np.random.default_rng(0).bytes(chunk)
    with BagReader(bag) as reader, target.open("wb") as file:
        writer = Writer(file, chunk_size=chunk, compression=CompressionType.NONE)
        writer.start()
        topics: dict[str, int] = {}
        for name, values in reader.notes.items():
            writer.add_metadata(name, values)
        camera = writer.register_channel("/camera", "cdr", writer.register_schema("any/msg/Any", "ros2msg", b"uint8[] data"))
        for number, sent in enumerate(reader.raw_messages()):
            if sent.topic not in topics:
                schema = writer.register_schema(sent.type, sent.schema_encoding, sent.schema.encode())
                topics[sent.topic] = writer.register_channel(sent.topic, "cdr", schema)
            writer.add_message(topics[sent.topic], sent.log_time_ns, sent.data, sent.log_time_ns)
            if number % 1000 == 999:
                for _ in range(80):
                    writer.add_message(camera, sent.log_time_ns, noise, sent.log_time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    with target.open("rb") as file:
        from mcap.reader import make_reader

        summary = make_reader(file).get_summary()
        assert summary is not None
        return sum(one.chunk_length for one in summary.chunk_indexes if set(one.message_index_offsets) - {camera})


def test_a_bag_in_a_bucket_gives_the_tosses_of_the_file(server: ObjectServer, session: Path) -> None:
    assert digests(*input_paths(server.put(session, "session.mcap"))) == digests(session)


def test_of_a_large_bag_little_more_than_the_poses_comes_and_in_few_requests(
    server: ObjectServer, golden: Path, tmp_path: Path
) -> None:
    poses = with_camera(golden, tmp_path / "large.mcap")
    size = (tmp_path / "large.mcap").stat().st_size
    address = server.put(tmp_path / "large.mcap", "bags/large.mcap")
    assert digests(*input_paths(address)) == digests(golden)
    asked = server.of("bags/large.mcap")
    assert len(asked) <= 6, asked
    assert sum(given for _, _, given in asked) <= 1.3 * poses < size / 4


def test_a_pattern_is_listed_once_and_its_bags_are_not_asked_about_again(server: ObjectServer, session: Path) -> None:
    for name in ("b", "a", "c"):
        server.put(session, f"day/{name}.mcap")
    found = input_paths("s3://lab/day/[ab]*.mcap")
    assert [str(one) for one in found] == ["s3://lab/day/a.mcap", "s3://lab/day/b.mcap"]
    assert len(server.asked) <= 2
    server.asked.clear()
    assert digests(loads(dumps(found[0]))) == digests(session)
    assert "HEAD" not in {method for method, _, _ in server.asked}


def test_what_was_added_replaced_or_removed_since_the_last_call_is_seen(server: ObjectServer, session: Path) -> None:
    """fsspec remembers listings as long as the process lives, as in a notebook."""
    first = server.put(session, "grown/a.mcap")
    (before,) = input_paths("s3://lab/grown/*.mcap")
    session.write_bytes(session.read_bytes()[:-1])
    server.put(session, "grown/a.mcap")
    server.put(session, "grown/b.mcap")
    (alone,) = input_paths(first)
    assert alone.stat().st_size == session.stat().st_size
    after = input_paths("s3://lab/grown/*.mcap")
    assert [one.name for one in after] == ["a.mcap", "b.mcap"]
    assert {file_sha256(one) for one in (alone, *after)} == {file_sha256(alone)} != {file_sha256(before)}


def test_what_cannot_be_reached_is_a_line_and_the_others_are_read(server: ObjectServer, session: Path) -> None:
    there = server.put(session, "session.mcap")
    items = list(open_inputs(input_paths(["s3://lab/gone.mcap", "s3://other/gone.mcap", there]), CONTACTNETS_CUBE))
    lines = [str(item) for item in items if isinstance(item, Problem)]
    assert lines[0] == "s3://lab/gone.mcap: found nothing there, expected a recording"
    assert lines[1].startswith("s3://other/gone.mcap: ")
    assert len(lines) == 2
    assert sum(isinstance(item, Toss) for item in items) == sum(
        isinstance(item, Toss) for item in open_inputs([session], CONTACTNETS_CUBE)
    )


def test_a_bag_without_an_index_is_read_as_a_whole(server: ObjectServer, session: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(session.read_bytes()[: session.stat().st_size * 3 // 4])
    on_disk, in_bucket = (
        [(item.what if isinstance(item, Problem) else str(item)) for item in open_inputs([path], CONTACTNETS_CUBE)]
        for path in (cut, *input_paths(server.put(cut, "cut.mcap")))
    )
    assert len(on_disk) == len(in_bucket) > 1


def partly_in_chunks(bag: Path, target: Path, loose: range) -> Path:
    """The bag with the messages of these numbers outside chunks, which MCAP allows."""
    with BagReader(bag) as reader, target.open("wb") as file:
        writer = Writer(file, chunk_size=20_000)
        writer.start()
        chunks, channels = vars(writer)["_Writer__chunk_builder"], {}
        for number, sent in enumerate(reader.raw_messages()):
            writer._Writer__finalize_chunk()  # type: ignore[attr-defined]
            vars(writer)["_Writer__chunk_builder"] = None if number in loose else chunks
            if sent.topic not in channels:
                schema = writer.register_schema(sent.type, sent.schema_encoding, sent.schema.encode())
                channels[sent.topic] = writer.register_channel(sent.topic, "cdr", schema)
            writer.add_message(channels[sent.topic], sent.log_time_ns, sent.data, sent.log_time_ns)
        vars(writer)["_Writer__chunk_builder"] = chunks
        writer.finish()  # type: ignore[no-untyped-call]
    return target


@pytest.mark.slow
@pytest.mark.parametrize("loose", [range(100, 200), range(200, 10**6)], ids=["between chunks", "behind chunks"])
def test_messages_outside_chunks_are_read_too(server: ObjectServer, session: Path, tmp_path: Path, loose: range) -> None:
    mixed = partly_in_chunks(session, tmp_path / "mixed.mcap", loose)
    assert digests(*input_paths(server.put(mixed, "mixed.mcap"))) == digests(session)


def test_messages_before_the_first_chunk_are_missed_and_said(server: ObjectServer, session: Path, tmp_path: Path) -> None:
    mixed = partly_in_chunks(session, tmp_path / "mixed.mcap", range(100))
    with BagReader(input_paths(server.put(mixed, "mixed.mcap"))[0]) as reader, BagReader(session) as whole:
        read, counted = (sum(1 for _ in one.raw_messages()) for one in (reader, whole))
        assert reader.losses == (f"mixed.mcap: its index counts {counted} messages, its chunks hold {read}",)
        assert read == counted - 100


def test_a_damaged_chunk_is_lost_and_said(server: ObjectServer, golden: Path, tmp_path: Path) -> None:
    data = bytearray(golden.read_bytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "damaged.mcap").write_bytes(data)
    with BagReader(input_paths(server.put(tmp_path / "damaged.mcap", "damaged.mcap"))[0]) as reader:
        read = sum(1 for _ in reader.raw_messages())
    with BagReader(tmp_path / "damaged.mcap") as local:
        assert read == sum(1 for _ in local.raw_messages())
    assert len(reader.losses) == len(local.losses) == 1


def test_a_folder_in_a_bucket_is_a_bag(server: ObjectServer, session: Path) -> None:
    server.put(session, "session/session_0.mcap")
    assert digests(*input_paths("s3://lab/session")) == digests(session)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_web_servers_and_file_addresses_are_read_too(session: Path) -> None:
    assert input_paths(session.as_uri()) == (session,)
    handler = partial(SimpleHTTPRequestHandler, directory=str(session.parent))  # knows no ranges
    handler.log_message = lambda *_: None  # type: ignore[attr-defined]
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        Thread(target=http.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{http.server_port}/{session.name}"
        assert digests(*input_paths(address)) == digests(session)
        http.shutdown()


def test_what_is_missing_is_said_with_the_remedy(monkeypatch: pytest.MonkeyPatch, cli: Cli) -> None:
    monkeypatch.setitem(sys.modules, "fsspec", None)
    outcome = cli("rank", "s3://lab/*.mcap")
    assert outcome.status == 1
    assert "pip install 'contact-curation[cloud]'" in outcome.err_lines[-1]


def test_ranges_are_joined_where_little_comes_that_nobody_wants() -> None:
    assert coalesced([(100, 200), (0, 100), (210, 1000)]) == [(0, 1000)]
    assert coalesced([(0, 100), (5000, 5100)]) == [(0, 100), (5000, 5100)]
    assert coalesced([]) == []


def test_an_address_is_a_path_that_keeps_its_name() -> None:
    address = Address("s3://lab/day/session.mcap")
    assert (str(address), address.name, str(address.parent / "x")) == (
        "s3://lab/day/session.mcap",
        "session.mcap",
        "s3://lab/day/x",
    )
    assert str(loads(dumps(address))) == str(address)
