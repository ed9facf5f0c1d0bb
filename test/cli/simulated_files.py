"""Simulated tosses of the true cube as ContactNets' files."""

from pathlib import Path

from contact_curation.contact.geometry_parameters import ContactGeometry
from test.simulated import simulated_tosses
from test.storage.datasets.test_tagslam_bag import save_contactnets


def write_simulated(folder: Path, count: int, geometry: ContactGeometry | None = None) -> Path:
    """Writes the same tosses `0.pt`, `1.pt`, ... every time, of a cube of another geometry if given; gives the folder back."""
    for number, toss in enumerate(simulated_tosses(count, seed=8, geometry=geometry)):
        save_contactnets(folder, number, toss)
    return folder
