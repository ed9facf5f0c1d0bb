"""A node without a body takes that of its checkpoint; two nodes with different bodies of one name are told."""

from dataclasses import replace
from pathlib import Path

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.information.model_version import model_version
from contact_curation.nodes.messages.headers import Stamped
from contact_curation.nodes.messages.model_parameters import model_message
from contact_curation.storage.checkpoint_file import save_model
from test.graph.parts.made_node import lone_domain, made_node

HEAVY = replace(CONTACTNETS_CUBE, name="heavy", mass=0.5)


@pytest.mark.parametrize("name", ["fisher_scorer", "trainer", "throw_designer", "dashboard"])
def test_a_node_without_a_body_takes_that_of_its_checkpoint(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str
) -> None:
    path = tmp_path / "heavy.safetensors"
    save_model(path, PolytopeModel(ContactGeometry.of_body(HEAVY), HEAVY, Form.RIGID))
    with lone_domain() as domain, made_node(name, domain, f"params:={path}") as (node, _):
        assert node.__dict__["_body"].digest == HEAVY.digest
    assert f"no body given: taking heavy (0.5 kg) of {path}" in capfd.readouterr().err


def test_parameters_of_another_body_of_that_name_are_said(capfd: pytest.CaptureFixture[str]) -> None:
    with lone_domain() as domain, made_node("fisher_scorer", domain) as (node, _):
        for mass in (CONTACTNETS_CUBE.mass, 0.5):
            body = replace(CONTACTNETS_CUBE, mass=mass)
            model = PolytopeModel(ContactGeometry.of_body(CONTACTNETS_CUBE), body, Form.RIGID)
            version = model_version(model)
            node._renew(model_message(model, version, 1, Stamped()))
            told = f"found version {version}" in capfd.readouterr().err
            assert told == (mass != CONTACTNETS_CUBE.mass)
