"""A refit that fails is a row that says why."""

import numpy as np
import pytest

from contact_curation.errors import InvalidValueError
from contact_curation.experiments import bodies
from contact_curation.experiments.counterfactuals.refitted import Laboratory, Subset
from contact_curation.experiments.counterfactuals.table import FORESEEN_BY, OUTCOMES, SCHEMA
from contact_curation.information.pool import Indices
from contact_curation.learning.fits.refits import Refit, RefitPool


@pytest.mark.slow
def test_a_refit_that_fails_is_a_row_without_outcomes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SIMULATED", 6)
    laboratory, subset = Laboratory.of("slab"), Subset("slab", 2, 0)

    def failing(pool: RefitPool, chosen: Indices) -> Refit:
        raise InvalidValueError("friction", 0.0, "a positive number")

    whole = laboratory.row(subset)
    monkeypatch.setattr(RefitPool, "refit", failing)
    row = laboratory.row(subset)
    assert row.keys() == whole.keys() == set(SCHEMA.names) - {"body", "size", "draw", *FORESEEN_BY}
    assert row["tosses"] == whole["tosses"]
    assert (whole["failed"], row["failed"]) == ("", "friction: found 0.0, expected a positive number")
    assert all(np.isnan(float(row[name])) for name in OUTCOMES)
