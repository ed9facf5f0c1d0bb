"""Builds and installs the messages into the environment of the Python that runs this.

contact_curation_msgs always; a vendored package only where nobody else has installed it: the original is never shadowed.
"""

import importlib.util
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

HERE = Path(__file__).resolve().parent
VENDORED = "contact_curation_vendored_"


def main() -> None:
    """Install what is missing or ours."""
    folders = [HERE, *(path for path in sorted((HERE / "vendored").iterdir()) if is_ours_to_build(path.name))]
    options = ["--no-build-isolation", "--no-deps", "--force-reinstall", "--quiet", "--disable-pip-version-check"]
    done = subprocess.run([sys.executable, "-m", "pip", "install", *options, *map(str, folders)], check=False)
    sys.exit(done.returncode)


def is_ours_to_build(package: str) -> bool:
    """Whether a vendored package is absent, or present because this script installed it."""
    if importlib.util.find_spec(package) is None:
        return True
    try:
        distribution(VENDORED + package)
    except PackageNotFoundError:
        return False
    return True


if __name__ == "__main__":
    main()
