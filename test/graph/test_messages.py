from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from contact_curation_msgs.msg import (
    CuratedBuffer,
    ModelParameters,
    Throw,
    ThrowReport,
    Toss,
    TossInformation,
    TossRejected,
    TrainingStatus,
)
from geometry_msgs.msg import Pose
from rclpy.serialization import deserialize_message, serialize_message

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.models.deepvertex import DeepvertexModel
from contact_curation.design.throw import throw_of_state
from contact_curation.errors import InvalidValueError
from contact_curation.information.scoring import ScoringConfig
from contact_curation.learning.checkpoints.stored_model import model_bytes
from contact_curation.learning.checkpoints.theta_bytes import bytes_of_geometry, geometry_of_bytes
from contact_curation.motion.toss import Rejected
from contact_curation.nodes.messages.headers import Stamped, check_format, stamped_of
from contact_curation.nodes.messages.shown import first_theta, selected_set_of, theta_of, training_of
from contact_curation.nodes.messages.throw import throw_message, throw_of
from contact_curation.nodes.messages.throw_report import report_of
from contact_curation.nodes.messages.toss import rejected_message, toss_message, toss_of
from contact_curation.nodes.messages.toss_bytes import toss_bytes, toss_in
from contact_curation.nodes.messages.toss_information import information_message, information_of
from contact_curation.stages.scored_theta import ScoredTheta, scorer_of
from test.graph.parts.offline import scored
from test.simulated import RIG_NOISE, simulated_tosses

DEEPVERTEX = model_bytes(DeepvertexModel(CONTACTNETS_CUBE.scaled_vertices, CONTACTNETS_CUBE))


def test_a_toss_comes_back_from_the_wire_bit_for_bit() -> None:
    (toss,) = simulated_tosses(1, seed=3, noise=RIG_NOISE)
    message = toss_message(toss, 7, "body_surface")
    heard = deserialize_message(serialize_message(message), type(message))
    assert toss_of(heard).digest() == toss.digest()
    assert (heard.sequence, heard.header.frame_id) == (7, "body_surface")
    assert stamped_of(heard.header).stamp_ns == toss.stamps_ns[0]
    w, x, y, z = toss.orientations_wxyz[5]
    turn = heard.poses[5].orientation
    assert (turn.w, turn.x, turn.y, turn.z) == (w, x, y, z)


def test_the_bytes_of_a_toss_are_those_of_its_message() -> None:
    for sequence, toss in enumerate(simulated_tosses(3, seed=3, noise=RIG_NOISE), start=1):
        for frame in ("", "body_surface", "Tisch ä"):
            message, data = toss_message(toss, sequence, frame), toss_bytes(toss, sequence, frame)
            assert deserialize_message(data, Toss) == message
            read = toss_in(bytes(serialize_message(message)))
            assert toss_of(read).digest() == toss.digest()
            for name in ("format_version", "header", "toss_id", "body", "source", "sequence", "frame_period"):
                assert getattr(read, name) == getattr(message, name), name


def test_before_the_first_training_the_dashboard_shows_theta_as_it_is_scored() -> None:
    theta, _ = first_theta("", CONTACTNETS_CUBE)
    assert theta.geometry is not None
    assert theta.geometry.is_rigid


def test_bytes_of_a_toss_may_have_options_of_the_middleware() -> None:
    (toss,) = simulated_tosses(1, seed=3)
    data = toss_bytes(toss, 1, "board")
    assert toss_of(toss_in(data[:2] + b"\0\3" + data[4:])).digest() == toss.digest()


def test_bytes_that_are_no_toss_are_refused_in_one_line() -> None:
    (toss,) = simulated_tosses(1, seed=3)
    data = toss_bytes(toss, 1, "board")
    for cut in (0, 3, 4, 9, 30, 200, len(data) - 1):
        with pytest.raises(InvalidValueError, match="bytes of a toss: found"):
            toss_in(data[:cut])
    with pytest.raises(InvalidValueError, match="bytes of a toss: found 00 00 00 00, expected 00 01 00 00"):
        toss_in(b"\0\0" + data[2:])


