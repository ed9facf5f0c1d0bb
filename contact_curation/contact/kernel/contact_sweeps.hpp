// The impulses of one time step of a rigid body at K candidate contacts (method.md 4.2), impact without restitution (with it,
// `bounce`):
//
//     v' = v - g dt e3 + M^-1 J^T lambda,     0 <= lambda_n _|_ J_n v' + phi / dt >= 0,
//     lambda_t = argmin over ||lambda_t|| <= lambda_n of lambda_t . J_t v'      (Coulomb, friction coefficient inside J_t)
//     x' = x + dt v',    q' = q * exp(dt omega'),
//
// solved for lambda by projected Gauss-Seidel over the contacts with a true disk: normal before tangent, each exactly.
// Whoever knows gaps phi and Jacobians J fills them in: the polytope (time_step.hpp), or any other model (given_contacts.cpp).
// No contact is dropped: far ones cost one dot product a sweep. The spin precesses where an inertia is given.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "elementary.hpp"
#include "friction_disk.hpp"

namespace contact_curation::stepping {

constexpr int kStateSize = 13;  // x (3), q wxyz (4), v world (3), omega body (3)
constexpr int kTwist = 8;       // v (3), omega (3), padded to a full vector register

// What moves, and how well to solve for it; contact/time_step.py fills the same fields in the same order.
struct Dynamics {
  const double *inverse_inertia;  // (3, 3)
  const double *inertia;          // (3, 3); null without the gyroscopic term
  double inverse_mass;
  double gravity;
  double tolerance;  // on the largest change of a contact's own velocity within a sweep
  std::int64_t max_sweeps;
};

enum StepStatus : std::int32_t { kConverged = 0, kSweepsExhausted = 1, kNotFinite = 2 };

struct StepResult {
  StepStatus status;
  double residual;
};

struct alignas(64) ContactRows {
  double row[3][kTwist];       // J_n, J_t1, J_t2
  double response[3][kTwist];  // M^-1 times each
  double gap_speed;            // phi / dt
  double normal_mobility;      // J_n M^-1 J_n^T
  FrictionDisk disk;           // of J_t M^-1 J_t^T
};

inline double dot6(const double *a, const double *b) {
  double sum = 0.0;
  for (int k = 0; k < 6; ++k) sum += a[k] * b[k];
  return sum;
}

inline bool all_finite(const double *values, std::int64_t count) {
  for (std::int64_t k = 0; k < count; ++k) {
    if (!std::isfinite(values[k])) return false;
  }
  return true;
}

// Leaves a state and its contacts' impulses that are not finite as NaN in all numbers.
inline StepResult give_up(double *state, double *impulses, std::int64_t contacts) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::fill(state, state + kStateSize, nan);
  std::fill(impulses, impulses + 3 * contacts, nan);
  return {kNotFinite, nan};
}

// q <- q * exp(rotation), and back to unit norm, so that rounding cannot pile up.
inline void turn(double q[4], const double rotation[3]) {
  const double square = rotation[0] * rotation[0] + rotation[1] * rotation[1] + rotation[2] * rotation[2];
  const double angle = std::sqrt(square);
  const SineCosine half = sine_cosine(0.5 * angle);
  const double c = half.cosine;
  const double s = angle > 1e-8 ? half.sine / angle : 0.5;
  const double x = s * rotation[0], y = s * rotation[1], z = s * rotation[2];
  const double turned[4] = {
      q[0] * c - q[1] * x - q[2] * y - q[3] * z,
      q[0] * x + q[1] * c + q[2] * z - q[3] * y,
      q[0] * y - q[1] * z + q[2] * c + q[3] * x,
      q[0] * z + q[1] * y - q[2] * x + q[3] * c,
  };
  double norm = 0.0;
  for (double value : turned) norm += value * value;
  norm = std::sqrt(norm);
  for (int k = 0; k < 4; ++k) q[k] = turned[k] / norm;
}

// Moves a state for dt with a twist (6), its new one.
inline void move(double *state, const double *twist, double dt) {
  for (int k = 0; k < 3; ++k) state[k] += dt * twist[k];
  const double rotation[3] = {dt * twist[3], dt * twist[4], dt * twist[5]};
  turn(state + 3, rotation);
  for (int k = 0; k < 6; ++k) state[7 + k] = twist[k];
}

// Takes the rows of K contacts, then advances states with them.
class ContactSweeps {
 public:
  ContactSweeps(const Dynamics &dynamics, std::int64_t contacts)
      : dynamics_(dynamics), contacts_(static_cast<std::size_t>(contacts)) {}

  // Row a (normal, tangent 1, tangent 2) of contact i, to be filled in: 6 numbers.
  double *row(std::int64_t i, int a) { return contacts_[static_cast<std::size_t>(i)].row[a]; }

