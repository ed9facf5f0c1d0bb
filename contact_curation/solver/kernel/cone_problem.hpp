// The inner problem of method.md 1.3 as data, and the certificate by which a solution proves itself.
//
//   minimise  w_m |A l - b|^2 + sum_i l_i^T D_i l_i + eps |l|^2 + w_s sum_j min(0, c_j + B_j A l)^2
//   over      l_i = (normal, tangent1, tangent2) in the friction cone |tangent| <= normal (or a polyhedral cone around it)
//
// A is 6 x 3K and everything outside the 3x3 blocks D_i acts through A l in R^6 (method.md 4.1).
#pragma once

#include "lanes.hpp"

namespace contact_curation {

constexpr int kMaxContacts = 64;
constexpr int kFacets = 8;

struct ConeProblem {
  int contacts = 0;
  bool circular = true;
  double match_weight = 0.1;
  double slack_weight = 1.0;
  double regularization = 1e-6;
  Lane motion[kMaxContacts][3][6];  // columns of A: velocity change by a unit impulse
  Lane slack_row[kMaxContacts][6];  // B_j
  Lane slack_offset[kMaxContacts];  // c_j
  Lane target[6];                   // b
  Lane block[kMaxContacts][6];      // D_i: 00 01 02 11 12 22
};

struct ConeSolution {
  Lane impulse[kMaxContacts][3];
  Lane residual;       // natural residual |l - proj(l - gradient)|_inf
  LaneMask solved;     // residual within tolerance
  int iterations = 0;  // of the slowest lane
};

enum Status { kSolved = 0, kNotSolved = 1, kNotFinite = 2 };

struct SolverOptions {
  int max_iterations = 60;
  double complementarity_tolerance = 1e-15;
  double facet_complementarity_tolerance = 1e-14;
  double stationarity_tolerance = 1e-9;
  double residual_tolerance = 1e-7;
};

// The polyhedral cone of ContactNets' loss: tangent . d_k <= normal for eight directions d_k, 45 degrees apart, so the octagon
// stands around the friction disk. A facet is the row (1, -d_k).
struct Facet {
  double row[3];
};
inline Facet polyhedral_facet(int k) {
  constexpr double h = 0x1.6a09e667f3bcdp-1;  // sqrt(1/2)
  constexpr double cosine[kFacets] = {1.0, h, 0.0, -h, -1.0, -h, 0.0, h};
  return {{1.0, -cosine[k], -cosine[(k + kFacets - 2) % kFacets]}};
}

// D_i = phi'^2 diag(w_n, w_t, w_t) + w_c C^T C with C = [s, |s| I]; returns |s|.
inline Lane set_block(double normal_weight, double tangent_weight, double cone_weight, Lane gap_next, const Lane *slip,
                      Lane *block) {
  const Lane squared = slip[0] * slip[0] + slip[1] * slip[1], speed = square_root(squared);
  const Lane closed = gap_next * gap_next, coned = cone_weight * squared;
  block[0] = normal_weight * closed + coned;
  block[1] = cone_weight * speed * slip[0];
  block[2] = cone_weight * speed * slip[1];
  block[3] = block[5] = tangent_weight * closed + coned;
  block[4] = broadcast(0.0);
  return speed;
}

inline void block_times(const Lane *block, const Lane *x, Lane *y) {
  y[0] = block[0] * x[0] + block[1] * x[1] + block[2] * x[2];
  y[1] = block[1] * x[0] + block[3] * x[1] + block[4] * x[2];
  y[2] = block[2] * x[0] + block[4] * x[1] + block[5] * x[2];
}

// A l, the change of velocity that the impulses cause.
inline void velocity_change(const ConeProblem &problem, const Lane (*impulse)[3], Lane *change) {
  for (int k = 0; k < 6; ++k) change[k] = broadcast(0.0);
  for (int i = 0; i < problem.contacts; ++i)
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 6; ++k) change[k] += problem.motion[i][c][k] * impulse[i][c];
}

// Gradient of the objective, slack eliminated.
inline void objective_gradient(const ConeProblem &problem, const Lane (*impulse)[3], Lane (*gradient)[3]) {
  Lane change[6], pull[6];
  velocity_change(problem, impulse, change);
  for (int k = 0; k < 6; ++k) pull[k] = 2.0 * problem.match_weight * (change[k] - problem.target[k]);
  for (int j = 0; j < problem.contacts; ++j) {
    const Lane slack = negative_part(problem.slack_offset[j] + dot<6>(problem.slack_row[j], change));
    for (int k = 0; k < 6; ++k) pull[k] += 2.0 * problem.slack_weight * slack * problem.slack_row[j][k];
  }
  for (int i = 0; i < problem.contacts; ++i) {
    Lane curved[3];
    block_times(problem.block[i], impulse[i], curved);
    for (int c = 0; c < 3; ++c)
      gradient[i][c] = dot<6>(problem.motion[i][c], pull) + 2.0 * (curved[c] + problem.regularization * impulse[i][c]);
  }
}

// Euclidean projection on the circular cone |tangent| <= normal.
inline void project_circular(const Lane *x, Lane *projected) {
  const Lane radius = square_root(x[1] * x[1] + x[2] * x[2]);
  const Lane along = 0.5 * (x[0] + radius);
  const Lane share = along / select(radius > 0.0, radius, broadcast(1.0));
  const LaneMask inside = radius <= x[0];
  const LaneMask polar = radius <= -x[0];
  projected[0] = select(inside, x[0], select(polar, broadcast(0.0), along));
  for (int c = 1; c < 3; ++c) projected[c] = select(inside, x[c], select(polar, broadcast(0.0), share * x[c]));
}

}  // namespace contact_curation
