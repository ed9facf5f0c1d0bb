"""What ends a node is one line and status 1, also where it is the machine that fails."""

import errno
import os

import pytest
import rclpy

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.ros import node_main
from contact_curation.nodes.ros.node_main import refuse


def test_a_disk_that_is_full_is_one_line_and_no_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    assert refuse("curator", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/data/buffer.json")) == 1
    assert capsys.readouterr().err == (
        "curator: /data/buffer.json: found No space left on device, expected to read and write there\n"
    )


def test_a_log_that_cannot_be_written_is_one_line_and_no_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(**_: object) -> None:
        raise RuntimeError("Failed opening file /log/python.log for writing: Read-only file system")

    monkeypatch.setattr(rclpy, "init", refused)
    with pytest.raises(InvalidValueError, match=r"^log of ROS: found Failed opening file .*, expected .* set ROS_LOG_DIR$"):
        node_main._begin_ros()
