// One time step of each of a batch of states; contact/time_step.py calls it.
//
// Eight states are advanced at once, one SIMD lane each, by the sweeps of contact_sweeps.hpp, operation by operation, so that
// the bits are those of one state after the other. A lane that has converged waits for the others.
#include "time_step.hpp"

#include <vector>

#include "interface.hpp"
#include "polytope_transition.hpp"

namespace contact_curation::stepping {
namespace {

// Of a FrictionDisk, in eight lanes.
struct LaneDisk {
  Lane d00, d01, d11, largest;

  static LaneDisk of(Lane d00, Lane d01, Lane d11) {
    const Lane half = 0.5 * (d00 - d11);
    return {d00, d01, d11, 0.5 * (d00 + d11) + square_root(half * half + d01 * d01)};
  }

  // The minimisers where `wanted`, zero elsewhere.
  void solve(const Lane *b, Lane radius, LaneMask wanted, Lane *impulse) const {
    const Lane speed = square_root(b[0] * b[0] + b[1] * b[1]), floor = FrictionDisk::kFloorShare * largest;
    const Lane over = speed / radius - largest;
    Lane shift = select(floor < over, over, floor);
    impulse[0] = impulse[1] = broadcast(0.0);
    LaneMask searching = wanted & ~((radius <= 0.0) | (speed == 0.0));
    for (int iteration = 0; iteration < FrictionDisk::kNewtonSteps && any(searching); ++iteration) {
      const Lane first = d00 + shift, second = d11 + shift;
      const Lane determinant = first * second - d01 * d01;
      const Lane x = (d01 * b[1] - second * b[0]) / determinant, y = (d01 * b[0] - first * b[1]) / determinant;
      impulse[0] = select(searching, x, impulse[0]);
      impulse[1] = select(searching, y, impulse[1]);
      const Lane square = x * x + y * y;
      const Lane excess = square_root(square) / radius - 1.0;
      searching = searching & (excess > FrictionDisk::kRimTolerance);
      shift += excess * square * determinant / (second * x * x - 2.0 * d01 * x * y + first * y * y);
    }
  }
};

struct LaneContact {
  Lane row[3][6], response[3][6];  // as of ContactRows
  Lane gap_speed, normal_mobility;
  LaneDisk disk;
};

class LaneSteps {
 public:
  // Newton's restitution of every contact may be null.
  LaneSteps(const ContactWorld &world, const double *restitution)
      : world_(world), restitution_(restitution ? *restitution : 0.0), contacts_(static_cast<size_t>(world.vertices)),
        impulses_(contacts_.size()) {}

  // Advances eight states by dt; as of TimeStep::advance, one after the other.
  void advance(double *states, const double *dt, double *impulses, StepResult *results) {
    load(states, dt, impulses);
    for (size_t i = 0; i < contacts_.size(); ++i) build(static_cast<int>(i), contacts_[i]);
    solve();
    store(states, dt, impulses, results);
  }

 private:
  void load(const double *states, const double *dt, const double *impulses) {
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int k = 0; k < kStateSize; ++k) state_[k][lane] = states[kStateSize * lane + k];
      dt_[lane] = dt[lane];
      for (size_t i = 0; i < contacts_.size(); ++i)
        for (size_t a = 0; a < 3; ++a) impulses_[i].value[a][lane] = impulses[3 * (contacts_.size() * lane + i) + a];
    }
    rotation_matrix(state_ + 3, rotation_);
    for (int k = 0; k < 6; ++k) twist_[k] = state_[7 + k];
    twist_[2] -= world_.dynamics.gravity * dt_;
    if (!world_.dynamics.inertia) return;
    Lane turning[3];
    gyroscopic(world_.dynamics.inertia, world_.dynamics.inverse_inertia, state_ + 10, turning);
    for (int k = 0; k < 3; ++k) twist_[3 + k] -= dt_ * turning[k];
  }

