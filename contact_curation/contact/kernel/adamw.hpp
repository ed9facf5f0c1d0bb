// AdamW as torch takes it, on arrays in place.
//
//   m <- b1 m + (1 - b1) g      v <- b2 v + (1 - b2) g^2      c = 1 - b^t
//   x <- (1 - rate decay) x - rate (m / c1) / (sqrt(v / c2) + e)
//
// Networks spend most of a step on roots and quotients; the quotient by sqrt(c2) is taken out of the sum.
#pragma once

#include <cmath>
#include <cstdint>

#include "elementary.hpp"

namespace contact_curation {

// What corrects the moments after so many steps, c1 and sqrt(c2).
struct Corrections {
  double first, root_of_second;

  Corrections(double first_beta, double second_beta, std::int64_t steps)
      : first(1.0 - whole_power(first_beta, steps)), root_of_second(std::sqrt(1.0 - whole_power(second_beta, steps))) {}
};

struct AdamW {
  double shrinkage, first_beta, second_beta;
  double stride, epsilon;  // rate sqrt(c2) / c1, e sqrt(c2)

  AdamW(double rate, double decay, double first_beta, double second_beta, double epsilon, const Corrections &corrections)
      : shrinkage(rate * decay), first_beta(first_beta), second_beta(second_beta),
        stride(rate * corrections.root_of_second / corrections.first), epsilon(epsilon * corrections.root_of_second) {}

  void step(double *__restrict theta, double *__restrict first, double *__restrict second, const double *__restrict slopes,
            int64_t count) const {
    for (int64_t k = 0; k < count; ++k) {
      first[k] += (1.0 - first_beta) * (slopes[k] - first[k]);
      second[k] = second_beta * second[k] + (1.0 - second_beta) * slopes[k] * slopes[k];
      theta[k] -= shrinkage * theta[k];
      theta[k] -= stride * first[k] / (std::sqrt(second[k]) + epsilon);
    }
  }
};

}  // namespace contact_curation
