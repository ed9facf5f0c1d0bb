// AdamW as torch takes it, on arrays in place.
//
//   m <- b1 m + (1 - b1) g      v <- b2 v + (1 - b2) g^2      x <- (1 - rate decay) x - rate (m / c1) / (sqrt(v / c2) + e),  c = 1 - b^t
#pragma once

#include <cmath>
#include <cstdint>

namespace contact_curation {

struct AdamW {
  double rate, decay, first_beta, second_beta, epsilon;
  double stride, scale;  // rate / c1, sqrt(c2)

  // The step after which the moments have seen so many.
  AdamW(double rate, double decay, double first_beta, double second_beta, double epsilon, double seen)
      : rate(rate), decay(decay), first_beta(first_beta), second_beta(second_beta), epsilon(epsilon),
        stride(rate / (1.0 - std::pow(first_beta, seen))), scale(std::sqrt(1.0 - std::pow(second_beta, seen))) {}

  void step(double *__restrict theta, double *__restrict first, double *__restrict second, const double *__restrict slopes,
            int64_t count) const {
    const double inverse = 1.0 / scale;
    for (int64_t k = 0; k < count; ++k) {
      first[k] += (1.0 - first_beta) * (slopes[k] - first[k]);
      second[k] = second_beta * second[k] + (1.0 - second_beta) * slopes[k] * slopes[k];
      theta[k] -= rate * decay * theta[k];
      theta[k] -= stride * first[k] / (over_scale(std::sqrt(second[k]), inverse) + epsilon);
    }
  }

 private:
  // root / scale to the last bit, where fused products are fast: a product, mended by its remainder (Markstein 1990). Networks spend
  // most of a step on roots and quotients.
  double over_scale(double root, [[maybe_unused]] double inverse) const {
#ifdef FP_FAST_FMA
    const double quotient = root * inverse;
    return std::fma(std::fma(-quotient, scale, root), inverse, quotient);
#else
    return root / scale;
#endif
  }
};

}  // namespace contact_curation
