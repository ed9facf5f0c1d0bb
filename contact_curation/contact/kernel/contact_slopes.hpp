// The loss of one transition at contacts that somebody else evaluated, with its slopes by gaps and Jacobians (method.md 1.2),
// as in contact/loss_slopes.py.
#pragma once

#include "cone_batch.hpp"
#include "interior_point.hpp"
#include "polytope_rows.hpp"

namespace contact_curation {

// One transition as it was measured.
struct Frame {
  double rotation[3][3], rotation_next[3][3], position[3], position_next[3];
  double velocity[6], free_velocity[6], velocity_next[6], dt;

  void load(const PolytopeModel &model, const Evaluation &rows, int64_t row) {
    const double *before = rows.before + 13 * row, *after = rows.after + 13 * row;
    turn(before + 3, rotation);
    turn(after + 3, rotation_next);
    for (int a = 0; a < 3; ++a) position[a] = before[a], position_next[a] = after[a];
    for (int a = 0; a < 6; ++a) velocity[a] = free_velocity[a] = before[7 + a], velocity_next[a] = after[7 + a];
    dt = rows.dt[row];
    free_velocity[2] -= model.gravity * dt;
  }

 private:
  static void turn(const double *quaternion, double (*r)[3]) {
    Lane q[4], matrix[3][3];
    for (int k = 0; k < 4; ++k) q[k] = broadcast(quaternion[k]);
    rotation_matrix(q, matrix);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) r[a][b] = matrix[a][b][0];
  }
};

// Numbers of K contacts, or slopes by them.
struct ContactNumbers {
  double gap[kMaxContacts], gap_next[kMaxContacts], jacobian[kMaxContacts][3][6];
};

inline double dot6(const double *a, const double *b) {
  double sum = 0.0;
  for (int k = 0; k < 6; ++k) sum += a[k] * b[k];
  return sum;
}

class ContactSlopes {
 public:
  ContactNumbers slopes;
  double loss = 0.0;

  // Says whether the impulses carry a certificate and the loss is finite; only then are there slopes.
  bool find(const PolytopeModel &model, const Evaluation &rows, const Frame &at, const ContactNumbers &contacts) {
    double inverse_mass[36] = {};
    for (int a = 0; a < 3; ++a) {
      inverse_mass[7 * a] = 1.0 / model.mass;
      for (int b = 0; b < 3; ++b) inverse_mass[6 * (3 + a) + 3 + b] = model.inverse_inertia[3 * a + b];
    }
    solve_one(model, rows, at, contacts, inverse_mass);
    double l[kMaxContacts][3], push[6] = {}, reached[6], missed[6], pull[6], returned[6] = {};
    for (int i = 0; i < model.contacts; ++i)
      for (int c = 0; c < 3; ++c) {
        l[i][c] = solution_.impulse[i][c][0];
        for (int a = 0; a < 6; ++a) push[a] += l[i][c] * contacts.jacobian[i][c][a];
      }
    loss = 0.0;
    for (int a = 0; a < 6; ++a) {
      reached[a] = at.free_velocity[a] + dot6(inverse_mass + 6 * a, push);
      missed[a] = reached[a] - at.velocity_next[a];
      pull[a] = 2.0 * model.match_weight * missed[a];
      loss += model.match_weight * missed[a] * missed[a];
    }
    double approach[kMaxContacts];
    for (int i = 0; i < model.contacts; ++i) {
      const double *normal = contacts.jacobian[i][0], predicted = contacts.gap[i] + at.dt * dot6(normal, reached);
      const double inside = predicted >= 0.0 ? 0.0 : predicted;
      loss += model.slack_weight * inside * inside;
      slopes.gap[i] = 2.0 * model.slack_weight * inside;
      approach[i] = at.dt * slopes.gap[i];
      for (int a = 0; a < 6; ++a) pull[a] += approach[i] * normal[a];
    }
    for (int a = 0; a < 6; ++a)
      for (int b = 0; b < 6; ++b) returned[b] += pull[a] * inverse_mass[6 * a + b];
    for (int i = 0; i < model.contacts; ++i) {
      const double gap = contacts.gap_next[i], *tangent = l[i] + 1;
      const double open =
          model.normal_weight * l[i][0] * l[i][0] + model.tangent_weight * (tangent[0] * tangent[0] + tangent[1] * tangent[1]);
      loss += gap * gap * open;
      slopes.gap_next[i] = 2.0 * gap * open;
      double slip[2], against[2];
      for (int t = 0; t < 2; ++t) slip[t] = dot6(contacts.jacobian[i][1 + t], at.velocity_next);
      const double speed = std::sqrt(slip[0] * slip[0] + slip[1] * slip[1]);
      for (int t = 0; t < 2; ++t) {
        against[t] = l[i][0] * slip[t] + speed * tangent[t];
        loss += model.cone_weight * against[t] * against[t];
      }
      const double turning = speed > 0.0 ? (against[0] * tangent[0] + against[1] * tangent[1]) / speed : 0.0;
      for (int a = 0; a < 6; ++a) {
        slopes.jacobian[i][0][a] = l[i][0] * returned[a] + approach[i] * reached[a];
        for (int t = 0; t < 2; ++t) {
          const double rubbing = 2.0 * model.cone_weight * (l[i][0] * against[t] + turning * slip[t]);
          slopes.jacobian[i][1 + t][a] = tangent[t] * returned[a] + rubbing * at.velocity_next[a];
        }
      }
    }
    return solution_.solved[0] && std::isfinite(solution_.residual[0]) && std::isfinite(loss);
  }

 private:
  void solve_one(const PolytopeModel &model, const Evaluation &rows, const Frame &at, const ContactNumbers &contacts,
                 const double *inverse_mass) {
    ConeBatch one{};
    one.batch = 1;
    one.contacts = model.contacts;
    one.circular = model.circular;
    one.match_weight = model.match_weight, one.slack_weight = model.slack_weight, one.regularization = model.regularization;
    one.normal_weight = model.normal_weight, one.tangent_weight = model.tangent_weight, one.cone_weight = model.cone_weight;
    one.jacobians = contacts.jacobian[0][0];
    one.inverse_mass = inverse_mass;
    one.gaps = contacts.gap, one.gaps_next = contacts.gap_next;
    one.free_velocities = at.free_velocity, one.velocities_next = at.velocity_next;
    one.dt = &at.dt;
    SolverOptions options;
    options.max_iterations = rows.max_iterations;
    options.residual_tolerance = rows.residual_tolerance;
    pose(one, 0, 1, problem_);
    solve(problem_, options, solution_);
  }

  ConeProblem problem_;
  ConeSolution solution_;
};

}  // namespace contact_curation
