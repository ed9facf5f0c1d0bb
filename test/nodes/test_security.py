"""A node that is to be secured by SROS2 and cannot be is one line that says what to do."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.nodes.ros.security import check_keystore
from contact_curation.session.free_domain import free_domain


def started(folder: Path, **security: str) -> tuple[int, str]:
    """Exit status and error output of a curator that is started so."""
    with free_domain() as domain:
        done = subprocess.run(
            [
                sys.executable,
                "-P",
                "-m",
                "contact_curation.nodes.curator",
                "--ros-args",
                "-p",
                f"store:={folder}/buffer.sqlite",
            ],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_SECURITY_ENABLE": "true", **security},
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            timeout=120.0,
        )
    return done.returncode, done.stderr


def test_without_a_keystore_one_line_names_the_command_that_makes_one(tmp_path: Path) -> None:
    status, said = started(tmp_path, ROS_SECURITY_KEYSTORE="", ROS_SECURITY_STRATEGY="Enforce")
    assert (status, said.count("\n")) == (1, 1)
    assert "ROS_SECURITY_KEYSTORE: found nothing, expected a keystore of `ros2 security create_keystore`" in said


def test_a_middleware_without_security_plugins_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "enclaves").mkdir()
    status, said = started(tmp_path, ROS_SECURITY_KEYSTORE=str(tmp_path), ROS_SECURITY_STRATEGY="Permissive")
    lines = [line for line in said.splitlines() if "[rcl]" not in line]
    assert (status, len(lines)) == (1, 1), said
    assert "ROS_SECURITY_ENABLE: found true, with a Fast DDS without its security plugins, expected one with them" in lines[0]


def test_a_keystore_that_is_none_is_refused_and_nothing_is_asked_for_where_security_is_off(tmp_path: Path) -> None:
    with pytest.raises(InvalidValueError, match=f"found no folder {tmp_path}/enclaves"):
        check_keystore({"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_KEYSTORE": str(tmp_path)})
    check_keystore({"ROS_SECURITY_KEYSTORE": "nowhere"})
    check_keystore({"ROS_SECURITY_ENABLE": "false"})