  void build(int i, LaneContact &contact) const {
    const double *point = world_.vertices_normal + 3 * i, *tangent_point = world_.vertices_tangent + 3 * i;
    fill_row(world_.normal, point, contact.row[0], contact.response[0]);
    for (int t = 0; t < 2; ++t) fill_row(world_.tangents + 3 * t, tangent_point, contact.row[1 + t], contact.response[1 + t]);
    contact.gap_speed = gap(point) / dt_;
    contact.normal_mobility = dot(contact.row[0], contact.response[0]);
    contact.disk = LaneDisk::of(dot(contact.row[1], contact.response[1]), dot(contact.row[1], contact.response[2]),
                                dot(contact.row[2], contact.response[2]));
    if (!(restitution_ > 0.0)) return;
    const Lane approach = dot(contact.row[0], state_ + 7), bounced = restitution_ * approach;
    const LaneMask bounces = (approach < 0.0) & (contact.gap_speed + approach < 0.0) & (bounced < contact.gap_speed);
    contact.gap_speed = select(bounces, bounced, contact.gap_speed);
  }

  void fill_row(const double *direction, const double *point, Lane *row, Lane *response) const {
    Lane turned[3];
    for (int k = 0; k < 3; ++k) {
      turned[k] = rotation_[0][k] * direction[0] + rotation_[1][k] * direction[1] + rotation_[2][k] * direction[2];
      row[k] = broadcast(direction[k]);
    }
    row[3] = point[1] * turned[2] - point[2] * turned[1];
    row[4] = point[2] * turned[0] - point[0] * turned[2];
    row[5] = point[0] * turned[1] - point[1] * turned[0];
    const double *inverse = world_.dynamics.inverse_inertia;
    for (int k = 0; k < 3; ++k) {
      response[k] = world_.dynamics.inverse_mass * row[k];
      response[3 + k] = inverse[3 * k] * row[3] + inverse[3 * k + 1] * row[4] + inverse[3 * k + 2] * row[5];
    }
  }

  Lane gap(const double *point) const {
    Lane sum = broadcast(-world_.height);
    for (int k = 0; k < 3; ++k) {
      const Lane place = rotation_[k][0] * point[0] + rotation_[k][1] * point[1] + rotation_[k][2] * point[2] + state_[k];
      sum += world_.normal[k] * (place - world_.pivot[k]);
    }
    return sum;
  }

  static Lane dot(const Lane *a, const Lane *b) {
    Lane sum = broadcast(0.0);
    for (int k = 0; k < 6; ++k) sum += a[k] * b[k];
    return sum;
  }

  void push(const Lane *response, Lane amount, LaneMask where) {
    for (int k = 0; k < 6; ++k) twist_[k] = select(where, twist_[k] + amount * response[k], twist_[k]);
  }

  void solve() {
    const LaneMask all = broadcast(0.0) == 0.0;
    for (size_t i = 0; i < contacts_.size(); ++i)
      for (int a = 0; a < 3; ++a) push(contacts_[i].response[a], impulses_[i].value[a], all);
    change_ = broadcast(0.0);
    searching_ = all;
    for (std::int64_t sweep = 0; sweep < world_.dynamics.max_sweeps && any(searching_); ++sweep) {
      change_ = select(searching_, broadcast(0.0), change_);
      for (size_t i = 0; i < contacts_.size(); ++i) {
        update_normal(contacts_[i], impulses_[i].value);
        update_tangent(contacts_[i], impulses_[i].value);
      }
      searching_ = searching_ & ~(change_ <= world_.dynamics.tolerance);
    }
  }

  void update_normal(const LaneContact &contact, Lane *impulse) {
    const Lane speed = dot(contact.row[0], twist_) + contact.gap_speed, before = impulse[0];
    const LaneMask moving = searching_ & ~((before == 0.0) & (speed >= 0.0));
    if (!any(moving)) return;
    const Lane wanted = before - speed / contact.normal_mobility;
    impulse[0] = select(moving, select(0.0 < wanted, wanted, broadcast(0.0)), before);
    push(contact.response[0], impulse[0] - before, moving);
    note(absolute(impulse[0] - before) * contact.normal_mobility, moving);
  }

