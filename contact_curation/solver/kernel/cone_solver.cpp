// The inner problem of any contact model, posed by gaps and Jacobians; solver/compiled_solver.py calls it.
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "interface.hpp"
#include "interior_point.hpp"

namespace contact_curation {

namespace {

constexpr int64_t kPiece = 32 * kLanes;  // problems that a thread takes at a time

void solve_piece(const ConeBatch &job, int64_t begin, int64_t end, ConeProblem &problem, ConeSolution &solution) {
  SolverOptions options;
  options.max_iterations = job.max_iterations;
  options.residual_tolerance = job.residual_tolerance;
  for (int64_t first = begin; first < end; first += kLanes) {
    pose(job, first, end, problem);
    solve(problem, options, solution);
    const int lanes = static_cast<int>(std::min<int64_t>(kLanes, end - first));
    for (int lane = 0; lane < lanes; ++lane) {
      const int64_t n = first + lane;
      bool finite = std::isfinite(solution.residual[lane]);
      for (int i = 0; i < job.contacts; ++i)
        for (int c = 0; c < 3; ++c) job.impulses[(n * job.contacts + i) * 3 + c] = canonical(solution.impulse[i][c][lane]);
      job.status[n] = !finite ? kNotFinite : solution.solved[lane] ? kSolved : kNotSolved;
      job.residuals[n] = canonical(solution.residual[lane]);
      job.iterations[n] = solution.iterations;
    }
  }
}

}  // namespace
}  // namespace contact_curation

extern "C" int contact_curation_solve_cones(const contact_curation::ConeBatch *job) {
  using namespace contact_curation;
  if (job->contacts < 1 || job->contacts > kMaxContacts) return 1;
  std::atomic<int64_t> next{0};
  const auto work = [&] {
    auto problem = std::make_unique<ConeProblem>();
    auto solution = std::make_unique<ConeSolution>();
    for (int64_t first = kPiece * next++; first < job->batch; first = kPiece * next++)
      solve_piece(*job, first, std::min(first + kPiece, job->batch), *problem, *solution);
  };
  const int64_t pieces = (job->batch + kPiece - 1) / kPiece;
  const int64_t threads = std::max<int64_t>(1, std::min<int64_t>(job->threads, pieces));
  std::vector<std::thread> pool;
  for (int64_t t = 1; t < threads; ++t) pool.emplace_back(work);
  work();
  for (auto &thread : pool) thread.join();
  return 0;
}
