// One time step of each of a batch of states; contact/time_step.py calls it.
#include "time_step.hpp"

#include "interface.hpp"
#include "lane_steps.hpp"

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
