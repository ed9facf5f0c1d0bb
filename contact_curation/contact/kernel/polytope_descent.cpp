// A polytope's training one transition a step, as ContactNets trains: solve, slope of the loss and of the regulariser, AdamW,
// next row.
#include <algorithm>
#include <cmath>
#include <memory>

#include "interface.hpp"
#include "scale_slopes.hpp"

extern "C" int64_t contact_curation_descend(const contact_curation::PolytopeModel *model,
                                            const contact_curation::Evaluation *rows, contact_curation::Descent *job) {
  using namespace contact_curation;
  if (model->contacts < 1 || model->contacts > kMaxContacts) return 0;
  const auto at = std::make_unique<SolvedRows>();
  const int sizes[kPieces] = {3 * model->contacts, 3, 3 * model->contacts, 6}, count = 6 * model->contacts + 9;
  double slopes[kMaxParameters];
  for (int64_t step = 0; step < job->steps; ++step) {
    const int64_t row = job->rows[step];
    at->find(*model, *rows, row, row + 1, true);
    if (at->status(0) != kSolved) return step;
    for (int k = 0; k < count; ++k) slopes[k] = at->gradient[k][0];
    double *by_normal = slopes + sizes[0], *by_tangents = slopes + count - sizes[3];
    add_scale_slopes(model->normal, model->tangents, 3, job->regularizer * model->contacts, by_normal, by_tangents);
    if (!std::all_of(slopes, slopes + count, [](double slope) { return std::isfinite(slope); })) return step;
    job->seen += 1.0;
    const AdamW adamw = job->adamw(step, job->polytope, job->corrections());
    const double *by_piece = slopes;
    for (int piece = 0; piece < kPieces; by_piece += sizes[piece++]) {
      const Moments &theta = job->theta[piece];
      adamw.step(theta.theta, theta.first, theta.second, by_piece, sizes[piece]);
    }
    job->loss_sum += at->outcome.loss[0];
  }
  return job->steps;
}
