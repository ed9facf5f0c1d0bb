"""What the tests of design share: thetas, small configurations and made-up tosses."""

from dataclasses import replace

import numpy as np

from contact_curation.contact.body import CONTACTNETS_CUBE
from contact_curation.contact.geometry_parameters import ContactGeometry
from contact_curation.contact.loss_config import LossConfig
from contact_curation.design.candidates import CandidateConfig
from contact_curation.design.execution_noise import ExecutionNoise, NoiseConfig
from contact_curation.design.greedy_batch import RefinementConfig
from contact_curation.design.planner import DesignConfig
from contact_curation.design.predicted_information import Particle, PredictionConfig
from contact_curation.design.releases import PUBLISHED_PRIOR, Placement
from contact_curation.design.safety import SafetyConfig
from contact_curation.geometry.quaternions import Array

CUBE = CONTACTNETS_CUBE
LOSS = LossConfig(threads=1)
TRUE = ContactGeometry.of_body(CUBE)
PARTICLE = Particle(TRUE, CUBE, LOSS)
HARDLY_ANY_NOISE = NoiseConfig(position=1e-9, turn=1e-9, speed=0.0, velocity=1e-9, spin=1e-9)
QUIET = ExecutionNoise.expected(HARDLY_ANY_NOISE)
SMALL = DesignConfig(
    pool=16,
    reference=8,
    candidates=CandidateConfig(
        forecast=PredictionConfig(executions=2), safety=SafetyConfig(motions=10, executions=50, share=0.15), seed=3
    ),
    refinement=RefinementConfig(generations=3, population=4),
)


def other_theta(scale: float = 1.1, friction: float = 0.25) -> Particle:
    """A cube of another size and friction."""
    vertices = scale * TRUE.vertices_normal
    return Particle(
        replace(TRUE, vertices_normal=vertices, vertices_tangent=vertices, tangents=friction * np.eye(2, 3)), CUBE, LOSS
    )


def releases(count: int, seed: int = 0) -> Array:
    """States (count, 13) of the published prior, at the default place."""
    return PUBLISHED_PRIOR.draw(count, np.random.default_rng(seed)).states(Placement())
