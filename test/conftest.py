"""Fixtures that every part's tests share."""

import os
import sys

# Mesa's software renderer brings an LLVM, and so does triton, which torch.optim imports: with both, a process crashes.
sys.modules["triton"] = None  # type: ignore[assignment]

# Before NumPy and torch come: their threads wait for each other on busy cores, matrices are small, tests start many processes.
for library in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(library, "1")

from pathlib import Path  # noqa: E402
from typing import TYPE_CHECKING  # noqa: E402

import hypothesis  # noqa: E402
import pytest  # noqa: E402

if TYPE_CHECKING:
    from contact_curation.simulation.arm.throw_motion import ThrowPlanner
    from test.cli.commands import Cli, Outcome

# The same examples in every run, and no limit on the time of one: tests share their cores.
hypothesis.settings.register_profile("repeatable", derandomize=True, deadline=None)
hypothesis.settings.load_profile("repeatable")

REPOSITORY = Path(__file__).resolve().parents[1]
GOLDEN = REPOSITORY / "bags" / "golden.mcap"
CONTACTNETS_BESIDE = REPOSITORY.parent / "shared" / "data" / "contactnets"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests of live graphs are marked: their course depends on timing."""
    for item in items:
        if "graph" in getattr(item, "fixturenames", ()):
            item.add_marker("live")


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
    """The recording that comes with the repository, 24 tosses, 3 of which must be rejected, without its long rests."""
    from test.shortened import write_shortened  # NumPy and the readers of recordings, which not every test needs

    return write_shortened(GOLDEN, "/tagslam/odom/body_cube", tmp_path_factory.mktemp("golden") / GOLDEN.name)


@pytest.fixture(scope="session")
def golden(golden_bag: Path) -> Path:
    """`golden_bag`, as the tests of commands call it."""
    return golden_bag


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> "Cli":
    """Runs a command line in this process, word by word."""
    from contact_curation.cli.main import main
    from test.cli.commands import Outcome

    def run(*words: object) -> "Outcome":
        try:
            status = main([str(word) for word in words])
        except SystemExit as end:
            status = int(end.code or 0)
        return Outcome(status, *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seven simulated tosses of the true cube as ContactNets' files, which are read faster than a bag."""
    from test.cli.simulated_files import write_simulated  # torch takes over a second to import

    return write_simulated(tmp_path_factory.mktemp("tosses"), 7)


@pytest.fixture
def true_parameters(tmp_path: Path) -> Path:
    """A parameter file of the true cube."""
    from test.cli.commands import write_parameters

    return write_parameters(tmp_path / "true.json")


@pytest.fixture(scope="session")
def planner() -> "ThrowPlanner":
    """The planner of the simulated arm, whose table of postures takes a second to make."""
    from contact_curation.contact.body import CONTACTNETS_CUBE
    from contact_curation.simulation.arm.throw_motion import ThrowPlanner

    return ThrowPlanner(CONTACTNETS_CUBE)
