"""A dashboard is served at one address, or written to a file, or both; what cannot be is one line."""

import errno
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.request import urlopen

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.dashboard.live import serving
from contact_curation.dashboard.live.layout import live_layout, ranking_layout
from contact_curation.dashboard.live.screen import Moment
from contact_curation.dashboard.live.serving import HERE, ServingConfig, close_screen, open_screen
from contact_curation.dashboard.live.web_viewer import WebViewer
from contact_curation.dashboard.live.web_viewer import listens as listens_in
from contact_curation.errors import ContactCurationError, InvalidValueError
from test.dashboard.recorded import Recorded
from test.listeners import beyond_loopback, family, listeners_of

OTHER = "127.0.0.2"
"""Of this machine, and no address that anything is served at unasked."""


def free_port() -> int:
    """A port that nobody uses now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        yield int(holder.getsockname()[1])


def test_the_page_is_served_while_the_file_is_written(tmp_path: Path) -> None:
    path = tmp_path / "both.rrd"
    config = ServingConfig(free_port(), free_port(), recording=path)
    screen = open_screen(config, live_layout(CONTACTNETS_CUBE))
    page, _, query = config.address.partition("?")
    with urlopen(page, timeout=10.0) as answer:
        assert b"Rerun" in answer.read()
    assert query == f"url=rerun%2Bhttp://127.0.0.1:{config.grpc_port}/proxy&hide_welcome_screen"
    with socket.create_connection(("127.0.0.1", config.grpc_port), timeout=10.0):
        pass
    found = {one for one in listeners_of([os.getpid()]) if one.port in (config.web_port, config.grpc_port)}
    assert {one.port for one in found} == {config.web_port, config.grpc_port}
    assert not beyond_loopback(found)
    screen.at(Moment(1, 5))
    screen.text("page", "hello")
    close_screen(screen)
    written = Recorded(path)
    assert written.texts("/page") == ["hello"]
    assert written.blueprints == 1
    assert not [one for one in listeners_of([os.getpid()]) if one.port in (config.web_port, config.grpc_port)]


def test_page_and_data_are_served_at_the_address_that_is_asked_for() -> None:
    config = ServingConfig(free_port(), free_port(), bind=OTHER)
    screen = open_screen(config, live_layout(CONTACTNETS_CUBE))
    with urlopen(config.address.partition("?")[0], timeout=10.0) as answer:
        assert answer.status == 200
    found = {one for one in listeners_of([os.getpid()]) if one.port in (config.web_port, config.grpc_port)}
    assert {str(one.address) for one in found} == {OTHER}
    close_screen(screen)


HOLDER = """
import sys, time
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.dashboard.live.layout import live_layout
from contact_curation.dashboard.live.serving import ServingConfig, open_screen
screen = open_screen(ServingConfig(int(sys.argv[1]), int(sys.argv[2])), live_layout(CONTACTNETS_CUBE))
print("served", flush=True)
time.sleep(60.0)
"""


def listens(port: str) -> bool:
    """Whether anyone answers at a port; a process that ends may hold it until its last thread has ended."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", int(port))) != errno.ECONNREFUSED


