// The kernel's functions as Python calls them. Plain C: the library has no other visible names.
#pragma once

#include <cstdint>

#include "cone_batch.hpp"
#include "contact_sweeps.hpp"
#include "descent.hpp"
#include "polytope_rows.hpp"
#include "time_step.hpp"

extern "C" {
#pragma GCC visibility push(default)

// Every structure and function below as text, for solver/compiled.py to compare with its own (interface.cpp).
const char *contact_curation_interface();

// Solves B inner problems; status 1 where there are too many contacts.
int contact_curation_solve_cones(const contact_curation::ConeBatch *job);

// Fills what `job` asks for of many transitions; status 1 where there are too many contacts.
int contact_curation_evaluate(const contact_curation::PolytopeModel *model, const contact_curation::Evaluation *job);

// The same for a body that bounces, with a restitution as the last parameter: P = 6K + 11.
int contact_curation_evaluate_bouncing(const contact_curation::PolytopeModel *model, const contact_curation::Evaluation *job,
                                       const double *restitution);

// The same with weights (N) of the squared residuals in the sums over tosses; the restitution may be null. Successive
// transitions of a toss with one weight are summed before they are weighted.
int contact_curation_evaluate_weighted(const contact_curation::PolytopeModel *model, const contact_curation::Evaluation *job,
                                       const double *weights, const double *restitution);

// Training. Each steps down the rows in turn. It returns how many were taken: it stops, and leaves everything as it was, before
// the first row whose impulses carry no certificate or whose loss or slope is not finite. Networks have at most `kMaxLayers`
// layers, none wider than `kMaxWidth`, and outputs for the model's contacts, at most `kMaxContacts`.
int64_t contact_curation_descend(const contact_curation::PolytopeModel *model, const contact_curation::Evaluation *rows,
                                 contact_curation::Descent *job);
int64_t contact_curation_descend_deep(const contact_curation::PolytopeModel *model, const contact_curation::Evaluation *rows,
                                      contact_curation::Descent *job);
int64_t contact_curation_descend_deepvertex(const contact_curation::PolytopeModel *model,
                                            const contact_curation::Evaluation *rows, contact_curation::Descent *job);
int64_t contact_curation_descend_end_to_end(const contact_curation::PolytopeModel *model,
                                            const contact_curation::Evaluation *rows, contact_curation::Descent *job);

// Advances `states` (N, 13) by `dt` (N) in place. `impulses` (N, V, 3) holds the guesses and then the answers. What is not
// finite in the end is NaN in all numbers.
void contact_time_step(const contact_curation::stepping::ContactWorld *world, int64_t count, const double *dt, double *states,
                       double *impulses, int32_t *status, double *residual);

// The same with Newton's restitution of every contact, which may be null.
void contact_time_step_bouncing(const contact_curation::stepping::ContactWorld *world, const double *restitution, int64_t count,
                                const double *dt, double *states, double *impulses, int32_t *status, double *residual);

// The same as without restitution, at given contacts: `gaps` (N, K) and `jacobians` (N, K, 3, 6) as they are at the states.
// Where they are not finite no step is made.
void contact_given_step(const contact_curation::stepping::Dynamics *dynamics, int64_t count, int64_t contacts, const double *dt,
                        const double *gaps, const double *jacobians, double *states, double *impulses, int32_t *status,
                        double *residual);

// Rolls out B initial states. Trajectory b owns rows offsets[b]..offsets[b + 1] of every output; its first row is its initial
// state, with zero impulses. From a step that is not finite on its rows are NaN and carry that status. `impulses` may be null.
void contact_rollout(const contact_curation::stepping::ContactWorld *world, int64_t trajectories, const double *initial,
                     const int64_t *offsets, const double *dt, int64_t threads, double *states, double *impulses,
                     int32_t *status, double *residual);

// The same with Newton's restitution of every contact, which may be null; with one, each step is made of several shorter ones.
void contact_rollout_bouncing(const contact_curation::stepping::ContactWorld *world, const double *restitution,
                              int64_t trajectories, const double *initial, const int64_t *offsets, const double *dt,
                              int64_t threads, double *states, double *impulses, int32_t *status, double *residual);

// Sines, cosines and hyperbolic tangents of N numbers, as the functions above take them; for tests.
void contact_curation_elementary(int64_t count, const double *x, double *sines, double *cosines, double *tangents);

// Whole powers of N numbers from 0 to 1; for tests.
void contact_curation_powers(int64_t count, const double *bases, const int64_t *exponents, double *powers);

#pragma GCC visibility pop
}