NEWER = 2


@pytest.mark.parametrize(
    ("message", "take"),
    [
        (Toss(), toss_of),
        (TossInformation(), information_of),
        (Throw(), throw_of),
        (ThrowReport(), report_of),
        (ModelParameters(), lambda message: theta_of(message, CONTACTNETS_CUBE)),
        (CuratedBuffer(), selected_set_of),
        (TrainingStatus(), training_of),
        (TossRejected(), check_format),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_message_of_a_newer_format_is_refused_in_one_line(message: Any, take: Callable[[Any], object]) -> None:
    message.format_version = NEWER
    name = type(message).__name__
    with pytest.raises(InvalidValueError) as refused:
        take(message)
    assert str(refused.value) == f"format of {name}: found version 2, expected at most 1: update contact_curation"


def test_what_is_sent_says_its_format() -> None:
    (toss,) = simulated_tosses(1, seed=3)
    (information,) = scored([toss])
    stamped = Stamped(1, "board")
    sent = [
        toss_message(toss, 1, "board"),
        rejected_message(Rejected(toss, ("gap",)), "board"),
        information_message(information, 1, stamped),
        throw_message(throw_of_state("t", "cube", np.eye(13)[3]), stamped),
    ]
    assert [message.format_version for message in sent] == [type(message).FORMAT_VERSION for message in sent]


def test_a_theta_of_another_number_of_vertices_is_not_drawn() -> None:
    cube = ContactGeometry.of_body(CONTACTNETS_CUBE)
    four = replace(cube, vertices_normal=cube.vertices_normal[:4], vertices_tangent=cube.vertices_tangent[:4])
    message = ModelParameters(body="cube", model="polytope", safetensors=bytes_of_geometry(four))
    with pytest.raises(InvalidValueError, match="vertices of the parameters: found 4, expected 8, as the body has"):
        theta_of(message, CONTACTNETS_CUBE)


def test_a_toss_message_with_a_pose_missing_is_refused() -> None:
    (toss,) = simulated_tosses(1, seed=3)
    message = toss_message(toss, 1, "body_surface")
    message.poses = list(message.poses)[:-1]
    with pytest.raises(InvalidValueError, match="positions"):
        toss_of(message)


def test_information_comes_back_from_the_wire_bit_for_bit() -> None:
    (information,) = scored(simulated_tosses(1, seed=3))
    message = information_message(information, 3, Stamped(5_000_000_001, "board"))
    heard = information_of(deserialize_message(serialize_message(message), type(message)))
    for name in ("block_traces", "score_sum", "factor", "centroid", "tilt_axes"):
        assert np.array_equal(getattr(heard, name), getattr(information, name)), name
    for name in ("toss_id", "blocks", "parameters_version", "estimator", "influence_bound", "transitions", "mean_loss"):
        assert getattr(heard, name) == getattr(information, name), name


def test_information_whose_factor_does_not_fit_its_blocks_is_refused() -> None:
    (information,) = scored(simulated_tosses(1, seed=3))
    message = information_message(information, 3, Stamped(0, ""))
    message.factor_rows += 1
    with pytest.raises(InvalidValueError, match="factor"):
        information_of(message)


def test_theta_comes_back_from_safetensors_bit_for_bit() -> None:
    cube = ContactGeometry.of_body(CONTACTNETS_CUBE)
    theta = ContactGeometry(
        cube.vertices_normal * 1.01, cube.normal, cube.vertices_tangent, cube.tangents, np.array([0.1, 0.2, 0.3]), 0.02
    )
    heard = geometry_of_bytes(bytes(ModelParameters(safetensors=bytes_of_geometry(theta)).safetensors))
    for name in ("vertices_normal", "normal", "vertices_tangent", "tangents", "pivot", "height"):
        assert np.array_equal(getattr(heard, name), getattr(theta, name)), name


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (ModelParameters(model="soft"), "model of the parameters: found 'soft', expected polytope, deep, "),
        (ModelParameters(model="deep", safetensors=b"\x80\x04pickle"), "expected a deep for body cube"),
        (ModelParameters(model="end_to_end", safetensors=DEEPVERTEX), "found deepvertex, expected end_to_end"),
        (ModelParameters(model="polytope", safetensors=b"\x80\x04pickle"), "no safetensors"),
        (ModelParameters(model="polytope", safetensors=bytes(2 << 20)), "at most"),
    ],
)
def test_parameters_of_no_model_or_of_another_are_refused_with_a_reason(message: ModelParameters, why: str) -> None:
    with pytest.raises(InvalidValueError, match=why):
        scorer_of(ScoredTheta(message.model, bytes(message.safetensors)), CONTACTNETS_CUBE, ScoringConfig())


