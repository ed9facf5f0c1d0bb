"""Fixtures that every part's tests share."""

import os
import sys

# Mesa's software renderer brings an LLVM, and so does triton, which torch.optim imports: with both, a process crashes.
sys.modules["triton"] = None  # type: ignore[assignment]

# Before NumPy comes: its threads wait for each other on busy cores, the matrices are small, and tests start many processes.
for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(library, "1")

from pathlib import Path  # noqa: E402

import hypothesis  # noqa: E402
import pytest  # noqa: E402

# The same examples in every run, and no limit on the time of one: tests share their cores.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.load_profile("repeatable")

REPOSITORY = Path(__file__).resolve().parents[1]
GOLDEN = REPOSITORY / "bags" / "golden.mcap"
CONTACTNETS_BESIDE = REPOSITORY.parent / "shared" / "data" / "contactnets"


@pytest.fixture(scope="session")
def contactnets_folder() -> Path:
    """The folder with ContactNets' real tosses, one `N.pt` each; skips the test where they are not at hand."""
    base = Path(os.environ.get("CONTACTNETS_DATA", CONTACTNETS_BESIDE))
    folder = base / "tosses_processed"
    if not folder.is_dir():
        pytest.skip(f"no ContactNets data: set CONTACTNETS_DATA to the folder that holds tosses_processed/ (looked in {base})")
    return folder


@pytest.fixture(scope="session")
def golden_bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording that comes with the repository, 24 tosses, 3 of which must be kept back, without its long rests."""
    from test.shortened import write_shortened  # NumPy and the readers of recordings, which not every test needs

    return write_shortened(GOLDEN, "/tagslam/odom/body_cube", tmp_path_factory.mktemp("golden") / GOLDEN.name)
