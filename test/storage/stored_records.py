"""Tosses and information records that the tests of the stores are made of."""

import numpy as np

from contact_curation.information.record import ParameterBlock, TossInformation
from contact_curation.motion.toss import Rejected, Toss


def toss(number: int, frames: int = 5, *, height: float = 0.2) -> Toss:
    """Toss `number`: everything about it follows from the number."""
    draw = np.random.default_rng(number)
    orientations = draw.normal(size=(frames, 4))
    return Toss(
        toss_id=f"cube-{number}-ab",
        body="cube",
        source="/tagslam/odom/body_cube",
        frame_period=1.0 / 148.0,
        stamps_ns=number * 10**9 + np.arange(frames, dtype=np.int64) * 6_756_757,
        positions=np.column_stack([draw.normal(size=(frames, 2)), np.full(frames, height)]),
        orientations_wxyz=orientations / np.linalg.norm(orientations, axis=1, keepdims=True),
        linear_velocities=draw.normal(size=(frames, 3)),
        angular_velocities=draw.normal(size=(frames, 3)),
    )


def rejected(number: int) -> Rejected:
    return Rejected(toss(number), ("duration: found 0.1 s, expected at least 0.3 s", "flatness: found none, expected a face"))


def information(
    number: int, version: str = "v1", *, estimator: str = "empirical", bound: float = float("inf")
) -> TossInformation:
    draw = np.random.default_rng(number)
    return TossInformation(
        toss_id=f"cube-{number}-ab",
        body="cube",
        model="polytope",
        parameters_version=version,
        estimator=estimator,
        influence_bound=bound,
        blocks=(ParameterBlock("vertices", 0, 3), ParameterBlock("normal", 3, 5)),
        transitions=80,
        not_scored=2,
        duration=0.6,
        mean_loss=0.1 + number / 3.0,
        block_traces=draw.uniform(size=2),
        score_sum=draw.normal(size=5),
        factor=draw.normal(size=(4, 5)),
        centroid=draw.normal(size=3),
        tilt_axes=draw.normal(size=(2, 3)) if number % 2 else np.zeros((0, 3)),
    )
