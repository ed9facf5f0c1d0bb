// One time step of each of a batch of states; plain C entry point (contact/time_step.py calls it).
#include "time_step.hpp"

#include <limits>

// Advances `states` (N, 13) by `dt` (N) in place. `impulses` (N, V, 3) holds the guesses and then the answers.
extern "C" void contact_time_step(const contact_curation::stepping::ContactWorld* world, std::int64_t count, const double* dt,
                                  double* states, double* impulses, std::int32_t* status, double* residual) {
    using namespace contact_curation::stepping;
    TimeStep step(*world);
    for (std::int64_t i = 0; i < count; ++i) {
        double* state = states + i * kStateSize;
        StepResult result = step.advance(state, dt[i], impulses + 3 * world->vertices * i);
        if (!all_finite(state, kStateSize)) result = {kNotFinite, std::numeric_limits<double>::quiet_NaN()};
        status[i] = result.status;
        residual[i] = result.residual;
    }
}