def test_the_page_ends_with_a_process_that_is_killed() -> None:
    ports = [str(free_port()), str(free_port())]
    with subprocess.Popen([sys.executable, "-c", HOLDER, *ports], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "served\n"
        assert len(set(family(holder.pid)) - {holder.pid}) == 1
        assert all(listens(port) for port in ports)
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    end = time.monotonic() + 20.0
    while any(listens(port) for port in ports):
        assert time.monotonic() < end
        time.sleep(0.05)


def test_of_two_that_start_at_one_port_at_the_same_moment_one_serves_the_page() -> None:
    port = free_port()

    def serve(_: int) -> WebViewer | ContactCurationError:
        try:
            return WebViewer(HERE, port, "rerun+http://127.0.0.1:1/proxy")
        except ContactCurationError as error:
            return error

    with ThreadPoolExecutor(2) as threads:  # a page ends with the thread that started it
        outcomes = list(threads.map(serve, range(2)))
        (viewer,) = (one for one in outcomes if isinstance(one, WebViewer))
        (refusal,) = (one for one in outcomes if not isinstance(one, WebViewer))
        assert str(refusal) == f"rerun --serve-web: found status 1, expected a page at 127.0.0.1:{port}"
        assert viewer.serves
        viewer.close()
        assert not viewer.serves


def test_a_port_for_data_that_another_takes_at_the_same_moment_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    ports = [str(free_port()), str(free_port())]
    with subprocess.Popen([sys.executable, "-c", HOLDER, *ports], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "served\n"
        monkeypatch.setattr(serving, "_check_port", lambda *_: None)  # it was free then
        monkeypatch.setattr(serving, "LONGEST_BIND", 0.2)
        config = ServingConfig(free_port(), int(ports[1]))
        with pytest.raises(InvalidValueError, match=rf"grpc_port: found .*:{ports[1]} \(Address already in use\), expected a"):
            open_screen(config, ranking_layout(CONTACTNETS_CUBE))
        assert not listens(str(config.web_port))
        holder.kill()


@pytest.mark.parametrize("bind", ["localhost", "", "::1", "0"])
def test_an_address_that_is_none_is_refused(bind: str) -> None:
    with pytest.raises(InvalidValueError, match=rf"bind: found '{bind}', expected an IPv4 address of this machine"):
        ServingConfig(bind=bind)


def test_an_address_of_another_machine_is_one_line() -> None:
    config = ServingConfig(free_port(), free_port(), bind="203.0.113.1")
    with pytest.raises(InvalidValueError, match=r"web_port: found 203\.0\.113\.1:\d+ \(Cannot assign requested address\)"):
        open_screen(config, ranking_layout(CONTACTNETS_CUBE))


@pytest.mark.parametrize("name", ["web_port", "grpc_port"])
def test_a_port_that_is_taken_is_one_line(taken_port: int, name: str) -> None:
    ports = {"web_port": free_port(), "grpc_port": free_port(), name: taken_port}
    config = ServingConfig(ports["web_port"], ports["grpc_port"])
    with pytest.raises(InvalidValueError, match=rf"{name}: found .*:{taken_port} \(Address already in use\), expected a free"):
        open_screen(config, ranking_layout(CONTACTNETS_CUBE))


def test_a_dashboard_that_cannot_begin_leaves_the_recording_of_another_as_it_is(taken_port: int, tmp_path: Path) -> None:
    path = tmp_path / "session.rrd"
    screen = open_screen(ServingConfig(0, recording=path), live_layout(CONTACTNETS_CUBE))
    with pytest.raises(InvalidValueError, match=r"rrd: found .*session\.rrd, expected a file that no other"):
        open_screen(ServingConfig(0, recording=path), live_layout(CONTACTNETS_CUBE))
    close_screen(screen)
    written = path.read_bytes()
    assert len(written) > 0
    with pytest.raises(InvalidValueError, match="web_port"):
        open_screen(ServingConfig(taken_port, free_port(), recording=path), live_layout(CONTACTNETS_CUBE))
    assert path.read_bytes() == written


def test_a_file_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=r"rrd: found .*nowhere"):
        open_screen(ServingConfig(0, recording=tmp_path / "nowhere" / "a.rrd"), live_layout(CONTACTNETS_CUBE))


def test_a_server_is_seen_where_a_lower_descriptor_is_free() -> None:
    free, kept = os.pipe()
    with socket.socket() as server:
        server.bind((HERE, 0))
        server.listen()
        os.close(free)  # as standard input that is closed
        assert listens_in(os.getpid(), server.getsockname()[1])
    os.close(kept)


FULL = """
import resource, sys
from pathlib import Path
from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.dashboard.live.layout import live_layout
from contact_curation.dashboard.live.serving import ServingConfig, close_screen, open_screen
room = int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
try:
    screen = open_screen(ServingConfig(0, recording=Path(sys.argv[1])), live_layout(CONTACTNETS_CUBE))
    for number in range(100):
        screen.text(f"page/{number}", "hello" * 1000)
    close_screen(screen)
except Exception as error:
    print(type(error).__name__, error)
"""


@pytest.mark.parametrize(("room", "ending"), [(1000, ".rbl"), (200_000, ".rrd")])
def test_a_disk_that_is_full_is_one_line_and_does_not_hang(room: int, ending: str, tmp_path: Path) -> None:
    path = tmp_path / "full.rrd"
    done = subprocess.run([sys.executable, "-c", FULL, str(path), str(room)], capture_output=True, text=True, timeout=120)
    found = f"output: found {path.with_suffix(ending)}, expected a path that can be written (File too large)"
    assert done.stdout == f"UnwritableOutputError {found}\n"
    assert done.returncode == 0


def test_a_dashboard_that_goes_nowhere_or_to_one_port_twice_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="neither a web_port nor a file"):
        ServingConfig(0)
    with pytest.raises(InvalidValueError, match="grpc_port: found 0, expected a port, 1 to 65535"):
        ServingConfig(grpc_port=0)
    with pytest.raises(InvalidValueError, match="grpc_port: found 9090, expected another port"):
        ServingConfig(9090, 9090)
    with pytest.raises(InvalidValueError, match="web_port: found 70000"):
        ServingConfig(70000)
