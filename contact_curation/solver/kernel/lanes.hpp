// Eight transitions at once: one SIMD lane each. GCC and clang vector extensions, so that one source serves every level.
//
// All levels give the same bytes: there are eight lanes whatever the width of the registers, no sum is taken in another order,
// and nothing is contracted to a fused product and sum (setup.py says so to the compiler).
#pragma once

#include <cfloat>
#include <cmath>
#include <cstdint>

#if defined(__FAST_MATH__) || FLT_EVAL_METHOD != 0
#error "every operation must round to a double as it is written: no -ffast-math, no x87"
#endif

namespace contact_curation {

constexpr int kLanes = 8;

// What a register holds. Compilers take wider vectors apart too, but number by number: three times as slow.
#if defined(__AVX512F__)
constexpr int kPack = 8;
#elif defined(__AVX__)
constexpr int kPack = 4;
#else
constexpr int kPack = 2;
#endif

typedef double Pack __attribute__((vector_size(kPack * sizeof(double))));
using PackMask = decltype(Pack{} < Pack{});  // of 64-bit whole numbers, all bits set where true

// Eight numbers, or truth values, in registers.
template <class Part, class Element>
struct Parts {
  static constexpr int kCount = kLanes / kPack;
  Part part[kCount];

  Element &operator[](long lane) { return reinterpret_cast<Element *>(part)[lane]; }
  Element operator[](long lane) const { return reinterpret_cast<const Element *>(part)[lane]; }
};

using Lane = Parts<Pack, double>;
using LaneMask = Parts<PackMask, std::int64_t>;

// Result of `of` for each part, written out: a loop over them would go through memory.
template <class Result, class Of>
inline Result each(Of of) {
  Result result;
  result.part[0] = of(0);
  if constexpr (Result::kCount > 1) result.part[1] = of(1);
  if constexpr (Result::kCount > 2) result.part[2] = of(2), result.part[3] = of(3);
  static_assert(Result::kCount <= 4);
  return result;
}

#define LANE_OPERATOR(operation, Result)                                       \
  inline Result operator operation(Lane a, Lane b) {                           \
    return each<Result>([&](int k) { return a.part[k] operation b.part[k]; }); \
  }                                                                            \
  inline Result operator operation(Lane a, double b) {                         \
    return each<Result>([&](int k) { return a.part[k] operation b; });         \
  }                                                                            \
  inline Result operator operation(double a, Lane b) {                         \
    return each<Result>([&](int k) { return a operation b.part[k]; });         \
  }

LANE_OPERATOR(+, Lane)
LANE_OPERATOR(-, Lane)
LANE_OPERATOR(*, Lane)
LANE_OPERATOR(/, Lane)
LANE_OPERATOR(<, LaneMask)
LANE_OPERATOR(<=, LaneMask)
LANE_OPERATOR(>, LaneMask)
LANE_OPERATOR(>=, LaneMask)
LANE_OPERATOR(==, LaneMask)
LANE_OPERATOR(!=, LaneMask)
#undef LANE_OPERATOR

inline Lane operator-(Lane a) {
  return each<Lane>([&](int k) { return -a.part[k]; });
}
inline Lane &operator+=(Lane &a, Lane b) { return a = a + b; }
inline Lane &operator-=(Lane &a, Lane b) { return a = a - b; }
inline Lane &operator*=(Lane &a, Lane b) { return a = a * b; }

inline LaneMask operator&(LaneMask a, LaneMask b) {
  return each<LaneMask>([&](int k) { return a.part[k] & b.part[k]; });
}
inline LaneMask operator|(LaneMask a, LaneMask b) {
  return each<LaneMask>([&](int k) { return a.part[k] | b.part[k]; });
}
inline LaneMask operator~(LaneMask a) {
  return each<LaneMask>([&](int k) { return ~a.part[k]; });
}

inline Lane broadcast(double value) { return Lane{} + value; }
inline Lane select(LaneMask mask, Lane yes, Lane no) {
  return each<Lane>([&](int k) { return mask.part[k] ? yes.part[k] : no.part[k]; });
}
inline Lane minimum(Lane a, Lane b) { return select(a < b, a, b); }
inline Lane maximum(Lane a, Lane b) { return select(a > b, a, b); }
// min(0, a), and NaN of NaN: what is not a number must never pass for an open contact.
inline Lane negative_part(Lane a) { return select(a >= 0.0, Lane{}, a); }
inline Lane absolute(Lane a) { return select(a < 0.0, -a, a); }

inline Lane square_root(Lane a) {
  return each<Lane>([&](int k) {
    Pack root;
    for (int lane = 0; lane < kPack; ++lane) root[lane] = std::sqrt(a.part[k][lane]);
    return root;
  });
}

// 2^n of a whole number n that stands in the last bits, as after a sum with 1.5 * 2^52.
inline Lane power_of_two(Lane rounded) {
  return each<Lane>([&](int k) { return (Pack)(((PackMask)rounded.part[k] + 1023) << 52); });
}

// NaN has many bit patterns, and CPUs differ in which they make; what is handed out has this one.
inline double canonical(double value) { return value == value ? value : __builtin_nan(""); }

inline bool any(LaneMask mask) {
  std::int64_t joined = 0;
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
