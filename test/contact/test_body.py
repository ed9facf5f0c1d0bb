"""Numbers of a body that the kernel works with."""

import numpy as np
import pytest

from contact_curation.contact.body import CONTACTNETS_CUBE, Body


@pytest.mark.parametrize("seed", range(5))
def test_the_inverse_inertia_undoes_the_inertia(seed: int) -> None:
    axes, _ = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    inertia = axes @ np.diag([6e-4, 7e-4, 1.1e-3]) @ axes.T
    body = Body("one", CONTACTNETS_CUBE.vertices, 0.4, inertia, 0.2, 0.05)
    np.testing.assert_allclose(body.scaled_inverse_inertia @ body.scaled_inertia, np.eye(3), rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(body.scaled_inverse_inertia, np.linalg.inv(body.scaled_inertia), rtol=1e-14, atol=1e-13)


def test_the_inverse_of_principal_moments_is_rounded_once() -> None:
    moments = np.diag(CONTACTNETS_CUBE.scaled_inertia)
    np.testing.assert_array_equal(CONTACTNETS_CUBE.scaled_inverse_inertia, np.diag(1.0 / moments))
