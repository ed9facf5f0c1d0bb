// Loss, impulses, scores and Fisher matrices of many transitions: toss after toss, eight transitions at a time, tosses over
// threads.
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "interface.hpp"
#include "profile_fisher.hpp"

namespace contact_curation {
namespace {

enum Estimator { kNone = 0, kEmpirical = 1, kGaussNewton = 2 };

void evaluate_toss(const BouncingModel &model, const Evaluation &job, int64_t toss, SolvedRows &at, ProfileFisher &profile,
                   std::vector<double> &fisher, std::vector<double> &row) {
  const int parameters = parameter_count(model), stride = profile.stride();
  const bool scores = job.score || job.score_sum || (job.fisher && job.estimator == kEmpirical);
  std::fill(fisher.begin(), fisher.end(), 0.0);
  double *out = job.fisher ? job.fisher + toss * parameters * parameters : nullptr;
  for (int a = 0; out && a < parameters; ++a) std::copy_n(out + a * parameters, a + 1, fisher.begin() + a * stride);
  const int64_t begin = job.starts[toss], end = job.starts[toss + 1];
  for (int64_t first = begin; first < end; first += kLanes) {
    at.find(model, job, first, end, scores);
    const int lanes = static_cast<int>(std::min<int64_t>(kLanes, end - first));
    for (int lane = 0; lane < lanes; ++lane) {
      const int64_t n = first + lane;
      const double loss = at.outcome.loss[lane];
      const Status status = at.status(lane);
      if (job.status) job.status[n] = status;
      if (job.residual) job.residual[n] = canonical(at.solution.residual[lane]);
      if (job.iterations) job.iterations[n] = at.solution.iterations;
      if (job.terms)
        for (int k = 0; k < kTerms; ++k) job.terms[n * kTerms + k] = canonical(at.outcome.terms[k][lane]);
      if (job.impulse)
        for (int i = 0; i < model.contacts; ++i)
          for (int c = 0; c < 3; ++c)
            job.impulse[(n * model.contacts + i) * 3 + c] = canonical(at.solution.impulse[i][c][lane]);
      const double influence = loss > job.influence_bound ? job.influence_bound / loss : 1.0;
      if (scores)
        for (int k = 0; k < parameters; ++k) row[k] = canonical(-0.5 * influence * at.gradient[k][lane]);
      if (job.score) std::copy(row.begin(), row.begin() + parameters, job.score + n * parameters);
      if (status != kSolved) continue;  // counted by its status, never a zero score in disguise
      if (job.score_sum)
        for (int k = 0; k < parameters; ++k) job.score_sum[toss * parameters + k] += row[k];
      if (job.fisher && job.estimator == kEmpirical) ProfileFisher::add_outer(row.data(), 1.0, fisher.data(), stride);
      if (job.fisher && job.estimator == kGaussNewton)
        profile.add(at.transition, at.problem, at.solution, at.outcome, lane, influence * influence, fisher.data(), stride);
    }
  }
  for (int a = 0; out && a < parameters; ++a)
    for (int b = 0; b <= a; ++b) out[a * parameters + b] = out[b * parameters + a] = fisher[a * stride + b];
}

int evaluate(const BouncingModel &model, const Evaluation &job) {
  if (model.contacts < 1 || model.contacts > kMaxContacts) return 1;
  std::atomic<int64_t> next{0};
  const auto work = [&] {
    auto rows = std::make_unique<SolvedRows>();
    ProfileFisher profile(model);
    std::vector<double> fisher(static_cast<size_t>(profile.stride()) * profile.stride()), row(profile.stride(), 0.0);
    for (int64_t toss = next++; toss < job.tosses; toss = next++) evaluate_toss(model, job, toss, *rows, profile, fisher, row);
  };
  const int threads = std::max(1, std::min<int>(job.threads, static_cast<int>(job.tosses)));
  std::vector<std::thread> pool;
  for (int t = 1; t < threads; ++t) pool.emplace_back(work);
  work();
  for (auto &thread : pool) thread.join();
  return 0;
}

}  // namespace
}  // namespace contact_curation

extern "C" int contact_curation_evaluate(const contact_curation::PolytopeModel *model,
                                         const contact_curation::Evaluation *job) {
  return contact_curation::evaluate(*model, *job);
}

extern "C" int contact_curation_evaluate_bouncing(const contact_curation::PolytopeModel *model,
                                                  const contact_curation::Evaluation *job, const double *restitution) {
  return contact_curation::evaluate({*model, restitution}, *job);
}
