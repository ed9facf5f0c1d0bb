// Rollouts of a batch of initial states, over threads; contact/rollout.py calls it.
#include <atomic>
#include <cstring>
#include <limits>
#include <system_error>
#include <thread>
#include <vector>

#include "interface.hpp"

namespace {

using namespace contact_curation::stepping;

// Newton's law reverses a speed at the beginning of a step: short steps put that near to where the bodies meet.
constexpr int kStepsOfBounces = 8;

struct Batch {
  const double *initial;        // (B, 13)
  const std::int64_t *offsets;  // (B + 1)
  const double *dt;             // (B)
  double *states;               // (N, 13)
  double *impulses;             // (N, V, 3), or null
  std::int32_t *status;         // (N)
  double *residual;             // (N)
};

void give_up_rows(const Batch &batch, std::int64_t row, std::int64_t end, std::int64_t impulse_size) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::fill(batch.states + row * kStateSize, batch.states + end * kStateSize, nan);
  if (batch.impulses) std::fill(batch.impulses + row * impulse_size, batch.impulses + end * impulse_size, nan);
  std::fill(batch.status + row, batch.status + end, kNotFinite);
  std::fill(batch.residual + row, batch.residual + end, nan);
}

void roll_out_one(TimeStep &step, const Batch &batch, std::int64_t b, int steps, std::vector<double> &impulses) {
  const auto impulse_size = static_cast<std::int64_t>(impulses.size());
  const std::int64_t begin = batch.offsets[b], end = batch.offsets[b + 1];
  double state[kStateSize];
  std::memcpy(state, batch.initial + b * kStateSize, sizeof state);
  std::fill(impulses.begin(), impulses.end(), 0.0);
  StepResult result{kConverged, 0.0};
  for (std::int64_t row = begin; row < end; ++row) {
    for (int k = 0; k < steps && row > begin && result.status != kNotFinite; ++k)
      result = step.advance(state, batch.dt[b] / steps, impulses.data());
    if (result.status == kNotFinite || !all_finite(state, kStateSize)) return give_up_rows(batch, row, end, impulse_size);
    std::memcpy(batch.states + row * kStateSize, state, sizeof state);
    if (batch.impulses) std::copy(impulses.begin(), impulses.end(), batch.impulses + row * impulse_size);
    batch.status[row] = result.status;
    batch.residual[row] = result.residual;
  }
}

}  // namespace

extern "C" void contact_rollout(const contact_curation::stepping::ContactWorld *world, std::int64_t trajectories,
                                const double *initial, const std::int64_t *offsets, const double *dt, std::int64_t threads,
                                double *states, double *impulses, std::int32_t *status, double *residual) {
  contact_rollout_bouncing(world, nullptr, trajectories, initial, offsets, dt, threads, states, impulses, status, residual);
}

extern "C" void contact_rollout_bouncing(const contact_curation::stepping::ContactWorld *world, const double *restitution,
                                         std::int64_t trajectories, const double *initial, const std::int64_t *offsets,
                                         const double *dt, std::int64_t threads, double *states, double *impulses,
                                         std::int32_t *status, double *residual) {
  const Batch batch{initial, offsets, dt, states, impulses, status, residual};
  const int steps = restitution && *restitution > 0.0 ? kStepsOfBounces : 1;
  std::atomic<std::int64_t> next{0};
  const auto work = [&] {
    TimeStep step(*world, restitution);
    std::vector<double> guess(static_cast<std::size_t>(3 * world->vertices));
    for (std::int64_t b = next++; b < trajectories; b = next++) roll_out_one(step, batch, b, steps, guess);
  };
  std::vector<std::thread> helpers;
  try {
    while (static_cast<std::int64_t>(helpers.size()) + 1 < std::min(threads, trajectories)) helpers.emplace_back(work);
  } catch (const std::system_error &) {
    // The machine gives no more threads: those that run, and this one, do the work.
  }
  work();
  for (std::thread &helper : helpers) helper.join();
}
