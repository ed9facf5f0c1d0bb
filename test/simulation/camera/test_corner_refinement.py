"""Corners are found to a few hundredths of a pixel in drawn squares; where the image tells nothing they stay as they are."""

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.simulation.camera.corner_refinement import refined_corners
from contact_curation.simulation.camera.tag_textures import Image

SIZE, FINE = 120, 16


def drawn(corners: Array, noise: float = 0.0) -> Image:
    """A black square with these corners on white; a pixel is as dark as its share that is covered."""
    fine = (np.arange(SIZE * FINE) + 0.5) / FINE
    x, y = np.meshgrid(fine, fine)
    inside = np.ones_like(x, dtype=bool)
    for start, end in zip(corners, np.roll(corners, -1, axis=0)):
        inside &= (end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0]) <= 0.0
    grey = 230.0 * (1.0 - inside.reshape(SIZE, FINE, SIZE, FINE).mean(axis=(1, 3)))
    noisy = grey + noise * np.random.default_rng(0).standard_normal(grey.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def square(turn: float, edge: float = 60.0) -> Array:
    """Counter-clockwise for who looks at an image, whose y points down; its middle is off the grid."""
    corners = edge / 2 * np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return np.asarray(corners @ rotation.T + [60.3, 59.6])


@pytest.mark.parametrize("turn", [0.0, 0.1, 0.5, 0.785])
def test_shaken_corners_come_back(turn: float) -> None:
    true = square(turn)
    shaken = true + np.random.default_rng(1).uniform(-0.6, 0.6, (4, 2))
    np.testing.assert_allclose(refined_corners(drawn(true, noise=2.0), shaken), true, atol=0.05)


@pytest.mark.slow
def test_noise_that_is_larger_on_the_white_side_does_not_make_the_square_larger() -> None:
    """As in a camera, where light itself is noisy; an edge of 60 px that is off by 0.01 px is 0.3 mm of a metre's distance."""
    grown = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        true = square(rng.uniform(0.0, 1.5))
        image = drawn(true).astype(float) * (210.0 / 230.0) + 20.0
        noisy = image + np.where(image > 100.0, 4.0, 0.5) * rng.standard_normal(image.shape)
        found = refined_corners(np.rint(noisy).astype(np.uint8), true)
        away = (true - true.mean(axis=0)) / np.linalg.norm(true - true.mean(axis=0), axis=1, keepdims=True)
        grown.append(float(((found - true) * away).sum(axis=1).mean() / np.sqrt(2.0)))
    assert abs(np.mean(grown)) < 0.004


def test_a_stain_on_an_edge_moves_its_corners_little() -> None:
    true = square(0.3)
    image = drawn(true)
    middle = ((true[0] + true[1]) / 2).astype(int)
    image[middle[1] - 2 : middle[1] + 3, middle[0] - 2 : middle[0] + 3] = 230
    np.testing.assert_allclose(refined_corners(image, true), true, atol=0.1)


@pytest.mark.parametrize(
    "image",
    [np.full((SIZE, SIZE), 200, dtype=np.uint8), 230 - drawn(square(0.0))],
    ids=["no edge", "white on black"],
)
def test_where_there_is_no_black_square_corners_stay_as_given(image: Image) -> None:
    given = square(0.0) + 0.3
    assert refined_corners(image, given) is given


def test_a_tag_of_few_pixels_and_corners_in_one_place_stay_as_given() -> None:
    image = drawn(square(0.0))
    for given in (square(0.0, edge=6.0), np.full((4, 2), 60.0)):
        assert refined_corners(image, given) is given
