"""Rotations form a group, in which q and -q are one element; exp and log are its charts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from contact_curation.geometry import quaternions
from contact_curation.geometry.quaternions import Array

TIGHT = 1e-12


@st.composite
def unit_quaternions(draw: st.DrawFn) -> Array:
    rotation_vector = draw(arrays(float, 3, elements=st.floats(-6.0, 6.0)))
    sign = draw(st.sampled_from([-1.0, 1.0]))
    return sign * quaternions.exp(rotation_vector)


vectors = arrays(float, 3, elements=st.floats(-10.0, 10.0))


@given(unit_quaternions(), unit_quaternions(), unit_quaternions())
def test_the_product_is_associative(a: Array, b: Array, c: Array) -> None:
    left = quaternions.multiply(quaternions.multiply(a, b), c)
    np.testing.assert_allclose(left, quaternions.multiply(a, quaternions.multiply(b, c)), atol=TIGHT)


@given(unit_quaternions())
def test_the_identity_changes_nothing_and_the_conjugate_undoes(q: Array) -> None:
    np.testing.assert_allclose(quaternions.multiply(q, quaternions.IDENTITY), q, atol=TIGHT)
    np.testing.assert_allclose(quaternions.multiply(quaternions.IDENTITY, q), q, atol=TIGHT)
    np.testing.assert_allclose(quaternions.multiply(q, quaternions.conjugate(q)), quaternions.IDENTITY, atol=TIGHT)


@given(unit_quaternions(), unit_quaternions(), vectors)
def test_turning_by_a_product_is_turning_twice(a: Array, b: Array, vector: Array) -> None:
    at_once = quaternions.rotate(quaternions.multiply(a, b), vector)
    np.testing.assert_allclose(at_once, quaternions.rotate(a, quaternions.rotate(b, vector)), atol=1e-11)


@given(unit_quaternions(), vectors)
def test_q_and_minus_q_are_one_rotation(q: Array, vector: Array) -> None:
    np.testing.assert_allclose(quaternions.rotate(-q, vector), quaternions.rotate(q, vector), atol=TIGHT)
    np.testing.assert_allclose(quaternions.to_matrix(-q), quaternions.to_matrix(q), atol=TIGHT)
    assert quaternions.angle_between(q, -q) < 1e-7


@given(unit_quaternions())
def test_matrices_are_rotations(q: Array) -> None:
    matrix = quaternions.to_matrix(q)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=TIGHT)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=TIGHT)


@given(unit_quaternions())
def test_exp_undoes_log_up_to_the_sign_of_the_quaternion(q: Array) -> None:
    back = quaternions.exp(quaternions.log(q))
    assert min(np.abs(back - q).max(), np.abs(back + q).max()) < 1e-9


@given(arrays(float, 3, elements=st.floats(-1.8, 1.8)))
def test_log_undoes_exp_below_half_a_turn(rotation_vector: Array) -> None:
    if np.linalg.norm(rotation_vector) < np.pi - 1e-3:
        np.testing.assert_allclose(quaternions.log(quaternions.exp(rotation_vector)), rotation_vector, atol=1e-9)


@pytest.mark.parametrize("angle", [1e-15, 1e-9, 1e-6, 1.0, 3.0])
def test_exp_is_a_turn_about_its_own_axis(angle: float) -> None:
    turned = quaternions.rotate(quaternions.exp([0.0, 0.0, angle]), [1.0, 0.0, 0.0])
    np.testing.assert_allclose(turned, [np.cos(angle), np.sin(angle), 0.0], atol=1e-15)


def test_log_of_the_identity_and_of_its_negative_is_zero() -> None:
    np.testing.assert_array_equal(quaternions.log([quaternions.IDENTITY, -quaternions.IDENTITY]), np.zeros((2, 3)))


def test_the_rate_of_a_rotation_is_half_the_product_with_the_body_rate() -> None:
    """q_dot = 0.5 q * (0, omega), omega in the body frame (method.md 1.0), against a central difference."""
    start, omega, step = quaternions.exp([0.3, -0.8, 0.5]), np.array([1.0, -2.0, 0.7]), 1e-6
    ahead = quaternions.multiply(start, quaternions.exp(step * omega))
    behind = quaternions.multiply(start, quaternions.exp(-step * omega))
    expected = 0.5 * quaternions.multiply(start, np.concatenate([[0.0], omega]))
    np.testing.assert_allclose((ahead - behind) / (2.0 * step), expected, atol=1e-9)


@settings(max_examples=20)
@given(arrays(float, (2, 5, 3), elements=st.floats(-6.0, 6.0)), arrays(float, (2, 5, 3), elements=st.floats(-9.0, 9.0)))
def test_batches_are_the_loop_over_their_elements(rotation_vectors: Array, points: Array) -> None:
    q = quaternions.exp(rotation_vectors)
    product, turned = quaternions.multiply(q, q[::-1]), quaternions.rotate(q, points)
    for index in np.ndindex(2, 5):
        np.testing.assert_allclose(product[index], quaternions.multiply(q[index], q[::-1][index]), atol=TIGHT)
        np.testing.assert_allclose(turned[index], quaternions.rotate(q[index], points[index]), atol=1e-11)


def test_angle_between_is_the_angle_of_the_turn_from_one_to_the_other() -> None:
    start = quaternions.exp([0.4, 0.1, -2.0])
    turned = quaternions.multiply(start, quaternions.exp([0.0, 0.3, 0.4]))
    assert quaternions.angle_between(start, turned) == pytest.approx(0.5)
    assert quaternions.angle_between(start, -turned) == pytest.approx(0.5)


def test_normalized_keeps_the_rotation_and_makes_the_norm_one() -> None:
    q = quaternions.exp([0.4, 0.1, -2.0])
    np.testing.assert_allclose(quaternions.normalized([1.0005 * q, 0.9995 * q]), [q, q], atol=TIGHT)


@pytest.mark.parametrize("shape", [(4,), (7, 4), (2, 3, 4)])
def test_third_rows_are_those_of_the_matrices_bit_for_bit(shape: tuple[int, ...]) -> None:
    q = quaternions.normalized(np.random.default_rng(1).standard_normal(shape))
    assert quaternions.third_rows(q).tobytes() == quaternions.to_matrix(q)[..., 2, :].tobytes()


@pytest.mark.parametrize("shape", [(3,), (7, 2), (40, 3), (2, 3, 4)])
def test_lengths_have_the_digits_of_numpys_norm(shape: tuple[int, ...]) -> None:
    vectors = np.random.default_rng(2).standard_normal(shape)
    assert quaternions.lengths(vectors).tobytes() == np.linalg.norm(vectors, axis=-1).tobytes()


def test_products_broadcast() -> None:
    many = quaternions.normalized(np.random.default_rng(3).standard_normal((5, 4)))
    one_by_one = [quaternions.multiply(q, many[0]) for q in many]
    assert np.array_equal(quaternions.multiply(many, many[0]), one_by_one)
    assert np.array_equal(quaternions.cross(many[:, 1:], many[0, 1:]), [quaternions.cross(v, many[0, 1:]) for v in many[:, 1:]])
