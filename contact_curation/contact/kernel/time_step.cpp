// One time step of each of a batch of states; contact/time_step.py calls it.
#include "time_step.hpp"

#include "interface.hpp"

extern "C" void contact_time_step(const contact_curation::stepping::ContactWorld *world, std::int64_t count, const double *dt,
                                  double *states, double *impulses, std::int32_t *status, double *residual) {
  contact_time_step_bouncing(world, nullptr, count, dt, states, impulses, status, residual);
}

extern "C" void contact_time_step_bouncing(const contact_curation::stepping::ContactWorld *world, const double *restitution,
                                           std::int64_t count, const double *dt, double *states, double *impulses,
                                           std::int32_t *status, double *residual) {
  using namespace contact_curation::stepping;
  TimeStep step(*world, restitution);
  for (std::int64_t i = 0; i < count; ++i) {
    double *state = states + i * kStateSize, *answers = impulses + 3 * world->vertices * i;
    StepResult result = step.advance(state, dt[i], answers);
    if (result.status == kNotFinite || !all_finite(state, kStateSize)) result = give_up(state, answers, world->vertices);
    status[i] = result.status;
    residual[i] = result.residual;
  }
}
