"""A world in which influence is exact: tosses that measure a few numbers linearly."""

import numpy as np

from contact_curation.experiments.counterfactuals.scores import Known
from contact_curation.geometry.quaternions import Array

TOSSES, DIRECTIONS = 60, 3


def linear_world(seed: int) -> tuple[Known, Array]:
    """Tosses that measure three numbers linearly with noise, at the fit to all, and the designs (K, 4, 3) that they have."""
    rng = np.random.default_rng(seed)
    designs = rng.standard_normal((TOSSES, 4, DIRECTIONS))
    whole = np.einsum("kri,krj->ij", designs, designs) / TOSSES
    designs = designs @ np.linalg.inv(np.linalg.cholesky(whole)).T
    residuals = rng.standard_normal((TOSSES, 4))
    fit = np.linalg.lstsq(designs.reshape(-1, DIRECTIONS), residuals.ravel())[0]
    scores = np.einsum("kri,kr->ki", designs, residuals - designs @ fit)
    fishers = np.einsum("kri,krj->kij", designs, designs)
    pull = 30.0 * rng.standard_normal(DIRECTIONS)
    plain = {"trace": -np.trace(fishers, axis1=1, axis2=2)}
    return Known(fishers, scores, pull, fishers.sum(axis=0), 20.0 * np.eye(DIRECTIONS), plain), designs
