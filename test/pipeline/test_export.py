"""The selected tosses of a manifest are found again, or there is one line that says which are not and where they were."""

from pathlib import Path

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.errors import InvalidValueError
from contact_curation.motion.toss import Rejected, Toss
from contact_curation.pipeline.export import ExportJob, found_tosses
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.storage.export.selected import SelectedTosses
from contact_curation.storage.inputs.inputs import open_inputs
from contact_curation.storage.manifest.manifest import Manifest, ManifestRow
from test.storage.inputs.test_inputs import GOLDEN
from test.storage.manifest.test_manifest import RUN
from test.storage.selected_rows import row


def found(inputs: list[Path], rows: dict[str, ManifestRow]) -> SelectedTosses:
    reading = ReadingConfig(CONTACTNETS_CUBE)
    job = ExportJob(tuple(inputs), reading, Path("m.csv"), Manifest(RUN, tuple(rows.values())), rows)
    return found_tosses(job, reading.inputs)


def test_tosses_come_in_the_order_of_the_ranking_even_those_that_the_gates_would_keep_back() -> None:
    items = [item for item in open_inputs([GOLDEN], CONTACTNETS_CUBE) if isinstance(item, Toss | Rejected)]
    tosses = {one.toss.toss_id if isinstance(one, Rejected) else one.toss_id: one for one in items}
    wanted = [*list(tosses)[8::-4], next(name for name, one in tosses.items() if isinstance(one, Rejected))]
    result = found([GOLDEN], {toss_id: row(toss_id, input_sha256="") for toss_id in wanted})
    assert [one.toss.toss_id for one in result.tosses] == wanted
    assert [one.row.toss_id for one in result.tosses] == wanted
    assert result.warnings == ()
    assert {one.origin.input for one in result.tosses} == {str(GOLDEN)}


def test_recordings_whose_bytes_are_others_than_those_that_were_ranked_are_said_once() -> None:
    toss_ids = [one.toss_id for one in open_inputs([GOLDEN], CONTACTNETS_CUBE) if isinstance(one, Toss)][:3]
    result = found([GOLDEN], {toss_id: row(toss_id, input_sha256="f" * 64) for toss_id in toss_ids})
    assert result.warnings == (f"{GOLDEN}: holds selected tosses, but its bytes are not those that were ranked",)


def test_a_toss_that_is_in_no_input_is_an_error_that_names_it_and_its_recording(tmp_path: Path) -> None:
    rows = {f"toss-{number}": row(f"toss-{number}", input="/lab/monday.mcap") for number in range(5)}
    with pytest.raises(InvalidValueError) as caught:
        found([GOLDEN, tmp_path / "none.mcap"], rows)
    assert "5 of 5 selected tosses of m.csv not in them: toss-0, toss-1, toss-2, ..." in str(caught.value)
    assert "none.mcap" in str(caught.value)
    assert str(caught.value).endswith("expected the recordings that were ranked (/lab/monday.mcap)")
