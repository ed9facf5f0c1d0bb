"""What ends a node is one line and status 1, also where it is the machine that fails."""

import errno
import os

import pytest

from contact_curation.nodes.ros.node_main import refuse


def test_a_disk_that_is_full_is_one_line_and_no_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    assert refuse("curator", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/data/buffer.json")) == 1
    assert capsys.readouterr().err == (
        "curator: /data/buffer.json: found No space left on device, expected to read and write there\n"
    )