def information_with(**changed: Any) -> TossInformation:
    (information,) = scored(simulated_tosses(1, seed=3))
    message = information_message(information, 3, Stamped(0, ""))
    for name, value in changed.items():
        setattr(message, name, value(getattr(message, name)) if callable(value) else value)
    return message


def all_huge(numbers: Sequence[float]) -> list[float]:
    return [1e200] * len(numbers)


@pytest.mark.parametrize(
    ("message", "take", "why"),
    [
        (lambda: information_with(mean_loss=float("nan")), information_of, "mean_loss of toss .*: found nan, expected finite"),
        (lambda: information_with(score_sum=all_huge), information_of, "score_sum of toss .*: found 1e"),
        (lambda: information_with(factor=all_huge), information_of, r"factor of toss .*: found 1e\+200"),
        (lambda: information_with(factor=[], factor_rows=0), information_of, "factor of toss .*: found no row"),
        (lambda: information_with(block_names=[], block_sizes=[], factor=[], factor_rows=0), information_of, "no parameter"),
        (lambda: information_with(factor=[0.0] * (1 << 21)), information_of, "2097152 entries, expected at most 1048576"),
        (lambda: information_with(influence_bound=-1.0), information_of, "influence_bound"),
        (
            lambda: far_toss(1e30),
            toss_of,
            r"positions \[m\] of toss .*: found 1e\+30, expected finite",
        ),
        (
            lambda: toss_in(bytes(serialize_message(far_toss(1e30)))),
            toss_of,
            r"positions \[m\] of toss .*: found 1e\+30, expected finite",
        ),
        (lambda: Toss(toss_id="long", poses=[Pose()] * 100_001), toss_of, "poses of toss long: found 100001 entries"),
        (
            lambda: toss_in(bytes(serialize_message(Toss(toss_id="long", poses=[Pose()] * 100_001)))),
            toss_of,
            "poses of toss long: found 100001 entries",
        ),
        (lambda: toss_in(bytes(serialize_message(Toss(format_version=2)))), toss_of, "format of Toss.*: found version 2"),
    ],
)
def test_numbers_that_no_toss_has_are_refused_at_the_door(message: Any, take: Callable[[Any], object], why: str) -> None:
    with pytest.raises(InvalidValueError, match=why):
        take(message())


def far_toss(distance: float) -> Toss:
    (toss,) = simulated_tosses(1, seed=3)
    message = toss_message(toss, 1, "board")
    message.poses[3].position.x = distance
    return message


@pytest.mark.parametrize(
    ("count", "size", "why"),
    [
        (10_000, 1.0, "vertices of the parameters: found 10000"),
        (8, 1e200, "vertices_.*: found a number that is not finite or too large"),
    ],
)
def test_parameters_that_no_body_has_are_refused_before_anything_is_computed(count: int, size: float, why: str) -> None:
    vertices = np.full((count, 3), size)
    theta = ContactGeometry(vertices, np.array([0.0, 0.0, 1.0]), vertices, 0.2 * np.eye(2, 3))
    with pytest.raises(InvalidValueError, match=why):
        geometry_of_bytes(bytes_of_geometry(theta))
