"""The kernel's own elementary functions, held against exact arithmetic."""

import ctypes
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest

from contact_curation.geometry.quaternions import Array
from contact_curation.solver.compiled import load_kernel
from test.kernel.golden import uniform

PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798214808651")
SIZES = (1e-300, 1e-9, 1e-3, 0.1, 0.8, 2.0, 10.0, 100.0)


def elementary(x: Array) -> tuple[Array, Array, Array]:
    """Sines, cosines and hyperbolic tangents as the kernel takes them."""
    function = load_kernel().function("contact_curation_elementary", None, ctypes.c_int64, *4 * [ctypes.c_void_p])
    results = np.empty_like(x), np.empty_like(x), np.empty_like(x)
    function(len(x), x.ctypes.data, *(result.ctypes.data for result in results))
    return results


def powers(bases: Array, exponents: Array) -> Array:
    """Whole powers as the kernel takes them."""
    function = load_kernel().function("contact_curation_powers", None, ctypes.c_int64, *3 * [ctypes.c_void_p])
    whole, result = exponents.astype(np.int64), np.empty_like(bases)
    function(len(bases), bases.ctypes.data, whole.ctypes.data, result.ctypes.data)
    return result


def sine(x: Decimal) -> Decimal:
    """By its series, after reduction by whole turns."""
    x = x.remainder_near(2 * PI)
    term, total, k = x, x, 1
    while abs(term) > Decimal(10) ** -60 * abs(x):
        k += 2
        term = -term * x * x / (k * (k - 1))
        total += term
    return total


def largest_error(found: Array, exact: list[Decimal]) -> float:
    """In units in the last place of the exact number."""
    return max(
        abs(float((Decimal(value) - true) / Decimal(np.spacing(abs(float(true))))))
        for value, true in zip(found.tolist(), exact, strict=True)
    )


@pytest.mark.parametrize("size", [*SIZES, 1e4])
def test_sine_and_cosine_err_by_less_than_one_unit_in_the_last_place(size: float) -> None:
    x = uniform(f"sine {size}", 500, low=-size, high=size)
    sines, cosines, _ = elementary(x)
    with localcontext(prec=90):
        assert largest_error(sines, [sine(Decimal(value)) for value in x.tolist()]) < 1.0
        assert largest_error(cosines, [sine(PI / 2 - Decimal(value)) for value in x.tolist()]) < 1.0


@pytest.mark.parametrize("quarters", [1, 2, 3, 4, 5, 6001, -6365])
def test_next_to_a_root_sine_and_cosine_keep_their_relative_error(quarters: int) -> None:
    x = np.array([np.nextafter(float(quarters * PI / 2), side) for side in (-np.inf, np.inf)])
    sines, cosines, _ = elementary(x)
    with localcontext(prec=90):
        assert largest_error(sines, [sine(Decimal(value)) for value in x.tolist()]) < 1.0
        assert largest_error(cosines, [sine(PI / 2 - Decimal(value)) for value in x.tolist()]) < 1.0


@pytest.mark.parametrize("size", [1e5, 1e9, 1e17])
def test_of_huge_angles_sine_and_cosine_err_by_no_more_than_half_a_unit_of_the_angle_would_make(size: float) -> None:
    x = uniform(f"huge {size}", 300, low=-size, high=size)
    sines, cosines, _ = elementary(x)
    with localcontext(prec=120):
        exact = [float(sine(Decimal(value))) for value in x.tolist()]
    assert (np.abs(sines - exact) < 0.5 * np.spacing(np.abs(x)) + 2e-16).all()
    np.testing.assert_allclose(sines**2 + cosines**2, 1.0, atol=1e-15)


@pytest.mark.parametrize("size", SIZES)
def test_the_hyperbolic_tangent_errs_by_less_than_three_units_in_the_last_place(size: float) -> None:
    x = uniform(f"tanh {size}", 500, low=-size, high=size)
    with localcontext(prec=700 if size < 1e-200 else 60):
        exact = [1 - 2 / ((2 * Decimal(value)).exp() + 1) for value in x.tolist()]
        assert largest_error(elementary(x)[2], exact) < 3.0


def test_what_is_not_finite_has_no_sine_and_limits_have_tangents() -> None:
    x = np.array([np.inf, -np.inf, np.nan, 0.0])
    sines, cosines, tangents = elementary(x)
    np.testing.assert_array_equal(sines, [np.nan, np.nan, np.nan, 0.0])
    np.testing.assert_array_equal(cosines, [np.nan, np.nan, np.nan, 1.0])
    np.testing.assert_array_equal(tangents, [1.0, -1.0, np.nan, 0.0])


def test_whole_powers_are_rounded_once() -> None:
    exponents = np.array([0, 1, 2, 3, 7, 10, 31, 100, 1000, 4095])
    for base in (0.9, 0.999, 0.5, 1.0, 0.123456789):
        found = powers(np.full(len(exponents), base), exponents)
        for power, exponent in zip(found.tolist(), exponents.tolist(), strict=True):
            exact = Fraction(base) ** exponent
            if exact > Fraction(1, 2**1000):
                assert abs(Fraction(power) - exact) <= Fraction(np.spacing(float(exact))) * Fraction(51, 100), (base, exponent)
            else:
                assert power == pytest.approx(float(exact), abs=1e-300)
