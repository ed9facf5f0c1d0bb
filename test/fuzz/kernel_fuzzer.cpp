// The kernel's doors under libFuzzer: any numbers, also those that are no numbers, in arrays of exactly the promised size.
//
// Beyond what the sanitizers watch: what is called solved is finite and inside its cone, and nothing takes long.
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <vector>

#include "interface.hpp"

namespace {

using namespace contact_curation;

// Takes numbers from the input: plain ones mostly, raw bytes of a double now and then.
class Source {
 public:
  Source(const std::uint8_t *data, std::size_t size) : data_(data), left_(size) {}
  std::uint8_t byte() { return left_ == 0 ? 0 : (--left_, *data_++); }
  double number() {
    const std::uint8_t kind = byte();
    if (kind % 8 == 7 && left_ >= 8) {
      double value;
      std::memcpy(&value, data_, 8);
      data_ += 8, left_ -= 8;
      return value;
    }
    if (kind % 8 == 6) return 0.0;
    const double whole = static_cast<double>(static_cast<std::int8_t>(byte()));
    return kind % 8 == 5 ? whole : whole / 64.0;
  }
  std::vector<double> numbers(std::size_t count) {
    std::vector<double> found(count);
    for (double &value : found) value = number();
    return found;
  }

 private:
  const std::uint8_t *data_;
  std::size_t left_;
};

void require(bool holds) {
  if (!holds) std::abort();
}

// Of a batch: mostly one or two, and now and then more than a vector register holds.
int batch(Source &source) { return 1 + source.byte() % (source.byte() % 8 == 7 ? 10 : 2); }

// Mostly as few iterations as sound problems need, which a problem without a solution uses up.
int most_iterations(Source &source) { return source.byte() % 8 == 7 ? 60 : 15; }

double weight(Source &source) { return std::fabs(source.number()) + 1e-9; }

void turn_to_unit(double *q) {  // Python refuses any other
  double length = 0.0;
  for (int k = 0; k < 4; ++k) length += q[k] * q[k];
  length = std::sqrt(length);
  if (!(length > 1e-100 && length < 1e100)) q[0] = 1.0, q[1] = q[2] = q[3] = 0.0, length = 1.0;
  for (int k = 0; k < 4; ++k) q[k] /= length;
}

void check_solved(const std::vector<double> &impulses, std::size_t row, int contacts, bool circular) {
  for (int i = 0; i < contacts; ++i) {
    const double *l = &impulses[(row * contacts + i) * 3];
    const double reach = std::sqrt(l[1] * l[1] + l[2] * l[2]), most = circular ? l[0] : l[0] / std::cos(M_PI / 8);
    require(std::isfinite(l[0]) && std::isfinite(reach));
    require(reach <= most + 1e-6 * (1.0 + std::fabs(l[0])));
  }
}

void evaluate(Source &source) {
  const int contacts = 1 + source.byte() % 9, count = batch(source);
  const std::vector<double> own = source.numbers(3 * contacts), tangent = source.numbers(3 * contacts);
  const std::vector<double> normal = source.numbers(3), tangents = source.numbers(6), period = source.numbers(count);
  std::vector<double> before = source.numbers(13 * count), after = source.numbers(13 * count);
  for (int n = 0; n < count; ++n) turn_to_unit(&before[13 * n + 3]), turn_to_unit(&after[13 * n + 3]);
  PolytopeModel model{};
  model.contacts = contacts;
  model.vertices_normal = own.data(), model.vertices_tangent = tangent.data();
  model.normal = normal.data(), model.tangents = tangents.data();
  for (double &value : model.pivot) value = source.number();
  model.height = source.number(), model.mass = weight(source), model.gravity = source.number();
  for (int k = 0; k < 3; ++k) model.inverse_inertia[4 * k] = weight(source), model.inertia[4 * k] = source.number();
  model.match_weight = weight(source), model.slack_weight = weight(source), model.regularization = weight(source);
  model.normal_weight = weight(source), model.tangent_weight = weight(source), model.cone_weight = weight(source);
  model.circular = source.byte() % 2;
  const double restitution = source.byte() / 255.0, *bounce = source.byte() % 2 ? &restitution : nullptr;
  const int parameters = parameter_count({model, bounce});
  const std::int64_t starts[3] = {0, source.byte() % (count + 1), count};
  std::vector<double> terms(kTerms * count), impulse(3 * contacts * count), score(parameters * count), residual(count);
  std::vector<double> fisher(2 * parameters * parameters), sums(2 * parameters);
  std::vector<std::int32_t> status(count), iterations(count);
  Evaluation job{before.data(),
                 after.data(),
                 period.data(),
                 starts,
                 2,
                 1,
                 source.byte() % 3,
                 most_iterations(source),
                 1e-7,
                 0.0,
                 terms.data(),
                 impulse.data(),
                 score.data(),
                 residual.data(),
                 status.data(),
                 iterations.data(),
                 fisher.data(),
                 sums.data()};
  job.influence_bound = source.byte() % 2 ? weight(source) : std::numeric_limits<double>::infinity();
  require(contact_curation_evaluate_bouncing(&model, &job, bounce) == 0);
  for (int n = 0; n < count; ++n)
    if (status[n] == kSolved) {
      require(residual[n] <= 1e-7);
      check_solved(impulse, n, contacts, model.circular);
    }
}

void solve(Source &source) {
  const int many = source.byte(), contacts = 1 + (many < 250 ? many % 6 : many % kMaxContacts), count = batch(source);
  const std::vector<double> jacobians = source.numbers(18 * contacts * count), inverse = source.numbers(36);
  const std::vector<double> gaps = source.numbers(contacts * count), next = source.numbers(contacts * count);
  const std::vector<double> free = source.numbers(6 * count), after = source.numbers(6 * count), dt = source.numbers(count);
  std::vector<double> impulses(3 * contacts * count), residuals(count);
  std::vector<std::int32_t> status(count), iterations(count);
  ConeBatch job{};
  job.batch = count, job.contacts = contacts, job.circular = source.byte() % 2, job.threads = 1;
  job.max_iterations = most_iterations(source), job.residual_tolerance = 1e-7;
  job.match_weight = weight(source), job.normal_weight = weight(source), job.tangent_weight = weight(source);
  job.cone_weight = weight(source), job.slack_weight = weight(source), job.regularization = weight(source);
  job.jacobians = jacobians.data(), job.inverse_mass = inverse.data(), job.gaps = gaps.data(), job.gaps_next = next.data();
  job.free_velocities = free.data(), job.velocities_next = after.data(), job.dt = dt.data();
  job.impulses = impulses.data(), job.residuals = residuals.data();
  job.status = status.data(), job.iterations = iterations.data();
  require(contact_curation_solve_cones(&job) == 0);
  for (int n = 0; n < count; ++n)
    if (status[n] == kSolved) check_solved(impulses, n, contacts, job.circular);
}

void step(Source &source) {
  const int contacts = 1 + source.byte() % 9, count = batch(source);
  std::vector<double> states = source.numbers(13 * count);
  for (int n = 0; n < count; ++n) turn_to_unit(&states[13 * n + 3]);
  const std::vector<double> dt = source.numbers(count), gaps = source.numbers(contacts * count);
  const std::vector<double> jacobians = source.numbers(18 * contacts * count);
  std::vector<double> impulses = source.numbers(3 * contacts * count), residual(count);
  std::vector<std::int32_t> status(count);
  stepping::Dynamics dynamics{};
  double inverse_inertia[9] = {};
  for (int k = 0; k < 3; ++k) inverse_inertia[4 * k] = weight(source);
  dynamics.inverse_inertia = dynamics.inertia = inverse_inertia;
  dynamics.inverse_mass = weight(source), dynamics.gravity = source.number();
  dynamics.tolerance = 1e-8, dynamics.max_sweeps = 4 * most_iterations(source);
  contact_given_step(&dynamics, count, contacts, dt.data(), gaps.data(), jacobians.data(), states.data(), impulses.data(),
                     status.data(), residual.data());
  for (int n = 0; n < count; ++n)
    if (status[n] != kNotFinite)
      for (int k = 0; k < 13; ++k) require(std::isfinite(states[13 * n + k]));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  Source source(data, size);
  const std::uint8_t door = source.byte() % 3;
  if (door == 0)
    evaluate(source);
  else if (door == 1)
    solve(source);
  else
    step(source);
  return 0;
}
