"""Opening a dashboard: a server for browsers, a file, or both, behind one recording.

The data are served by gRPC, the viewer, which is a page and a program that run in the browser, over HTTP, both at `bind`.
"""

import os
import socket
import time
from dataclasses import dataclass
from ipaddress import AddressValueError, IPv4Address
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from contact_curation.dashboard.live.recorded_file import RecordedFile
from contact_curation.dashboard.live.screen import Screen
from contact_curation.dashboard.live.web_viewer import POLL, WebViewer, listens
from contact_curation.errors import InvalidValueError
from contact_curation.files import BLUEPRINT

APPLICATION = "contact_curation"

HERE, ANYWHERE = "127.0.0.1", "0.0.0.0"
LONGEST_BIND = 5.0
"""[s]"""

FLUSH_PERIOD = 0.5
"""[s] Rows wait so long for others of their entity: a viewer takes few long chunks faster than many short ones."""


@dataclass(frozen=True)
class ServingConfig:
    """Where a dashboard goes.

    Attributes:
        web_port: port of the web viewer; 0 serves nothing.
        grpc_port: port of the data that the viewer shows.
        bind: IPv4 address of this machine that page and data are served at; 0.0.0.0 for all of them.
        recording: .rrd file, overwritten; None for none.
        index: whether the recording ends with an index, which until then is held in memory and grows with the session.
        memory: memory limit of the server's history for browsers that connect later; the oldest data are dropped first.
    """

    web_port: int = 9090
    grpc_port: int = 9876
    bind: str = HERE
    recording: Path | None = None
    index: bool = False
    memory: str = "512MiB"

    def __post_init__(self) -> None:
        if not (self.web_port or self.recording):
            raise InvalidValueError("dashboard", "neither a web_port nor a file (rrd)", "at least one of them")
        for name, least in (("web_port", 0), ("grpc_port", 1 if self.web_port else 0)):
            if not least <= getattr(self, name) < 1 << 16:
                raise InvalidValueError(name, getattr(self, name), f"a port, {least} to 65535")
        if self.web_port and self.web_port == self.grpc_port:
            raise InvalidValueError("grpc_port", self.grpc_port, "another port than web_port")
        try:
            IPv4Address(self.bind)
        except AddressValueError as error:
            expected = f"an IPv4 address of this machine, such as {HERE}, or {ANYWHERE} for all of them"
            raise InvalidValueError("bind", repr(self.bind), expected) from error

    @property
    def host(self) -> str:
        """An address that a browser on this machine reaches."""
        return HERE if self.bind == ANYWHERE else self.bind

    @property
    def data(self) -> str:
        """Where the data are served."""
        return f"rerun+http://{self.host}:{self.grpc_port}/proxy"

    @property
    def address(self) -> str:
        """What to open in a browser on this machine, or another where `bind` is an address of that network."""
        return f"http://{self.host}:{self.web_port}/?url={self.data.replace('+', '%2B')}&hide_welcome_screen"


def open_screen(config: ServingConfig, layout: rrb.Blueprint) -> Screen:
    """Opens the server, the file, or both; close them with `close_screen`.

    Raises:
        InvalidValueError: a port is in use, the address is none of this machine, or the file cannot be written.
        ContactCurationError: the page cannot be served.
    """
    stream = rr.RecordingStream(APPLICATION, batcher_config=rr.ChunkBatcherConfig(flush_tick=FLUSH_PERIOD))
    sinks: list[rr.GrpcServerSink | rr.FileSink] = []
    viewer: WebViewer | None = None
    if config.web_port:  # before a file is overwritten
        for name, port in (("web_port", config.web_port), ("grpc_port", config.grpc_port)):
            _check_port(name, config.bind, port)
    file = None if config.recording is None else RecordedFile(config.recording)
    if file is not None:
        sinks.append(rr.FileSink(file.pipe, write_footer=config.index))
    if config.web_port:
        page = f"http://{'*' if config.bind == ANYWHERE else config.bind}:{config.web_port}"
        sinks.append(
            rr.GrpcServerSink(config.bind, config.grpc_port, server_memory_limit=config.memory, cors_allow_origin=[page])
        )
        viewer = WebViewer(config.bind, config.web_port, config.data)
    stream.set_sinks(*sinks, default_blueprint=layout)
    if file is not None:
        file.opened()
    if viewer is not None and not _data_served(config.grpc_port):
        viewer.close()
        found = f"{config.bind}:{config.grpc_port} (Address already in use)"
        raise InvalidValueError("grpc_port", found, "a free port of this machine")
    if config.recording is not None:
        _save(layout, config.recording.with_suffix(BLUEPRINT))
    return Screen(stream, viewer, file)


def close_screen(screen: Screen) -> None:
    """Writes what is still on its way and lets go of the file and the servers.

    Raises:
        UnwritableOutputError: the file is not whole.
    """
    screen.stream.flush()
    screen.stream.disconnect()
    if screen.viewer is not None:
        screen.viewer.close()
    if screen.file is not None:
        screen.file.finish()


def _save(layout: rrb.Blueprint, path: Path) -> None:
    file = RecordedFile(path)
    layout.save(APPLICATION, file.pipe)
    file.opened()
    file.finish()


def _data_served(port: int) -> bool:
    """Whether this process serves data at the port soon; another one may have taken it since it was checked."""
    end = time.monotonic() + LONGEST_BIND
    while not (served := listens(os.getpid(), port)) and time.monotonic() < end:
        time.sleep(POLL)
    return served


def _check_port(name: str, address: str, port: int) -> None:
    """Refuses a port that is taken; Rerun would report it later, on a thread of its own."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            raise InvalidValueError(name, f"{address}:{port} ({error.strerror})", "a free port of this machine") from error
