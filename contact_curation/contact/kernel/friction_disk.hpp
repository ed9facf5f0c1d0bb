// The friction impulse of one contact when all others stand still: maximum dissipation over a disk,
//
//     minimise  1/2 l^T D l + b^T l   subject to  ||l|| <= radius,
//
// with D = J_t M^-1 J_t^T (2x2, positive semidefinite) and b the sliding velocity without this impulse. Inside the disk the
// contact sticks, on its rim it slides against the velocity. The rim is found as in a trust region, by Newton on
// 1/||l(s)|| = 1/radius with l(s) = -(D + s I)^-1 b (More and Sorensen, SIAM J. Sci. Stat.
// Comput. 4, 1983), monotone from the left.
#pragma once

#include <algorithm>
#include <cmath>

namespace contact_curation::stepping {

struct FrictionDisk {
  static constexpr double kFloorShare = 1e-10;  // keeps a flat direction of D finite
  static constexpr double kRimTolerance = 1e-12;
  static constexpr int kNewtonSteps = 30;

  double d00, d01, d11;
  double largest;  // eigenvalue of D

  static FrictionDisk of(double d00, double d01, double d11) {
    const double half = 0.5 * (d00 - d11);
    return {d00, d01, d11, 0.5 * (d00 + d11) + std::sqrt(half * half + d01 * d01)};
  }

  // Overwrites `impulse` with the minimiser.
  void solve(const double b[2], double radius, double impulse[2]) const {
    const double speed = std::sqrt(b[0] * b[0] + b[1] * b[1]);
    impulse[0] = impulse[1] = 0.0;
    if (radius <= 0.0 || speed == 0.0) return;
    double shift = std::max(kFloorShare * largest, speed / radius - largest);
    for (int iteration = 0; iteration < kNewtonSteps; ++iteration) {
      const double first = d00 + shift, second = d11 + shift;
      const double determinant = first * second - d01 * d01;
      impulse[0] = (d01 * b[1] - second * b[0]) / determinant;
      impulse[1] = (d01 * b[0] - first * b[1]) / determinant;
      const double square = impulse[0] * impulse[0] + impulse[1] * impulse[1];
      const double excess = std::sqrt(square) / radius - 1.0;
      if (!(excess > kRimTolerance)) break;
      const double x = impulse[0], y = impulse[1];
      shift += excess * square * determinant / (second * x * x - 2.0 * d01 * x * y + first * y * y);
    }
  }
};

}  // namespace contact_curation::stepping
