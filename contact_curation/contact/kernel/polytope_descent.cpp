// A polytope's training one transition a step, as ContactNets trains: solve, slope of the loss and of the regulariser, AdamW, next row.
//
//   m <- b1 m + (1 - b1) g      v <- b2 v + (1 - b2) g^2      x <- (1 - rate decay) x - rate (m / c1) / (sqrt(v / c2) + e),  c = 1 - b^t
#include <algorithm>
#include <cmath>
#include <memory>

#include "polytope_rows.hpp"

namespace contact_curation {

constexpr int kPieces = 4;  // vertices_normal, normal, vertices_tangent, tangents: the order of theta and of its slopes

// Mirrored by ctypes. S steps; the moments are AdamW's, by piece and shaped like it.
struct Descent {
  const int64_t *rows;  // (S,)
  const double *rates;  // (S,)
  int64_t steps;
  double regularizer;        // weight of each contact's; the same slopes at every contact
  double decay, first_beta, second_beta, epsilon;
  double *theta[kPieces];    // what the model points to
  double *first[kPieces], *second[kPieces];
  double seen;               // steps that the moments have seen; counted on
  double loss_sum;           // added to
};

namespace {

double dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Adds the slopes of (|n| - 1)^2 + sum_a (u . u_a)^2, u and u_a unit vectors along the normal and the tangents, times a weight.
void add_scale_slopes(const double *normal, const double *tangents, double weight, double *by_normal, double *by_tangents) {
  constexpr double kSmallest = 1e-12;  // a shorter one has no direction
  const double size = std::sqrt(dot3(normal, normal)), length = std::max(size, kSmallest);
  double unit[3], pull[3];
  for (int a = 0; a < 3; ++a) unit[a] = normal[a] / length, pull[a] = (size - 1.0) * unit[a];
  for (int t = 0; t < 2; ++t) {
    const double *tangent = tangents + 3 * t;
    const double width = std::max(std::sqrt(dot3(tangent, tangent)), kSmallest);
    double across[3];
    for (int a = 0; a < 3; ++a) across[a] = tangent[a] / width;
    const double overlap = dot3(unit, across);
    for (int a = 0; a < 3; ++a) {
      pull[a] += overlap * (across[a] - overlap * unit[a]) / length;
      by_tangents[3 * t + a] += weight * 2.0 * overlap * (unit[a] - overlap * across[a]) / width;
    }
  }
  for (int a = 0; a < 3; ++a) by_normal[a] += weight * 2.0 * pull[a];
}

void adamw(const Descent &job, double rate, const int *sizes, const double *slopes) {
  const double first_share = 1.0 - std::pow(job.first_beta, job.seen), second_share = 1.0 - std::pow(job.second_beta, job.seen);
  const double stride = rate / first_share, scale = std::sqrt(second_share);
  for (int piece = 0; piece < kPieces; slopes += sizes[piece++]) {
    double *theta = job.theta[piece], *first = job.first[piece], *second = job.second[piece];
    for (int k = 0; k < sizes[piece]; ++k) {
      first[k] += (1.0 - job.first_beta) * (slopes[k] - first[k]);
      second[k] = job.second_beta * second[k] + (1.0 - job.second_beta) * slopes[k] * slopes[k];
      theta[k] -= rate * job.decay * theta[k];
      theta[k] -= stride * first[k] / (std::sqrt(second[k]) / scale + job.epsilon);
    }
  }
}

}  // namespace
}  // namespace contact_curation

// Steps down the rows in turn. Returns how many were taken: it stops, and leaves everything as it was, before the first row whose
// impulses carry no certificate or whose loss or slope is not finite.
extern "C" int64_t contact_curation_descend(const contact_curation::PolytopeModel *model, const contact_curation::Evaluation *rows,
                                            contact_curation::Descent *job) {
  using namespace contact_curation;
  if (model->contacts < 1 || model->contacts > kMaxContacts) return 0;
  const auto at = std::make_unique<SolvedRows>();
  const int sizes[kPieces] = {3 * model->contacts, 3, 3 * model->contacts, 6}, count = parameter_count(model->contacts) - 1;
  double slopes[kMaxParameters];
  for (int64_t step = 0; step < job->steps; ++step) {
    const int64_t row = job->rows[step];
    at->find(*model, *rows, row, row + 1, true);
    if (at->status(0) != kSolved) return step;
    for (int k = 0; k < count; ++k) slopes[k] = at->gradient[k][0];
    double *by_normal = slopes + sizes[0], *by_tangents = slopes + count - sizes[3];
    add_scale_slopes(model->normal, model->tangents, job->regularizer * model->contacts, by_normal, by_tangents);
    if (!std::all_of(slopes, slopes + count, [](double slope) { return std::isfinite(slope); })) return step;
    job->seen += 1.0;
    adamw(*job, job->rates[step], sizes, slopes);
    job->loss_sum += at->outcome.loss[0];
  }
  return job->steps;
}