  // Makes contact i ready once its rows are filled in.
  void close(std::int64_t i, double gap, double dt) {
    ContactRows &contact = contacts_[static_cast<std::size_t>(i)];
    for (int a = 0; a < 3; ++a) {
      contact.row[a][6] = contact.row[a][7] = 0.0;
      respond(contact.row[a], contact.response[a]);
    }
    contact.gap_speed = gap / dt;
    contact.normal_mobility = dot6(contact.row[0], contact.response[0]);
    const double *second_response = contact.response[2];
    contact.disk = FrictionDisk::of(dot6(contact.row[1], contact.response[1]), dot6(contact.row[1], second_response),
                                    dot6(contact.row[2], second_response));
  }

  // Lets contact i, made ready, part with e times the speed that it comes with, if it closes within dt (Newton's law).
  void bounce(std::int64_t i, const double *twist, double restitution) {
    ContactRows &contact = contacts_[static_cast<std::size_t>(i)];
    double approach = 0.0;
    for (int k = 0; k < 6; ++k) approach += contact.row[0][k] * twist[k];
    if (approach < 0.0 && contact.gap_speed + approach < 0.0)
      contact.gap_speed = std::min(contact.gap_speed, restitution * approach);
  }

  // Advances `state` by dt. `impulses` (K, 3) holds the guess and then the answer, [normal, tangent 1, tangent 2].
  StepResult advance(double *state, double dt, double *impulses) {
    std::array<double, kTwist> twist{};
    for (int k = 0; k < 6; ++k) twist[k] = state[7 + k];
    twist[2] -= dynamics_.gravity * dt;
    if (dynamics_.inertia) {
      double turning[3];
      gyroscopic(dynamics_.inertia, dynamics_.inverse_inertia, state + 10, turning);
      for (int k = 0; k < 3; ++k) twist[3 + k] -= dt * turning[k];
    }
    const StepResult result = solve(twist.data(), impulses);
    move(state, twist.data(), dt);
    return result;
  }

 private:
  // M^-1 row.
  void respond(const double *row, double *response) const {
    const double *inverse = dynamics_.inverse_inertia;
    for (int k = 0; k < 3; ++k) {
      response[k] = dynamics_.inverse_mass * row[k];
      response[3 + k] = inverse[3 * k] * row[3] + inverse[3 * k + 1] * row[4] + inverse[3 * k + 2] * row[5];
    }
    response[6] = response[7] = 0.0;
  }

  StepResult solve(double *twist, double *impulses) {
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      for (std::size_t a = 0; a < 3; ++a) push(contacts_[i].response[a], impulses[3 * i + a], twist);
    }
    double change = 0.0;
    StepStatus status = kSweepsExhausted;
    for (std::int64_t sweep = 0; sweep < dynamics_.max_sweeps && status == kSweepsExhausted; ++sweep) {
      change = 0.0;
      for (std::size_t i = 0; i < contacts_.size(); ++i) {
        change = std::max(change, update_normal(contacts_[i], impulses + 3 * i, twist));
        change = std::max(change, update_tangent(contacts_[i], impulses + 3 * i, twist));
      }
      if (change <= dynamics_.tolerance) status = kConverged;
    }
    return {all_finite(twist, kTwist) ? status : kNotFinite, change};
  }

  static void push(const double *response, double amount, double *twist) {
    for (int k = 0; k < kTwist; ++k) twist[k] += amount * response[k];
  }

  static double update_normal(const ContactRows &contact, double *impulse, double *twist) {
    const double speed = dot6(contact.row[0], twist) + contact.gap_speed;
    const double before = impulse[0];
    if (before == 0.0 && speed >= 0.0) return 0.0;
    impulse[0] = std::max(0.0, before - speed / contact.normal_mobility);
    push(contact.response[0], impulse[0] - before, twist);
    return std::fabs(impulse[0] - before) * contact.normal_mobility;
  }

  static double update_tangent(const ContactRows &contact, double *impulse, double *twist) {
    const double before[2] = {impulse[1], impulse[2]};
    if (impulse[0] == 0.0 && before[0] == 0.0 && before[1] == 0.0) return 0.0;
    const FrictionDisk &disk = contact.disk;
    const double b[2] = {
        dot6(contact.row[1], twist) - disk.d00 * before[0] - disk.d01 * before[1],
        dot6(contact.row[2], twist) - disk.d01 * before[0] - disk.d11 * before[1],
    };
    disk.solve(b, impulse[0], impulse + 1);
    const double first = impulse[1] - before[0], second = impulse[2] - before[1];
    push(contact.response[1], first, twist);
    push(contact.response[2], second, twist);
    return std::sqrt(first * first + second * second) * disk.largest;
  }

  Dynamics dynamics_;
  std::vector<ContactRows> contacts_;
};

}  // namespace contact_curation::stepping
