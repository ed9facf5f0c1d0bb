"""The command line, run in this process."""

from pathlib import Path

import pytest

from contact_curation.cli.main import main
from test.cli.commands import Cli, Outcome, write_parameters


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Cli:
    """Runs a command line, word by word."""

    def run(*words: object) -> Outcome:
        try:
            status = main([str(word) for word in words])
        except SystemExit as end:
            status = int(end.code or 0)
        return Outcome(status, *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def golden(golden_bag: Path) -> Path:
    """`golden_bag`, as the tests of commands call it."""
    return golden_bag


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seven simulated tosses of the true cube as ContactNets' files, which are read faster than a bag."""
    from test.cli.simulated_files import write_simulated  # torch takes over a second to import

    return write_simulated(tmp_path_factory.mktemp("tosses"), 7)


@pytest.fixture
def true_parameters(tmp_path: Path) -> Path:
    return write_parameters(tmp_path / "true.json")
