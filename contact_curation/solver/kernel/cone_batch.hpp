// Inner problems of any contact model as gaps and Jacobians pose them.
#pragma once

#include <algorithm>
#include <cstdint>

#include "cone_problem.hpp"

namespace contact_curation {

// Mirrored by ctypes. B problems of K contacts.
struct ConeBatch {
  int64_t batch;
  int32_t contacts;
  int32_t circular;
  int32_t threads;
  int32_t max_iterations;
  double residual_tolerance;
  double match_weight, normal_weight, tangent_weight, cone_weight, slack_weight, regularization;
  const double *jacobians;        // (B, K, 3, 6)
  const double *inverse_mass;     // (6, 6)
  const double *gaps;             // (B, K)
  const double *gaps_next;        // (B, K)
  const double *free_velocities;  // (B, 6)
  const double *velocities_next;  // (B, 6)
  const double *dt;               // (B,)
  double *impulses;               // (B, K, 3)
  double *residuals;              // (B,)
  int32_t *status;                // (B,)
  int32_t *iterations;            // (B,)
};

// Reads problems first .. first + 7, the last one repeated past `end`.
inline void pose(const ConeBatch &job, int64_t first, int64_t end, ConeProblem &problem) {
  int64_t row[kLanes];
  for (int lane = 0; lane < kLanes; ++lane) row[lane] = std::min<int64_t>(first + lane, end - 1);
  const auto gather = [&](const double *from, int width, int at) {
    Lane value;
    for (int lane = 0; lane < kLanes; ++lane) value[lane] = from[row[lane] * width + at];
    return value;
  };
  problem.contacts = job.contacts;
  problem.circular = job.circular != 0;
  problem.match_weight = job.match_weight;
  problem.slack_weight = job.slack_weight;
  problem.regularization = job.regularization;
  const Lane dt = gather(job.dt, 1, 0);
  Lane free_velocity[6], velocity_next[6];
  for (int a = 0; a < 6; ++a) {
    free_velocity[a] = gather(job.free_velocities, 6, a);
    velocity_next[a] = gather(job.velocities_next, 6, a);
    problem.target[a] = velocity_next[a] - free_velocity[a];
  }
  for (int i = 0; i < job.contacts; ++i) {
    Lane slip[2];
    for (int c = 0; c < 3; ++c) {
      Lane jacobian[6];
      for (int a = 0; a < 6; ++a) jacobian[a] = gather(job.jacobians, 18 * job.contacts, (3 * i + c) * 6 + a);
      for (int a = 0; a < 6; ++a) {
        problem.motion[i][c][a] = broadcast(0.0);
        for (int b = 0; b < 6; ++b) problem.motion[i][c][a] += job.inverse_mass[6 * a + b] * jacobian[b];
        if (c == 0) problem.slack_row[i][a] = dt * jacobian[a];
      }
      if (c > 0) slip[c - 1] = dot<6>(jacobian, velocity_next);
    }
    problem.slack_offset[i] = gather(job.gaps, job.contacts, i) + dot<6>(problem.slack_row[i], free_velocity);
    set_block(job.normal_weight, job.tangent_weight, job.cone_weight, gather(job.gaps_next, job.contacts, i), slip,
              problem.block[i]);
  }
}

}  // namespace contact_curation
