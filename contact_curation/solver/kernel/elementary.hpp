// Elementary functions made of additions, products and quotients alone: the same bytes with any compiler, C library and CPU.
//
// The C library's sin, cos, tanh and pow differ in the last bit between its versions, and between the CPUs that it picks code
// for. test/kernel/test_elementary.py measures the errors of these: sine and cosine below 1 ulp up to |x| = 1e4, tanh below 3
// ulp, whole powers below 0.51 ulp.
#pragma once

#include <cmath>
#include <cstdint>

#include "lanes.hpp"

namespace contact_curation {

struct SineCosine {
  double sine, cosine;
};

// Horner's rule: the last coefficient is that of 1.
template <class Number, int Count>
inline Number series(Number x, const double (&coefficients)[Count]) {
  Number sum = Number{} + coefficients[0];
  for (int k = 1; k < Count; ++k) sum = sum * x + coefficients[k];
  return sum;
}

// Reduction by multiples of pi / 2 in three parts (Cody and Waite, 1980), then Taylor series for |r| <= pi / 4. The sine and
// cosine of what is not finite are not numbers.
inline SineCosine sine_cosine(double x) {
  constexpr double kLargest = 1e4, kTurn = 0x1.921fb54442d18p+2, kPerQuarter = 0x1.45f306dc9c883p-1;
  // pi / 2: the first two parts have 33 bits, so that their products with the number of quarters are exact.
  constexpr double kFirst = 0x1.921fb544p+0, kSecond = 0x1.0b4611a6p-34, kThird = 0x1.3198a2e037073p-69;
  constexpr double kSine[] = {1.0 / 355687428096000, -1.0 / 1307674368000, 1.0 / 6227020800, -1.0 / 39916800,
                              1.0 / 362880,          -1.0 / 5040,          1.0 / 120,        -1.0 / 6};
  constexpr double kCosine[] = {-1.0 / 6402373705728000, 1.0 / 20922789888000, -1.0 / 87178291200, 1.0 / 479001600,
                                -1.0 / 3628800,          1.0 / 40320,          -1.0 / 720,         1.0 / 24};
  if (!std::isfinite(x)) return {x - x, x - x};
  if (std::fabs(x) > kLargest) x = std::fmod(x, kTurn);  // exact; that kTurn is rounded counts for less than half an ulp of x
  const int quarters = static_cast<int>(x * kPerQuarter + (x < 0.0 ? -0.5 : 0.5));
  const double coarse = x - quarters * kFirst, fine = quarters * kSecond;
  const double near = coarse - fine, rest = ((coarse - near) - fine) - quarters * kThird;
  const double r = near + rest, tail = (near - r) + rest, z = r * r;
  const double half = 0.5 * z, most = 1.0 - half;
  const double sine = r + (r * z * series(z, kSine) + tail * most);
  const double cosine = most + (((1.0 - most) - half) + (z * z * series(z, kCosine) - r * tail));
  switch (quarters & 3) {
    case 0: return {sine, cosine};
    case 1: return {cosine, -sine};
    case 2: return {-sine, -cosine};
    default: return {-cosine, sine};
  }
}

// e / (e + 2) with e = exp(2 |x|) - 1 = 2^n p + 2^n - 1, p = exp(r) - 1 by its Taylor series for |r| <= ln(2) / 2.
inline Lane hyperbolic_tangent(Lane x) {
  constexpr double kSaturated = 40.0;  // tanh(20) is 1 to the last bit
  constexpr double kPerLog2 = 0x1.71547652b82fep+0, kLog2 = 0x1.62e42fefa2p-1, kLog2Rest = 0x1.9ef35793c7673p-41;
  constexpr double kRounder = 0x1.8p52;  // a sum with it has no bits behind the point
  constexpr double kSeries[] = {1.0 / 87178291200, 1.0 / 6227020800, 1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800,
                                1.0 / 362880,      1.0 / 40320,      1.0 / 5040,      1.0 / 720,      1.0 / 120,
                                1.0 / 24,          1.0 / 6,          1.0 / 2};
  const Lane size = absolute(x), twice = select(2.0 * size > kSaturated, broadcast(kSaturated), 2.0 * size);
  const Lane rounded = twice * kPerLog2 + kRounder, n = rounded - kRounder;
  const Lane r = (twice - n * kLog2) - n * kLog2Rest;
  const Lane p = r + r * r * series(r, kSeries), power = power_of_two(rounded);
  const Lane e = power * p + (power - 1.0), positive = e / (e + 2.0);
  return select(x < 0.0, -positive, positive);
}

// A number in two parts, as exact as the product of their lengths.
struct TwoParts {
  double high, low;
};

// Dekker (1971); parts small enough not to overflow.
inline TwoParts product(TwoParts a, TwoParts b) {
  constexpr double kSplitter = 134217729.0;  // 2^27 + 1
  const double a_far = kSplitter * a.high, a_big = a_far - (a_far - a.high), a_small = a.high - a_big;
  const double b_far = kSplitter * b.high, b_big = b_far - (b_far - b.high), b_small = b.high - b_big;
  const double high = a.high * b.high;
  const double lost = ((a_big * b_big - high) + a_big * b_small + a_small * b_big) + a_small * b_small;
  const double low = lost + (a.high * b.low + a.low * b.high), sum = high + low;
  return {sum, low - (sum - high)};
}

// base^exponent for a base from 0 to 1, by squaring.
inline double whole_power(double base, std::int64_t exponent) {
  TwoParts power{1.0, 0.0}, square{base, 0.0};
  for (; exponent > 0; exponent >>= 1) {
    if (exponent & 1) power = product(power, square);
    square = product(square, square);
  }
  return power.high;
}

// I^-1 (w x I w): what a time step takes of the spin w (3) of a body without a torque, times dt (method.md 1.2).
template <class Number>
void gyroscopic(const double *inertia, const double *inverse, const Number *spin, Number *turning) {
  Number momentum[3], torque[3];
  for (int k = 0; k < 3; ++k)
    momentum[k] = inertia[3 * k] * spin[0] + inertia[3 * k + 1] * spin[1] + inertia[3 * k + 2] * spin[2];
  torque[0] = spin[1] * momentum[2] - spin[2] * momentum[1];
  torque[1] = spin[2] * momentum[0] - spin[0] * momentum[2];
  torque[2] = spin[0] * momentum[1] - spin[1] * momentum[0];
  for (int k = 0; k < 3; ++k)
    turning[k] = inverse[3 * k] * torque[0] + inverse[3 * k + 1] * torque[1] + inverse[3 * k + 2] * torque[2];
}

}  // namespace contact_curation