  void update_tangent(const LaneContact &contact, Lane *impulse) {
    const Lane before[2] = {impulse[1], impulse[2]};
    const LaneMask moving = searching_ & ~((impulse[0] == 0.0) & (before[0] == 0.0) & (before[1] == 0.0));
    if (!any(moving)) return;
    const LaneDisk &disk = contact.disk;
    const Lane b[2] = {
        dot(contact.row[1], twist_) - disk.d00 * before[0] - disk.d01 * before[1],
        dot(contact.row[2], twist_) - disk.d01 * before[0] - disk.d11 * before[1],
    };
    Lane found[2];
    disk.solve(b, impulse[0], moving, found);
    for (int t = 0; t < 2; ++t) impulse[1 + t] = select(moving, found[t], before[t]);
    const Lane first = impulse[1] - before[0], second = impulse[2] - before[1];
    push(contact.response[1], first, moving);
    push(contact.response[2], second, moving);
    note(square_root(first * first + second * second) * disk.largest, moving);
  }

  void note(Lane change, LaneMask where) { change_ = select(where & (change_ < change), change, change_); }

  void store(double *states, const double *dt, double *impulses, StepResult *results) const {
    for (int lane = 0; lane < kLanes; ++lane) {
      double twist[6];
      for (int k = 0; k < 6; ++k) twist[k] = twist_[k][lane];
      const StepStatus status = searching_[lane] ? kSweepsExhausted : kConverged;
      results[lane] = {all_finite(twist, 6) ? status : kNotFinite, change_[lane]};
      move(states + kStateSize * lane, twist, dt[lane]);
      for (size_t i = 0; i < contacts_.size(); ++i)
        for (size_t a = 0; a < 3; ++a) impulses[3 * (contacts_.size() * lane + i) + a] = impulses_[i].value[a][lane];
    }
  }

  struct Impulse {
    Lane value[3];
  };

  ContactWorld world_;
  double restitution_;
  std::vector<LaneContact> contacts_;
  std::vector<Impulse> impulses_;
  Lane state_[kStateSize], dt_, rotation_[3][3], twist_[6], change_;
  LaneMask searching_;
};

}  // namespace
}  // namespace contact_curation::stepping

extern "C" void contact_time_step(const contact_curation::stepping::ContactWorld *world, std::int64_t count, const double *dt,
                                  double *states, double *impulses, std::int32_t *status, double *residual) {
  contact_time_step_bouncing(world, nullptr, count, dt, states, impulses, status, residual);
}

extern "C" void contact_time_step_bouncing(const contact_curation::stepping::ContactWorld *world, const double *restitution,
                                           std::int64_t count, const double *dt, double *states, double *impulses,
                                           std::int32_t *status, double *residual) {
  using contact_curation::kLanes;
  using namespace contact_curation::stepping;
  TimeStep step(*world, restitution);
  LaneSteps eight(*world, restitution);
  const std::int64_t size = 3 * world->vertices;
  StepResult results[kLanes];
  for (std::int64_t first = 0; first < count;) {
    const bool whole = count - first >= kLanes;
    if (whole)
      eight.advance(states + first * kStateSize, dt + first, impulses + first * size, results);
    else
      results[0] = step.advance(states + first * kStateSize, dt[first], impulses + first * size);
    for (const std::int64_t end = first + (whole ? kLanes : 1), begin = first; first < end; ++first) {
      double *state = states + first * kStateSize;
      StepResult result = results[first - begin];
      if (result.status == kNotFinite || !all_finite(state, kStateSize))
        result = give_up(state, impulses + first * size, world->vertices);
      status[first] = result.status;
      residual[first] = result.residual;
    }
  }
}
