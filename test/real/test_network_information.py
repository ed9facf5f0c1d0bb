"""Networks' information on ContactNets' tosses (method.md 6, check 15)."""

import pytest

from benchmarks.selection.network_information import COMPARED_TOSSES, network, sketches
from contact_curation.information.network.config import network_config_for
from contact_curation.motion.toss import Toss


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["deep", "deepvertex", "end_to_end"])
def test_the_sketch_of_fifty_tosses_is_near_the_gradients(real_tosses: tuple[Toss, ...], kind: str) -> None:
    found = sketches(network(kind, real_tosses, None, steps=100), real_tosses[:COMPARED_TOSSES])
    usual = network_config_for(kind).sketch
    (row,) = [one for one in found if (one.leading, one.random) == (usual.leading, usual.random)]
    assert row.inner_products < 0.05
    assert row.leverages > 0.95
