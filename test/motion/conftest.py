"""Real tosses for the tests of motion; storage has its own tests of how they are read."""

from pathlib import Path

import pytest

from contact_curation.motion.toss import Toss
from contact_curation.storage.datasets.contactnets import read_contactnets


@pytest.fixture(scope="session")
def real_tosses(contactnets_folder: Path) -> list[Toss]:
    """ContactNets' 570 tosses, in order of their numbers."""
    return [toss for toss in read_contactnets(contactnets_folder) if isinstance(toss, Toss)]
