// One time step of each of a batch of states at given contacts; contact/given_contacts.py calls it.
#include <cstring>

#include "interface.hpp"

namespace {

using namespace contact_curation::stepping;

constexpr std::int64_t kRow = 6, kRows = 3 * kRow;  // numbers in a row, and in the rows of one contact

void take(ContactSweeps &sweeps, std::int64_t contacts, const double *gaps, const double *jacobians, double dt) {
  for (std::int64_t k = 0; k < contacts; ++k) {
    for (int a = 0; a < 3; ++a) std::memcpy(sweeps.row(k, a), jacobians + k * kRows + a * kRow, kRow * sizeof(double));
    sweeps.close(k, gaps[k], dt);
  }
}

}  // namespace

extern "C" void contact_given_step(const contact_curation::stepping::Dynamics *dynamics, std::int64_t count,
                                   std::int64_t contacts, const double *dt, const double *gaps, const double *jacobians,
                                   double *states, double *impulses, std::int32_t *status, double *residual) {
  ContactSweeps sweeps(*dynamics, contacts);
  for (std::int64_t i = 0; i < count; ++i) {
    double *state = states + i * kStateSize;
    const double *own_gaps = gaps + i * contacts, *rows = jacobians + i * contacts * kRows;
    StepResult result{kNotFinite, std::numeric_limits<double>::quiet_NaN()};
    if (all_finite(own_gaps, contacts) && all_finite(rows, contacts * kRows)) {
      take(sweeps, contacts, own_gaps, rows, dt[i]);
      double *answers = impulses + 3 * contacts * i;
      result = sweeps.advance(state, dt[i], answers);
      if (result.status == kNotFinite || !all_finite(state, kStateSize)) result = give_up(state, answers, contacts);
    }
    status[i] = result.status;
    residual[i] = result.residual;
  }
}
