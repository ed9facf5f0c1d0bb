"""Tosses that judge: held-out recordings of a node, by a tracker that is as noisy as it is told, and the loss of a model."""

from dataclasses import replace
from pathlib import Path

import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.contact.models.polytope import PolytopeModel
from contact_curation.contact.parameter_form import Form
from contact_curation.errors import InvalidValueError
from contact_curation.motion.segmenter_config import SegmenterConfig
from contact_curation.pipeline.evaluated import JudgingTosses
from contact_curation.pipeline.evaluation import evaluate_models, evaluation_config, judging_tosses
from contact_curation.pipeline.learned_model import LearnedModel
from contact_curation.pipeline.reading import ReadingConfig
from contact_curation.pipeline.tosses import Tosses, evaluation_tosses
from contact_curation.storage.inputs.inputs import InputsConfig
from contact_curation.storage.inputs.pose_messages import ODOMETRY
from test.motion.streams import board_in_map, in_map, noisy, stream
from test.simulated import simulated_tosses
from test.storage.pose_recordings import LOG_OFFSET_NS, recorded, transforms
from test.storage.written_bags import Sent, write_ours


def test_a_noisy_trackers_recordings_are_held_out_once_they_are_told_to_be(tmp_path: Path) -> None:
    scattered = in_map(noisy([*stream(), *stream(start_ns=9_000_000_000)], 8.0))
    board = Sent("/tf_static", LOG_OFFSET_NS, transforms([board_in_map()]))
    bag = write_ours(tmp_path / "a.mcap", [board, *recorded("/tagslam/odom/body_cube", ODOMETRY, scattered)])
    as_the_rig = InputsConfig(segmenter=SegmenterConfig(tracker_noise=1.0))
    with pytest.raises(InvalidValueError, match=r"parameter evaluate_on: found .* say segmenter.tracker_noise="):
        evaluation_tosses("parameter evaluate_on", [bag], ReadingConfig(CONTACTNETS_CUBE, as_the_rig))
    told = InputsConfig(segmenter=SegmenterConfig(tracker_noise=8.0))
    assert len(evaluation_tosses("parameter evaluate_on", [bag], ReadingConfig(CONTACTNETS_CUBE, told))) == 2


def test_what_is_known_follows_from_the_loss_that_the_training_minimised_and_a_warning_says_where_another_is_reported() -> None:
    body, tosses = CONTACTNETS_CUBE, simulated_tosses(4, seed=2)
    polytope = PolytopeModel(ContactGeometry.of_body(body), body, Form.RIGID)
    ids = frozenset(toss.toss_id for toss in tosses[1:])
    published, balanced = (LossConfig(threads=1, balanced=balanced) for balanced in (False, True))

    def judged(minimised: LossConfig | None, reported: LossConfig) -> tuple[LearnedModel, JudgingTosses]:
        model = LearnedModel(polytope, "cube", ids, ids, at_optimum=True, loss=minimised)
        return model, judging_tosses(Tosses.of(tosses, body), None, [model], loss=reported)

    def evaluated(minimised: LossConfig | None, reported: LossConfig) -> tuple[list[float], float]:
        model, judges = judged(minimised, reported)
        found = evaluate_models([model], judges, evaluation_config(loss=reported))
        assert found.known is not None
        return [one.sandwich for one in found.known.parameters], found.evaluations[0].mean_loss

    known, loss = evaluated(published, balanced)
    of_published, of_balanced = evaluated(None, published), evaluated(None, balanced)
    assert known == of_published[0] != of_balanced[0]
    assert loss == of_balanced[1] != of_published[1]
    said = "cube: its training minimised another loss (loss.balanced=false) than is reported here"
    assert judged(published, balanced)[1].warnings == (said,)
    physical = LearnedModel(PolytopeModel(ContactGeometry.of_body(body), body, Form.PHYSICAL), "other", loss=published)
    for reported, count in ((balanced, 1), (published, 0)):
        two = [judged(reported, reported)[0], physical]
        warnings = judging_tosses(Tosses.of(tosses, body), None, two, loss=reported).warnings
        assert [line.partition(":")[0] for line in warnings] == ["losses of the two models cannot be compared"] * count
    assert judged(published, published)[1].warnings == judged(replace(balanced, tolerance=1e-8), balanced)[1].warnings == ()
