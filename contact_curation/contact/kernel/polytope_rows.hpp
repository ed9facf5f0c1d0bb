// Rows of transitions, eight at a time: from their numbers to solved impulses, loss terms and slopes.
#pragma once

#include <cstdint>

#include "interior_point.hpp"
#include "polytope_transition.hpp"

namespace contact_curation {

// Mirrored by ctypes. Any output may be null. N transitions, T tosses, K contacts, P = 6K + 10 parameters.
struct Evaluation {
  const double *before;   // (N, 13)
  const double *after;    // (N, 13)
  const double *dt;       // (N,)
  const int64_t *starts;  // (T + 1,)
  int64_t tosses;
  int32_t threads;
  int32_t estimator;
  int32_t max_iterations;
  double residual_tolerance;
  double influence_bound;  // losses above it are scaled down to it; inf when unbounded
  double *terms;           // (N, 5)
  double *impulse;         // (N, K, 3)
  double *score;           // (N, P), -dL/dtheta / 2: the score for sigma = 1
  double *residual;        // (N,)
  int32_t *status;         // (N,)
  int32_t *iterations;     // (N,)
  double *fisher;          // (T, P, P), symmetric, added to; as row after row gives it, whatever was added before
  double *score_sum;       // (T, P), likewise
};

struct SolvedRows {
  ConeProblem problem;
  ConeSolution solution;
  Transition transition;
  Outcome outcome;
  Lane gradient[kMaxParameters];  // dL/dtheta at the impulses found; only where asked for

  // Rows first .. first + 7, the last one repeated past `end`.
  void find(const BouncingModel &model, const Evaluation &job, int64_t first, int64_t end, bool slopes) {
    SolverOptions options;
    options.max_iterations = job.max_iterations;
    options.residual_tolerance = job.residual_tolerance;
    transition.load(model, job.before, job.after, job.dt, first, end);
    transition.pose(model, problem);
    solve(problem, options, solution);
    outcome.judge(model, transition, problem, solution);
    if (slopes) outcome.gradient(model, transition, problem, solution, gradient);
  }

  Status status(int lane) const {
    if (!std::isfinite(outcome.loss[lane])) return kNotFinite;
    return solution.solved[lane] ? kSolved : kNotSolved;
  }
};

}  // namespace contact_curation
