// One time step of a polytope over a plane (method.md 1.1, 4.2): its gaps and Jacobians, and then contact_sweeps.hpp.
//
//     phi_i = n . (R p_i + x - pivot) - height      J_n,i = [n, p_i x R^T n]      J_t,i,a = [T_a, p^t_i x R^T T_a]
#pragma once

#include "contact_sweeps.hpp"

namespace contact_curation::stepping {

// The model, and what moves; contact/time_step.py fills the same fields in the same order.
struct ContactWorld {
  std::int64_t vertices;
  const double *vertices_normal;   // (V, 3)
  const double *normal;            // (3)
  const double *vertices_tangent;  // (V, 3)
  const double *tangents;          // (2, 3)
  const double *pivot;             // (3)
  double height;
  Dynamics dynamics;
};

inline void rotation_matrix(const double q[4], double r[9]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  r[0] = 1 - 2 * (y * y + z * z), r[1] = 2 * (x * y - w * z), r[2] = 2 * (x * z + w * y);
  r[3] = 2 * (x * y + w * z), r[4] = 1 - 2 * (x * x + z * z), r[5] = 2 * (y * z - w * x);
  r[6] = 2 * (x * z - w * y), r[7] = 2 * (y * z + w * x), r[8] = 1 - 2 * (x * x + y * y);
}

class TimeStep {
 public:
  // Newton's restitution of every contact may be null.
  TimeStep(const ContactWorld &world, const double *restitution)
      : world_(world), restitution_(restitution ? *restitution : 0.0), sweeps_(world.dynamics, world.vertices) {}

  // Advances `state` by dt. `impulses` (V, 3) holds the guess and then the answer, [normal, tangent 1, tangent 2].
  StepResult advance(double *state, double dt, double *impulses) {
    build_contacts(state, dt);
    return sweeps_.advance(state, dt, impulses);
  }

 private:
  // Row [d, p x R^T d] of a world direction d that acts at body point p.
  static void fill_row(const double *direction, const double *point, const double *r, double *row) {
    double turned[3];
    for (int k = 0; k < 3; ++k) turned[k] = r[k] * direction[0] + r[3 + k] * direction[1] + r[6 + k] * direction[2];
    for (int k = 0; k < 3; ++k) row[k] = direction[k];
    row[3] = point[1] * turned[2] - point[2] * turned[1];
    row[4] = point[2] * turned[0] - point[0] * turned[2];
    row[5] = point[0] * turned[1] - point[1] * turned[0];
  }

  double gap(const double *state, const double *r, const double *point) const {
    double sum = -world_.height;
    for (int k = 0; k < 3; ++k) {
      const double world = r[3 * k] * point[0] + r[3 * k + 1] * point[1] + r[3 * k + 2] * point[2] + state[k];
      sum += world_.normal[k] * (world - world_.pivot[k]);
    }
    return sum;
  }

  void build_contacts(const double *state, double dt) {
    double r[9];
    rotation_matrix(state + 3, r);
    for (std::int64_t i = 0; i < world_.vertices; ++i) {
      const double *normal_point = world_.vertices_normal + 3 * i;
      const double *tangent_point = world_.vertices_tangent + 3 * i;
      fill_row(world_.normal, normal_point, r, sweeps_.row(i, 0));
      fill_row(world_.tangents, tangent_point, r, sweeps_.row(i, 1));
      fill_row(world_.tangents + 3, tangent_point, r, sweeps_.row(i, 2));
      sweeps_.close(i, gap(state, r, normal_point), dt);
      if (restitution_ > 0.0) sweeps_.bounce(i, state + 7, restitution_);
    }
  }

  ContactWorld world_;
  double restitution_;
  ContactSweeps sweeps_;
};

}  // namespace contact_curation::stepping
