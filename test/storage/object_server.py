"""An S3 server on loopback that counts what is asked of it: moto's, in a thread."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

BUCKET = "lab"


@dataclass
class ObjectServer:
    """What was asked: method, path and bytes given, by request."""

    endpoint: str
    app: Any
    asked: list[tuple[str, str, int]] = field(default_factory=list)

    def put(self, path: Path, key: str) -> str:
        """Stores a file; returns its address."""
        import boto3

        boto3.client("s3").upload_file(str(path), BUCKET, key)
        self.asked.clear()
        return f"s3://{BUCKET}/{key}"

    def of(self, key: str) -> list[tuple[str, str, int]]:
        """What was asked of an object."""
        return [one for one in self.asked if one[1].endswith(f"/{key}")]

    def __call__(self, environ: Any, start: Any) -> Any:
        """The application, counted."""
        given = b"".join(self.app(environ, start))
        self.asked.append((environ["REQUEST_METHOD"], environ["PATH_INFO"], len(given)))
        return [given]


@contextmanager
def object_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ObjectServer]:
    """A server with one bucket, whose address and credentials stand in the environment, as a user's would."""
    import boto3
    from moto.server import DomainDispatcherApplication, create_backend_app
    from s3fs import S3FileSystem
    from werkzeug.serving import make_server

    server = ObjectServer("", DomainDispatcherApplication(create_backend_app))
    http = make_server("127.0.0.1", 0, server, threaded=True)
    server.endpoint = f"http://127.0.0.1:{http.server_port}"
    thread = threading.Thread(target=http.serve_forever, daemon=True)
    thread.start()
    for name, value in {
        "AWS_ENDPOINT_URL": server.endpoint,
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_EC2_METADATA_DISABLED": "true",
    }.items():
        monkeypatch.setenv(name, value)
    S3FileSystem.clear_instance_cache()
    boto3.setup_default_session()
    boto3.client("s3").create_bucket(Bucket=BUCKET)
    try:
        yield server
    finally:
        http.shutdown()
        thread.join()
        http.server_close()
        S3FileSystem.clear_instance_cache()
