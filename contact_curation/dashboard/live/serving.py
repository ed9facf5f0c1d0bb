"""Opening a dashboard: a server for browsers, a file, or both, behind one recording.

The data are served by gRPC at `bind`; the viewer, which is a page and a program that run in the browser, over HTTP. Rerun 0.41
serves the viewer, files that everybody may see, on all of the machine's addresses; what is shown in it only at `bind`.
"""

import socket
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from contact_curation.dashboard.live.screen import Screen
from contact_curation.errors import InvalidValueError

APPLICATION = "contact_curation"
BLUEPRINT = ".rbl"
"""Ending of the layout's file beside a recording, for `rerun OTHER.rrd SESSION.rbl`."""

ANYWHERE = "0.0.0.0"
FLUSH_PERIOD = 0.5
"""[s] Rows wait so long for others of their entity: a viewer takes few long chunks faster than many short ones."""


@dataclass(frozen=True)
class ServingConfig:
    """Where a dashboard goes.

    Attributes:
        web_port: port of the web viewer; 0 serves nothing.
        grpc_port: port of the data that the viewer shows.
        bind: address that the data are served at.
        recording: .rrd file, overwritten; None for none.
        index: whether the recording ends with an index, which until then is held in memory and grows with the session.
        memory: memory limit of the server's history for browsers that connect later; the oldest data are dropped first.
    """

    web_port: int = 9090
    grpc_port: int = 9876
    bind: str = "127.0.0.1"
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

    @property
    def address(self) -> str:
        """What to open in a browser on this machine, or another where `bind` is an address of that network."""
        host = "127.0.0.1" if self.bind == ANYWHERE else self.bind
        return f"http://{host}:{self.web_port}/?url=rerun%2Bhttp://{host}:{self.grpc_port}/proxy"


def open_screen(config: ServingConfig, layout: rrb.Blueprint) -> Screen:
    """Opens the server, the file, or both; close them with `close_screen`.

    Raises:
        InvalidValueError: a port is in use, or the file cannot be written.
    """
    stream = rr.RecordingStream(APPLICATION, batcher_config=rr.ChunkBatcherConfig(flush_tick=FLUSH_PERIOD))
    sinks: list[rr.GrpcServerSink | rr.FileSink] = []
    if config.recording is not None:
        sinks.append(_file_sink(config.recording, config.index))
    if config.web_port:
        _check_port("web_port", ANYWHERE, config.web_port)
        _check_port("grpc_port", config.bind, config.grpc_port)
        page = f"http://{'*' if config.bind == ANYWHERE else config.bind}:{config.web_port}"
        sinks.append(
            rr.GrpcServerSink(config.bind, config.grpc_port, server_memory_limit=config.memory, cors_allow_origin=[page])
        )
        rr.serve_web_viewer(web_port=config.web_port, open_browser=False)
    stream.set_sinks(*sinks, default_blueprint=layout)
    if config.recording is not None:
        layout.save(APPLICATION, config.recording.with_suffix(BLUEPRINT))
    return Screen(stream)


def close_screen(screen: Screen) -> None:
    """Writes what is still on its way and lets go of the file and the server."""
    screen.stream.flush()
    screen.stream.disconnect()


def _file_sink(path: Path, index: bool) -> rr.FileSink:
    try:
        path.open("ab").close()
    except OSError as error:
        raise InvalidValueError("rrd", path, f"a path that can be written ({error.strerror})") from error
    return rr.FileSink(path, write_footer=index)


def _check_port(name: str, address: str, port: int) -> None:
    """Refuses a port that is taken; Rerun would report it later, on a thread of its own."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            raise InvalidValueError(name, f"{address}:{port} ({error.strerror})", "a free port of this machine") from error
