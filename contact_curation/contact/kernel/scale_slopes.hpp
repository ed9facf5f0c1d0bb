// Slopes of what keeps theta's scale in place (contact/scale_regularizer.py).
#pragma once

#include <algorithm>
#include <cmath>

namespace contact_curation {

inline double dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Adds the slopes of (|n| - 1)^2 + sum_a (u . u_a)^2, u and u_a unit vectors along the normal and the tangents, times a weight.
// Tangents and their slopes lie so many numbers apart.
inline void add_scale_slopes(const double *normal, const double *tangents, int apart, double weight, double *by_normal,
                             double *by_tangents) {
  constexpr double kSmallest = 1e-12;  // a shorter one has no direction
  const double size = std::sqrt(dot3(normal, normal)), length = std::max(size, kSmallest);
  double unit[3], pull[3];
  for (int a = 0; a < 3; ++a) unit[a] = normal[a] / length, pull[a] = (size - 1.0) * unit[a];
  for (int t = 0; t < 2; ++t) {
    const double *tangent = tangents + apart * t;
    const double width = std::max(std::sqrt(dot3(tangent, tangent)), kSmallest);
    double across[3];
    for (int a = 0; a < 3; ++a) across[a] = tangent[a] / width;
    const double overlap = dot3(unit, across);
    for (int a = 0; a < 3; ++a) {
      pull[a] += overlap * (across[a] - overlap * unit[a]) / length;
      by_tangents[apart * t + a] += weight * 2.0 * overlap * (unit[a] - overlap * across[a]) / width;
    }
  }
  for (int a = 0; a < 3; ++a) by_normal[a] += weight * 2.0 * pull[a];
}

}  // namespace contact_curation
