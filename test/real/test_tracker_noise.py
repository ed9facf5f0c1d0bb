"""The public tosses are tracked with the noise that bounds were chosen for, so that measuring it changes none of them."""

from pathlib import Path

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.motion.toss import Toss
from contact_curation.storage.datasets.tagslam_bag import import_contactnets
from contact_curation.storage.inputs.inputs import open_inputs

TOSSES = range(0, 400, 4)


@pytest.mark.slow
def test_real_tosses_are_accepted_within_the_rigs_bounds(contactnets_folder: Path, tmp_path: Path) -> None:
    bag = tmp_path / "real.mcap"
    import_contactnets(contactnets_folder, bag, chosen=lambda number: number in TOSSES)
    found = list(open_inputs([bag], CONTACTNETS_CUBE))  # a line would say so if bounds followed the measured noise
    assert [type(one) for one in found] == [Toss] * len(TOSSES), [str(one) for one in found if not isinstance(one, Toss)]
