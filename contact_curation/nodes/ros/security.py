"""Checks what SROS2 needs when the environment enables it; what is missing gives one line with the remedy.

Authentication and encryption need a Fast DDS with its security plugins. ROS 2 from system packages has them, the Python
packages do not (docs/explanation/security.md).
"""

from collections.abc import Mapping
from pathlib import Path

from contact_curation.errors import InvalidValueError

ENABLE, KEYSTORE = "ROS_SECURITY_ENABLE", "ROS_SECURITY_KEYSTORE"

WITHOUT_PLUGINS = "doesn't have the security libraries"
"""Part of the error message of a Fast DDS without its security plugins."""


def check_keystore(environment: Mapping[str, str]) -> None:
    """Refuses to start a secured node without keys, in one line; rcl prints several lines, and in one case no reason.

    Raises:
        InvalidValueError: security is enabled and there is no keystore.
    """
    if environment.get(ENABLE) != "true":
        return
    keystore = environment.get(KEYSTORE, "")
    if not keystore or not Path(keystore, "enclaves").is_dir():
        found = f"no folder {Path(keystore, 'enclaves')}" if keystore else "nothing"
        raise InvalidValueError(KEYSTORE, found, f"a keystore of `ros2 security create_keystore`, because {ENABLE} is true")


def explained(error: BaseException) -> BaseException:
    """Replaces the error of a middleware without security plugins by one with the remedy; returns other errors unchanged."""
    if WITHOUT_PLUGINS not in str(error):
        return error
    expected = f"one with them: ROS 2 from your system's packages, not from Python's; or {ENABLE}=false"
    return InvalidValueError(ENABLE, "true, with a Fast DDS without its security plugins", expected)
