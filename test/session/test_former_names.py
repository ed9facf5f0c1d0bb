"""A parameter file of version 0.1 names the readiness check and the prior's tosses otherwise; it is still read."""

from pathlib import Path

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.session.config import SessionConfig, SessionFolder
from contact_curation.session.node_parameters import session_parameters

OLD = """
throw_designer: {ros__parameters: {canary.least_agreement: 0.25}}
curator: {ros__parameters: {warm_up: 48}}
"""


def test_parameters_by_their_former_names_are_taken(tmp_path: Path) -> None:
    file = tmp_path / "old.yaml"
    file.write_text(OLD)
    found = session_parameters(SessionConfig(params_file=file), CONTACTNETS_CUBE, SessionFolder(tmp_path))
    assert found["throw_designer"]["readiness.least_agreement"] == 0.25
    assert found["curator"]["prior_tosses"] == 48
    assert not {"canary.least_agreement", "warm_up"} & {*found["throw_designer"], *found["curator"]}


def test_the_dashboard_knows_how_the_curator_ranks(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("curator:\n  ros__parameters:\n    prior: 0.5\n    cut: 0.01\n")
    config = SessionConfig(params_file=file, record=tmp_path / "session")
    shown = session_parameters(config, CONTACTNETS_CUBE, SessionFolder(tmp_path))["dashboard"]
    assert (shown["prior"], shown["cut"]) == (0.5, 0.01)
