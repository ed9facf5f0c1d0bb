"""SROS2, as the environment asks for it: what it lacks is one line with the remedy.

Authentication and encryption are in Fast DDS, built with its security plugins: ROS from a system's packages has them, the
Python packages have not (docs/explanation/security.md).
"""

from collections.abc import Mapping
from pathlib import Path

from contact_curation.errors import InvalidValueError

ENABLE, KEYSTORE = "ROS_SECURITY_ENABLE", "ROS_SECURITY_KEYSTORE"

WITHOUT_PLUGINS = "doesn't have the security libraries"
"""In the error of a Fast DDS without its plugins."""


def check_keystore(environment: Mapping[str, str]) -> None:
    """Refuses to start a node that is to be secured without keys; rcl gives no reason in one case, and others in several lines.

    Raises:
        InvalidValueError: there is no keystore.
    """
    if environment.get(ENABLE) != "true":
        return
    keystore = environment.get(KEYSTORE, "")
    if not keystore or not Path(keystore, "enclaves").is_dir():
        found = f"no folder {Path(keystore, 'enclaves')}" if keystore else "nothing"
        raise InvalidValueError(KEYSTORE, found, f"a keystore of `ros2 security create_keystore`, because {ENABLE} is true")


def explained(error: BaseException) -> BaseException:
    """The error of a middleware that cannot be secured, as one that says what to do; any other error as it is."""
    if WITHOUT_PLUGINS not in str(error):
        return error
    expected = f"one with them: ROS 2 from your system's packages, not from Python's; or {ENABLE}=false"
    return InvalidValueError(ENABLE, "true, with a Fast DDS without its security plugins", expected)
