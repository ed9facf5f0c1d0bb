// Eight transitions at once: one SIMD lane each. GCC and clang vector extensions, so that one source serves every level.
//
// All levels give the same bytes: there are eight lanes whatever the registers' width, no sum is taken in another order, and nothing is
// contracted to a fused product and sum (setup.py says so to the compiler).
#pragma once

#include <cfloat>
#include <cmath>

#if defined(__FAST_MATH__) || FLT_EVAL_METHOD != 0
#error "every operation must round to a double as it is written: no -ffast-math, no x87"
#endif

namespace contact_curation {

constexpr int kLanes = 8;

typedef double Lane __attribute__((vector_size(kLanes * sizeof(double))));
typedef long long LaneMask __attribute__((vector_size(kLanes * sizeof(long long))));

inline Lane broadcast(double value) { return Lane{} + value; }
inline Lane select(LaneMask mask, Lane yes, Lane no) { return mask ? yes : no; }
inline Lane minimum(Lane a, Lane b) { return a < b ? a : b; }
inline Lane maximum(Lane a, Lane b) { return a > b ? a : b; }
// min(0, a), and NaN of NaN: what is not a number must never pass for an open contact.
inline Lane negative_part(Lane a) { return a >= 0.0 ? Lane{} : a; }
inline Lane absolute(Lane a) { return a < 0.0 ? -a : a; }

inline Lane square_root(Lane a) {
  Lane root;
  for (int lane = 0; lane < kLanes; ++lane) root[lane] = std::sqrt(a[lane]);
  return root;
}

// 2^n of a whole number n that stands in the last bits, as after a sum with 1.5 * 2^52.
inline Lane power_of_two(Lane rounded) { return (Lane)(((LaneMask)rounded + 1023) << 52); }

// NaN has many bit patterns, and CPUs differ in which they make; what is handed out has this one.
inline double canonical(double value) { return value == value ? value : __builtin_nan(""); }

inline bool any(LaneMask mask) {
  long long joined = 0;
  for (int lane = 0; lane < kLanes; ++lane) joined |= mask[lane];
  return joined != 0;
}

template <int Size>
inline Lane dot(const Lane *a, const Lane *b) {
  Lane sum = a[0] * b[0];
  for (int k = 1; k < Size; ++k) sum += a[k] * b[k];
  return sum;
}

}  // namespace contact_curation
