"""Builds the messages for the Python that runs this.

python msg_defs/install.py                    installs them into its environment
python msg_defs/install.py --wheels FOLDER    leaves wheels in a folder

contact_curation_msgs is always installed, a vendored package only where nobody else has installed it: the original is never
shadowed. As wheels, all of them are built; pip takes what is asked for.
"""

import argparse
import importlib.util
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

HERE = Path(__file__).resolve().parent
VENDORED = "contact_curation_vendored_"


def main() -> None:
    """Install what is missing or ours, or build wheels of all."""
    parser = argparse.ArgumentParser(description="Builds contact_curation_msgs and the vendored messages.")
    parser.add_argument("--wheels", metavar="FOLDER", help="build wheels into this folder, and install nothing")
    wheels = parser.parse_args().wheels
    vendored = sorted((HERE / "vendored").iterdir())
    folders = [HERE, *(path for path in vendored if wheels or is_ours_to_build(path.name))]
    task = ["wheel", "--wheel-dir", wheels] if wheels else ["install", "--force-reinstall"]
    options = ["--no-build-isolation", "--no-deps", "--quiet", "--disable-pip-version-check"]
    done = subprocess.run([sys.executable, "-m", "pip", *task, *options, *map(str, folders)], check=False)
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
