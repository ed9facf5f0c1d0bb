// Elementary functions of many numbers, so that tests can see them.
#include "elementary.hpp"

#include <algorithm>

#include "interface.hpp"

using namespace contact_curation;

extern "C" void contact_curation_elementary(int64_t count, const double *x, double *sines, double *cosines, double *tangents) {
  for (int64_t first = 0; first < count; first += kLanes) {
    const int64_t lanes = std::min<int64_t>(kLanes, count - first);
    Lane values{};
    for (int64_t lane = 0; lane < lanes; ++lane) values[lane] = x[first + lane];
    const Lane tangent = hyperbolic_tangent(values);
    for (int64_t lane = 0; lane < lanes; ++lane) {
      const SineCosine both = sine_cosine(values[lane]);
      sines[first + lane] = canonical(both.sine);
      cosines[first + lane] = canonical(both.cosine);
      tangents[first + lane] = canonical(tangent[lane]);
    }
  }
}

extern "C" void contact_curation_powers(int64_t count, const double *bases, const int64_t *exponents, double *powers) {
  for (int64_t k = 0; k < count; ++k) powers[k] = whole_power(bases[k], exponents[k]);
}
