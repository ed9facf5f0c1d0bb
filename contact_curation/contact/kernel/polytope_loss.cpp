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

// The sums of one toss: Fisher matrix and scores. Successive transitions of one weight are summed before they are weighted.
struct TossSums {
  TossSums(const BouncingModel &model, int width)
      : profile(model), parameters(width), stride(profile.stride()), run(stride * stride), fisher(run), row(stride),
        run_score(row), score(row) {}

  // Begins with what the job's sums are already, as the first run or before it.
  void begin(const Evaluation &job, int64_t toss, bool weighted) {
    for (std::vector<double> *sum : {&run, &fisher, &run_score, &score}) std::fill(sum->begin(), sum->end(), 0.0);
    std::vector<double> &matrix = weighted ? fisher : run, &sum = weighted ? score : run_score;
    if (job.score_sum) std::copy_n(job.score_sum + toss * parameters, parameters, sum.begin());
    const double *given = job.fisher ? job.fisher + toss * parameters * parameters : nullptr;
    for (int a = 0; given && a < parameters; ++a) std::copy_n(given + a * parameters, a + 1, matrix.begin() + a * stride);
  }

  // Ends a run of transitions of one weight, whose squares count in a matrix of outer products of scores.
  void weigh(double weight, bool squared) {
    const double in_fisher = squared ? weight * weight : weight;
    for (int a = 0; a < parameters; ++a) {
      score[a] += weight * run_score[a];
      for (int b = 0; b <= a; ++b) fisher[a * stride + b] += in_fisher * run[a * stride + b];
    }
    std::fill(run.begin(), run.end(), 0.0);
    std::fill(run_score.begin(), run_score.end(), 0.0);
  }

  void store(const Evaluation &job, int64_t toss) const {
    if (job.score_sum) std::copy(score.begin(), score.begin() + parameters, job.score_sum + toss * parameters);
    if (!job.fisher) return;
    double *out = job.fisher + toss * parameters * parameters;
    for (int a = 0; a < parameters; ++a)
      for (int b = 0; b <= a; ++b) out[a * parameters + b] = out[b * parameters + a] = fisher[a * stride + b];
  }

  ProfileFisher profile;
  int parameters, stride;
  std::vector<double> run, fisher;  // lower triangles
  std::vector<double> row, run_score, score;
};

void evaluate_toss(const BouncingModel &model, const Evaluation &job, const double *weights, int64_t toss, SolvedRows &at,
                   TossSums &sums) {
  const bool scores = job.score || job.score_sum || (job.fisher && job.estimator == kEmpirical);
  sums.begin(job, toss, weights != nullptr);
  const int64_t begin = job.starts[toss], end = job.starts[toss + 1];
  const auto weight_of = [&](int64_t n) { return weights ? weights[n] : 1.0; };
  for (int64_t first = begin; first < end; first += kLanes) {
    at.find(model, job, first, end, scores);
    const int lanes = static_cast<int>(std::min<int64_t>(kLanes, end - first));
    for (int lane = 0; lane < lanes; ++lane) {
      const int64_t n = first + lane;
      const double loss = at.outcome.loss[lane];
      const Status status = at.status(lane);
      if (n > begin && weight_of(n) != weight_of(n - 1)) sums.weigh(weight_of(n - 1), job.estimator == kEmpirical);
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
        for (int k = 0; k < sums.parameters; ++k) sums.row[k] = canonical(-0.5 * influence * at.gradient[k][lane]);
      if (job.score) std::copy(sums.row.begin(), sums.row.begin() + sums.parameters, job.score + n * sums.parameters);
      if (status != kSolved) continue;  // counted by its status, never a zero score in disguise
      if (job.score_sum)
        for (int k = 0; k < sums.parameters; ++k) sums.run_score[k] += sums.row[k];
      if (job.fisher && job.estimator == kEmpirical) add_outers({{sums.row.data(), 1.0}}, sums.run.data(), sums.stride);
      if (job.fisher && job.estimator == kGaussNewton)
        sums.profile.add(at.transition, at.problem, at.solution, at.outcome, lane, influence * influence, sums.run.data(),
                         sums.stride);
    }
  }
  sums.weigh(end > begin ? weight_of(end - 1) : 1.0, job.estimator == kEmpirical);
  sums.store(job, toss);
}

int evaluate(const BouncingModel &model, const Evaluation &job, const double *weights = nullptr) {
  if (model.contacts < 1 || model.contacts > kMaxContacts) return 1;
  std::atomic<int64_t> next{0};
  const auto work = [&] {
    auto rows = std::make_unique<SolvedRows>();
    TossSums sums(model, parameter_count(model));
    for (int64_t toss = next++; toss < job.tosses; toss = next++) evaluate_toss(model, job, weights, toss, *rows, sums);
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

extern "C" int contact_curation_evaluate_weighted(const contact_curation::PolytopeModel *model,
                                                  const contact_curation::Evaluation *job, const double *weights,
                                                  const double *restitution) {
  return contact_curation::evaluate({*model, restitution}, *job, weights);
}
