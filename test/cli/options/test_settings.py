"""`--set STAGE.FIELD=VALUE`: any field, by its type; nothing that no stage has."""

import pytest

from contact_curation.cli.options.settings import with_settings
from contact_curation.contact.evaluation import Cone
from contact_curation.contact.loss_config import LossConfig
from contact_curation.design.safety import SafetyConfig
from contact_curation.errors import ContactCurationError
from contact_curation.information.scoring import ScoringConfig
from contact_curation.motion.gate_config import GateConfig
from contact_curation.motion.segmenter_config import SegmenterConfig

STAGES = {"gates": GateConfig(), "segmenter": SegmenterConfig(), "loss": LossConfig(), "scoring": ScoringConfig()}


def test_settings_replace_fields_of_every_type() -> None:
    words = [
        "gates.depth=0.02",
        "gates.enabled=false",
        "segmenter.region_x=-0.5,0.5",
        "segmenter.frame_period=0.01",
        "segmenter.rest_frames=7",
        "loss.cone=polyhedral",
        "scoring.loss.match=0.5",
    ]
    changed = with_settings(STAGES, words)
    assert changed["gates"] == GateConfig(enabled=False, depth=0.02)
    assert changed["segmenter"] == SegmenterConfig(region_x=(-0.5, 0.5), frame_period=0.01, rest_frames=7)
    assert changed["loss"] == LossConfig(cone=Cone.POLYHEDRAL)
    assert changed["scoring"].loss == LossConfig(match=0.5)
    assert STAGES["gates"] == GateConfig()


@pytest.mark.parametrize("order", [1, -1])
def test_settings_that_are_valid_together_are_accepted_in_any_order(order: int) -> None:
    words = ["safety.lowest_release=0.3", "safety.highest_release=0.6"][::order]
    assert with_settings({"safety": SafetyConfig()}, words)["safety"].lowest_release == 0.3
    with pytest.raises(ContactCurationError, match=r"--set safety.lowest_release=0.3: .* found 0.3, expected less than 0.24"):
        with_settings({"safety": SafetyConfig()}, ["safety.lowest_release=0.3"])


def test_the_last_setting_of_a_field_holds_and_none_is_a_value_where_it_may_be_none() -> None:
    words = ["segmenter.frame_period=0.01", "segmenter.frame_period=none"]
    assert with_settings(STAGES, words)["segmenter"] == SegmenterConfig()


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("gates", "STAGE.FIELD=VALUE"),
        ("gates.depth", "STAGE.FIELD=VALUE"),
        ("walls.depth=1", "unknown stage in --set walls: expected one of gates, "),
        ("gates.dpth=1", "unknown field in --set gates.dpth: did you mean gates.depth?"),
        ("gates.depth=deep", "a value of type"),
        ("gates.enabled=perhaps", "a value of type"),
        ("gates.depth.more=1", "unknown field in --set gates.depth.more: did you mean gates.depth?"),
        ("segmenter.region_x=1", "a value of type"),
        ("segmenter.rest_frames=1.5", "a value of type"),
        ("loss.cone=square", "a value of type"),
        ("gates.depth=-1", "--set gates.depth=-1: depth: found -1.0, expected a positive number"),
        ("gates.depth=nan", "--set gates.depth=nan: "),
        ("gates.depth=deep", "a value of type float"),
        ("loss.cone=square", "one of circular, polyhedral"),
        ("gates.gravity=1.6", "it is the body's, in the file of --body"),
        ("segmenter.gravity=1.6", "it is the body's, in the file of --body"),
    ],
)
def test_anything_else_is_one_clear_error(setting: str, expected: str) -> None:
    with pytest.raises(ContactCurationError) as caught:
        with_settings(STAGES, [setting])
    assert expected in str(caught.value)
