"""Makes the picture of the dashboard that the documents show, by a session with the simulated arm.

    python -m test.browser.screenshot docs/images/dashboard.png [--throws N] [--rate R]

The session is that of `make demo`, in which one throw is spoilt and rejected; nobody learns from the tosses of
bags/golden.mcap, which judge the model.
"""

import argparse
import io
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from contact_curation.cli.demo import BUDGETS
from contact_curation.session.session import SERVED
from test.browser.viewer import opened, settled
from test.conftest import GOLDEN

COLOURS = 192
"""Of the picture: few colours make a small file."""

LOOKS = 12
"""At most until the page counts as at rest."""

ARRIVAL = 60.0
"""[s] Until a viewer without a GPU has taken a session in."""


@contextmanager
def session(throws: int, rate: float, folder: Path) -> Iterator[str]:
    """The dashboard's address, once all throws were made."""
    options = ["--throws", str(throws), "--rate", str(rate), "--top", "8", "--stay", "--record", str(folder / "session")]
    options += ["--params-file", str(BUDGETS)]
    command = [sys.executable, "-m", "contact_curation.cli.main", "online", *options, "--held-out", str(GOLDEN)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                sys.stderr.write(line)
                if line.startswith(SERVED):
                    yield line.removeprefix(SERVED).strip()
                    return
            raise RuntimeError("the session ended before its dashboard was served")
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate()


def main() -> int:
    """Runs a session and takes the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("picture", type=Path, help="PNG file")
    parser.add_argument("--throws", type=int, default=12, help="of the session (default 12)")
    parser.add_argument("--rate", type=float, default=0.0, help="simulated seconds per second (default 0: as fast as possible)")
    parser.add_argument("--address", help="of a dashboard that is served already, instead of a session")
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder, ExitStack() as running:
        throws, rate = arguments.throws, arguments.rate
        address = arguments.address or running.enter_context(session(throws, rate, Path(folder)))
        page = running.enter_context(opened(address))
        page.wait(ARRIVAL)
        settled(page, most=LOOKS)
        taken = page.png()
    picture = Image.open(io.BytesIO(taken)).convert("RGB")
    arguments.picture.parent.mkdir(parents=True, exist_ok=True)
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(arguments.picture, optimize=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
