// Primal-dual interior point method for the inner problem, eight problems a call, one per SIMD lane.
//
// Mehrotra's predictor-corrector with Nesterov-Todd scaling of the friction cones (Andersen, Dahl, Vandenberghe: coneqp, 2010).
// The penetration slack is one inequality per contact, t_j = w_j / (2 w_s) + c_j + B_j A l >= 0 with multiplier w_j. The Newton
// matrix is blkdiag(N_i) + A^T S A with N_i 3x3 and S 6x6, so a step costs K inversions of 3x3 and one Cholesky factor of 6x6
// (method.md 4.1).
#pragma once

#include "cone_problem.hpp"

namespace contact_curation {

// Inverse of a symmetric positive 3x3 matrix stored 00 01 02 11 12 22, by elimination in the order 1, 2, 0. The caller puts the
// stiffest direction second and the softest first, so that a graded matrix keeps its small pivots.
inline void invert_block(const Lane *m, Lane *inverse) {
  const Lane pivot1 = 1.0 / m[3];
  const Lane l2 = m[4] * pivot1, l0 = m[1] * pivot1;
  const Lane pivot2 = 1.0 / (m[5] - l2 * m[4]);
  const Lane rest = m[2] - l2 * m[1];
  const Lane k0 = rest * pivot2;
  const Lane pivot0 = 1.0 / (m[0] - l0 * m[1] - k0 * rest);
  const Lane h = l0 - k0 * l2;  // of contact direction 1 on direction 0, direction 2 eliminated
  inverse[0] = pivot0;
  inverse[1] = -h * pivot0;
  inverse[2] = -k0 * pivot0;
  inverse[5] = pivot2 + k0 * k0 * pivot0;
  inverse[4] = -l2 * pivot2 + k0 * h * pivot0;
  inverse[3] = pivot1 + l2 * l2 * pivot2 + h * h * pivot0;
}

inline void cholesky6(Lane (*m)[6], Lane *inverse_diagonal) {
  for (int j = 0; j < 6; ++j) {
    Lane pivot = m[j][j];
    for (int k = 0; k < j; ++k) pivot -= m[j][k] * m[j][k];
    const Lane root = square_root(pivot);
    m[j][j] = root;
    inverse_diagonal[j] = 1.0 / root;
    for (int i = j + 1; i < 6; ++i) {
      Lane value = m[i][j];
      for (int k = 0; k < j; ++k) value -= m[i][k] * m[j][k];
      m[i][j] = value * inverse_diagonal[j];
    }
  }
}

inline void solve_lower(const Lane (*factor)[6], const Lane *inverse_diagonal, Lane *x) {
  for (int i = 0; i < 6; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= factor[i][k] * x[k];
    x[i] *= inverse_diagonal[i];
  }
}

inline void solve_upper(const Lane (*factor)[6], const Lane *inverse_diagonal, Lane *x) {
  for (int i = 5; i >= 0; --i) {
    for (int k = i + 1; k < 6; ++k) x[i] -= factor[k][i] * x[k];
    x[i] *= inverse_diagonal[i];
  }
}

inline Lane determinant(const Lane *x) { return x[0] * x[0] - x[1] * x[1] - x[2] * x[2]; }

// The largest step that keeps x + step * d in the circular cone, x well inside it (scaled): CVXOPT's rule, free of
// cancellation.
inline Lane step_to_cone(const Lane *x, const Lane *d) {
  const Lane det = determinant(x), root = square_root(det);
  const Lane along = (x[0] * d[0] - x[1] * d[1] - x[2] * d[2]) / det;
  const Lane share = (along + d[0] / root) / (x[0] + root);
  const Lane off1 = d[1] / root - share * x[1], off2 = d[2] / root - share * x[2];
  const Lane need = square_root(off1 * off1 + off2 * off2) - along;
  const LaneMask bounded = need > 0.0;
  return select(bounded, 1.0 / select(bounded, need, broadcast(1.0)), broadcast(1e30));
}

inline Lane step_to_zero(Lane x, Lane d) {
  const LaneMask falling = d < 0.0;
  return select(falling, x / select(falling, -d, broadcast(1.0)), broadcast(1e30));
}

// A predictor that gets less far than this says nothing about the second order; correcting with it can hold the method up for
// good.
constexpr double kTrusted = 0.3;

// Everything an iteration holds; member arrays are per contact.
template <bool Circular>
struct InteriorPoint {
  const ConeProblem &problem;
  const SolverOptions &options;
  const int contacts;

  Lane impulse[kMaxContacts][3], dual[kMaxContacts][3];
  Lane facet_gap[Circular ? 1 : kMaxContacts][kFacets], facet_dual[Circular ? 1 : kMaxContacts][kFacets];
  Lane slack_gap[kMaxContacts], slack_dual[kMaxContacts];

  Lane step[kMaxContacts][3], dual_step[kMaxContacts][3];
  Lane facet_step[Circular ? 1 : kMaxContacts][kFacets], facet_dual_step[Circular ? 1 : kMaxContacts][kFacets];
  Lane slack_step[kMaxContacts], slack_dual_step[kMaxContacts];

  Lane stationarity[kMaxContacts][3], slack_defect[kMaxContacts], stiffness[kMaxContacts];
  // Nesterov-Todd scaling W = scale * boost, W^-1 impulse = W dual = scaled. The boost stretches the ray (1, axis) by `stretch`
  // and shrinks its mirror (1, -axis) as much. It is carried along in scaled coordinates, where the point stays well inside its
  // cone, and applied ray by ray, so that it keeps its accuracy as the gap closes.
  Lane axis[kMaxContacts][2], stretch[kMaxContacts], scale[kMaxContacts], scaled[kMaxContacts][3];
  Lane per_stretch[kMaxContacts], per_scale[kMaxContacts];  // their reciprocals
  // Of the facets' gaps, and of the impulse's length.
  Lane per_gap[Circular ? 1 : kMaxContacts][kFacets], per_length[Circular ? 1 : kMaxContacts];
  Lane scaled_step[kMaxContacts][3], scaled_dual_step[kMaxContacts][3];
  Lane basis[kMaxContacts][3][3];              // columns: soft direction (the ray), stiff direction, the third; orthonormal
  Lane stiffest[Circular ? 1 : kMaxContacts];  // number of the facet that resists most
  Lane turned[kMaxContacts][3][6];             // motion in that basis
  Lane inverse_block[kMaxContacts][6], reduced[kMaxContacts][3][6];
  Lane coupling[6][6], coupling_inverse[6], schur[6][6], schur_inverse[6];
  Facet facets[kFacets];

  InteriorPoint(const ConeProblem &given, const SolverOptions &chosen)
      : problem(given), options(chosen), contacts(given.contacts) {
    for (int k = 0; k < kFacets; ++k) facets[k] = polyhedral_facet(k);
  }

  void start() {
    const Lane one = broadcast(1.0), zero = broadcast(0.0);
    for (int i = 0; i < contacts; ++i) {
      for (int c = 0; c < 3; ++c) impulse[i][c] = dual[i][c] = scaled[i][c] = c == 0 ? 0.3 * one : zero;
      axis[i][0] = scale[i] = stretch[i] = one;
      axis[i][1] = zero;
      if constexpr (!Circular)
        for (int k = 0; k < kFacets; ++k) {
          facet_gap[i][k] = impulse[i][0];
          facet_dual[i][k] = 0.3 / kFacets * one;
        }
    }
    Lane change[6];
    velocity_change(problem, impulse, change);
    for (int j = 0; j < contacts; ++j) {
      const Lane reach = problem.slack_offset[j] + dot<6>(problem.slack_row[j], change);
      slack_dual[j] = 2.0 * problem.slack_weight * (maximum(-reach, zero) + 0.1);
      slack_gap[j] = slack_dual[j] / (2.0 * problem.slack_weight) + reach;
    }
  }

  int degree() const { return Circular ? 2 * contacts : (kFacets + 1) * contacts; }

  Lane complementarity() const {
    Lane sum = broadcast(0.0);
    for (int i = 0; i < contacts; ++i) {
      if constexpr (Circular) {
        sum += dot<3>(scaled[i], scaled[i]);
      } else {
        for (int k = 0; k < kFacets; ++k) sum += facet_gap[i][k] * facet_dual[i][k];
      }
      sum += slack_gap[i] * slack_dual[i];
    }
    return sum / static_cast<double>(degree());
  }

  // Residuals of the optimality conditions; returns the largest entry.
  Lane residuals() {
    Lane change[6], pull[6];
    velocity_change(problem, impulse, change);
    for (int k = 0; k < 6; ++k) pull[k] = 2.0 * problem.match_weight * (change[k] - problem.target[k]);
    Lane worst = broadcast(0.0);
    for (int j = 0; j < contacts; ++j) {
      const Lane reach = problem.slack_offset[j] + dot<6>(problem.slack_row[j], change);
      slack_defect[j] = slack_dual[j] / (2.0 * problem.slack_weight) + reach - slack_gap[j];
      worst = maximum(worst, absolute(slack_defect[j]));
      for (int k = 0; k < 6; ++k) pull[k] -= problem.slack_row[j][k] * slack_dual[j];
    }
    for (int i = 0; i < contacts; ++i) {
      if constexpr (!Circular) {
        for (int c = 0; c < 3; ++c) {
          dual[i][c] = broadcast(0.0);
          for (int k = 0; k < kFacets; ++k) dual[i][c] += facets[k].row[c] * facet_dual[i][k];
        }
      }
      Lane curved[3];
      block_times(problem.block[i], impulse[i], curved);
      for (int c = 0; c < 3; ++c) {
        stationarity[i][c] =
            dot<6>(problem.motion[i][c], pull) + 2.0 * (curved[c] + problem.regularization * impulse[i][c]) - dual[i][c];
        worst = maximum(worst, absolute(stationarity[i][c]));
      }
    }
    return worst;
  }

  void into_basis(int i, const Lane *x, Lane *y) const {
    for (int k = 0; k < 3; ++k) y[k] = basis[i][0][k] * x[0] + basis[i][1][k] * x[1] + basis[i][2][k] * x[2];
  }
  void out_of_basis(int i, const Lane *x, Lane *y) const {
    for (int c = 0; c < 3; ++c) y[c] = basis[i][c][0] * x[0] + basis[i][c][1] * x[1] + basis[i][c][2] * x[2];
  }

  // The soft direction is the ray that carries the impulse, in which the cone hardly resists.
  void choose_basis(int i) {
    Lane(*q)[3] = basis[i];
    if constexpr (Circular) {
      const double half = std::sqrt(0.5);
      q[0][0] = q[0][1] = broadcast(half), q[0][2] = broadcast(0.0);
      for (int t = 0; t < 2; ++t) q[1 + t][0] = half * axis[i][t], q[1 + t][1] = -half * axis[i][t];
      q[1][2] = -axis[i][1], q[2][2] = axis[i][0];
    } else {
      // Stiff: against the facet that resists most; the third direction then does not feel that facet at all.
      Lane most = broadcast(-1.0), facet[3] = {most, most, most}, across;
      stiffest[i] = broadcast(0.0);
      for (int k = 0; k < kFacets; ++k) {
        per_gap[i][k] = 1.0 / facet_gap[i][k];
        const Lane weight = facet_dual[i][k] * per_gap[i][k];
        const LaneMask stiffer = weight > most;
        most = select(stiffer, weight, most);
        stiffest[i] = select(stiffer, broadcast(k), stiffest[i]);
        for (int c = 0; c < 3; ++c) facet[c] = select(stiffer, broadcast(facets[k].row[c]), facet[c]);
      }
      per_length[i] = 1.0 / square_root(dot<3>(impulse[i], impulse[i]));
      Lane ray[3], stiff[3];
      for (int c = 0; c < 3; ++c) ray[c] = impulse[i][c] * per_length[i];
      across = dot<3>(facet, ray);
      for (int c = 0; c < 3; ++c) stiff[c] = facet[c] - across * ray[c];
      const Lane per_norm = 1.0 / square_root(dot<3>(stiff, stiff));
      for (int c = 0; c < 3; ++c) {
        q[c][0] = ray[c];
        q[c][1] = stiff[c] * per_norm;
      }
      for (int c = 0; c < 3; ++c) {
        const int d = (c + 1) % 3, e = (c + 2) % 3;
        q[c][2] = q[d][0] * q[e][1] - q[e][0] * q[d][1];
      }
    }
  }

  // A facet's row in the basis; along the ray it is the gap itself, free of cancellation.
  void facet_in_basis(int i, int k, Lane *row) const {
    const double *given = facets[k].row;
    row[0] = facet_gap[i][k] * per_length[i];
    for (int b = 1; b < 3; ++b) row[b] = given[0] * basis[i][0][b] + given[1] * basis[i][1][b] + given[2] * basis[i][2][b];
    row[2] = select(stiffest[i] == static_cast<double>(k), broadcast(0.0), row[2]);
  }

  // basis^T (2 D + 2 eps + resistance of the cone) basis of contact i.
  void resist(int i, Lane *block) const {
    const Lane *d = problem.block[i];
    Lane curved[3][3];
    for (int k = 0; k < 3; ++k) {
      const Lane column[3] = {basis[i][0][k], basis[i][1][k], basis[i][2][k]};
      block_times(d, column, curved[k]);
    }
    int entry = 0;
    for (int a = 0; a < 3; ++a)
      for (int b = a; b < 3; ++b, ++entry) {
        block[entry] = broadcast(a == b ? 2.0 * problem.regularization : 0.0);
        for (int c = 0; c < 3; ++c) block[entry] += 2.0 * basis[i][c][a] * curved[b][c];
      }
    if constexpr (Circular) {
      const Lane weight = per_scale[i] * per_scale[i];
      block[0] += weight * (per_stretch[i] * per_stretch[i]);
      block[3] += weight * (stretch[i] * stretch[i]);
      block[5] += weight;
    } else {
      for (int k = 0; k < kFacets; ++k) {
        const Lane weight = facet_dual[i][k] * per_gap[i][k];
        Lane row[3];
        facet_in_basis(i, k, row);
        entry = 0;
        for (int a = 0; a < 3; ++a)
          for (int b = a; b < 3; ++b, ++entry) block[entry] += weight * row[a] * row[b];
      }
    }
  }

  // W^-1 in the basis is diagonal.
  void inverse_scale(int i, const Lane *x, Lane *y) const {
    y[0] = x[0] * (per_scale[i] * per_stretch[i]);
    y[1] = x[1] * (stretch[i] * per_scale[i]);
    y[2] = x[2] * per_scale[i];
  }

  // The scaling after a step, from the scaled impulse and dual it led to.
  void rescale(int i, LaneMask open, Lane length) {
    Lane s[3], z[3];
    for (int c = 0; c < 3; ++c) {
      s[c] = scaled[i][c] + length * scaled_step[i][c];
      z[c] = scaled[i][c] + length * scaled_dual_step[i][c];
    }
    const Lane root_s = square_root(determinant(s)), root_z = square_root(determinant(z));
    const Lane per_s = 1.0 / root_s, per_z = 1.0 / root_z;
    const Lane per_half = 1.0 / square_root(2.0 * (1.0 + dot<3>(s, z) * (per_s * per_z)));
    const Lane w1 = (s[1] * per_s - z[1] * per_z) * per_half, w2 = (s[2] * per_s - z[2] * per_z) * per_half;
    const Lane w0 = square_root(1.0 + w1 * w1 + w2 * w2);
    const Lane shrink = 1.0 / (1.0 + w0), grow = square_root(root_s * per_z);
    const Lane bent = (w1 * z[1] + w2 * z[2]) * shrink + z[0];
    const Lane v0 = grow * (w0 * z[0] + w1 * z[1] + w2 * z[2]), v1 = grow * (z[1] + bent * w1), v2 = grow * (z[2] + bent * w2);
    // Boost after boost is a boost and a turn of the tangents (Wigner's rotation).
    const Lane a1 = axis[i][0], a2 = axis[i][1], k = stretch[i];
    const Lane rapid = (k - 1.0) / (k + 1.0) * shrink;
    const Lane real = 1.0 + rapid * (a1 * w1 + a2 * w2), imaginary = -rapid * (a1 * w2 - a2 * w1);
    const Lane modulus = 1.0 / (real * real + imaginary * imaginary);
    const Lane cosine = (real * real - imaginary * imaginary) * modulus, sine = 2.0 * real * imaginary * modulus;
    const Lane along = a1 * w1 + a2 * w2, across = a1 * w2 - a2 * w1;
    const Lane fore = k * (w0 + along), aft = (w0 - along) / k;
    const Lane ahead = 0.5 * (fore - aft);
    const Lane radius = square_root(ahead * ahead + across * across);
    const LaneMask boosted = radius > 1e-12;
    const Lane per_radius = 1.0 / select(boosted, radius, broadcast(1.0));
    const auto keep = [&](Lane &value, Lane next) { value = select(open, next, value); };
    keep(axis[i][0], select(boosted, (ahead * a1 - across * a2) * per_radius, a1));
    keep(axis[i][1], select(boosted, (ahead * a2 + across * a1) * per_radius, a2));
    keep(stretch[i], 0.5 * (fore + aft) + radius);
    keep(scale[i], scale[i] * grow);
    keep(scaled[i][0], v0);
    keep(scaled[i][1], cosine * v1 - sine * v2);
    keep(scaled[i][2], sine * v1 + cosine * v2);
  }

  void factorize() {
    for (int a = 0; a < 6; ++a)
      for (int b = 0; b <= a; ++b) {
        coupling[a][b] = broadcast(a == b ? 2.0 * problem.match_weight : 0.0);
        schur[a][b] = broadcast(0.0);
      }
    for (int j = 0; j < contacts; ++j) {
      stiffness[j] = 1.0 / (slack_gap[j] + slack_dual[j] / (2.0 * problem.slack_weight));
      const Lane weight = slack_dual[j] * stiffness[j];
      for (int a = 0; a < 6; ++a)
        for (int b = 0; b <= a; ++b) coupling[a][b] += weight * problem.slack_row[j][a] * problem.slack_row[j][b];
    }
    cholesky6(coupling, coupling_inverse);
    Lane response[6][6];
    for (int a = 0; a < 6; ++a)
      for (int b = 0; b <= a; ++b) response[a][b] = broadcast(0.0);
    for (int i = 0; i < contacts; ++i) {
      Lane block[6];
      if constexpr (Circular) per_scale[i] = 1.0 / scale[i], per_stretch[i] = 1.0 / stretch[i];
      choose_basis(i);
      resist(i, block);
      invert_block(block, inverse_block[i]);
      for (int k = 0; k < 6; ++k) {
        const Lane column[3] = {problem.motion[i][0][k], problem.motion[i][1][k], problem.motion[i][2][k]};
        Lane seen[3], solved[3];
        into_basis(i, column, seen);
        block_times(inverse_block[i], seen, solved);
        for (int c = 0; c < 3; ++c) turned[i][c][k] = seen[c], reduced[i][c][k] = solved[c];
      }
      for (int a = 0; a < 6; ++a)
        for (int b = 0; b <= a; ++b)
          for (int c = 0; c < 3; ++c) response[a][b] += turned[i][c][a] * reduced[i][c][b];
    }
    // schur = I + L^T response L with coupling = L L^T.
    for (int b = 0; b < 6; ++b) {
      Lane column[6];
      for (int a = 0; a < 6; ++a) {
        column[a] = broadcast(0.0);
        for (int k = b; k < 6; ++k) column[a] += (a >= k ? response[a][k] : response[k][a]) * coupling[k][b];
      }
      for (int a = b; a < 6; ++a) {
        Lane sum = broadcast(a == b ? 1.0 : 0.0);
        for (int k = a; k < 6; ++k) sum += coupling[k][a] * column[k];
        schur[a][b] = sum;
      }
    }
    cholesky6(schur, schur_inverse);
  }

  // Newton step, in the contacts' bases, for the right-hand sides `push` (impulses) and `slack_push` (complementarity of the
  // slacks).
  void solve(Lane (*push)[3], const Lane *slack_push) {
    Lane slack_pull[6];
    for (int k = 0; k < 6; ++k) slack_pull[k] = broadcast(0.0);
    for (int j = 0; j < contacts; ++j) {
      const Lane weight = (slack_push[j] - slack_dual[j] * slack_defect[j]) * stiffness[j];
      for (int k = 0; k < 6; ++k) slack_pull[k] += problem.slack_row[j][k] * weight;
    }
    Lane gathered[6];
    for (int k = 0; k < 6; ++k) gathered[k] = broadcast(0.0);
    for (int i = 0; i < contacts; ++i)
      for (int c = 0; c < 3; ++c) {
        push[i][c] += dot<6>(turned[i][c], slack_pull);
        for (int k = 0; k < 6; ++k) gathered[k] += reduced[i][c][k] * push[i][c];
      }
    Lane x[6], pressure[6], change[6];
    for (int a = 0; a < 6; ++a) {
      x[a] = broadcast(0.0);
      for (int k = a; k < 6; ++k) x[a] += coupling[k][a] * gathered[k];
    }
    solve_lower(schur, schur_inverse, x);
    solve_upper(schur, schur_inverse, x);
    for (int a = 0; a < 6; ++a) {
      pressure[a] = broadcast(0.0);
      for (int k = 0; k <= a; ++k) pressure[a] += coupling[a][k] * x[k];
      change[a] = x[a];
    }
    solve_upper(coupling, coupling_inverse, change);
    for (int i = 0; i < contacts; ++i) {
      block_times(inverse_block[i], push[i], step[i]);
      for (int c = 0; c < 3; ++c) step[i][c] -= dot<6>(reduced[i][c], pressure);
    }
    for (int j = 0; j < contacts; ++j) {
      const Lane moved = dot<6>(problem.slack_row[j], change) + slack_defect[j];
      slack_dual_step[j] = (slack_push[j] - slack_dual[j] * moved) * stiffness[j];
      slack_step[j] = slack_dual_step[j] / (2.0 * problem.slack_weight) + moved;
    }
  }

  // One Newton direction; `corrected` adds centring and, as far as `trust` says, Mehrotra's second-order term from
  // the predictor's step.
  void direction(bool corrected, Lane centre, Lane trust) {
    Lane push[kMaxContacts][3], slack_push[kMaxContacts], target[kMaxContacts][3];
    Lane facet_push[Circular ? 1 : kMaxContacts][kFacets];
    for (int i = 0; i < contacts; ++i) {
      slack_push[i] = -slack_gap[i] * slack_dual[i];
      if (corrected) slack_push[i] += centre - trust * slack_step[i] * slack_dual_step[i];
      Lane wanted[3];
      for (int c = 0; c < 3; ++c) wanted[c] = -stationarity[i][c];
      if constexpr (!Circular)
        for (int k = 0; k < kFacets; ++k) {
          facet_push[i][k] = -facet_gap[i][k] * facet_dual[i][k];
          if (corrected) facet_push[i][k] += centre - trust * facet_step[i][k] * facet_dual_step[i][k];
          for (int c = 0; c < 3; ++c) wanted[c] += facets[k].row[c] * (facet_push[i][k] * per_gap[i][k]);
        }
      into_basis(i, wanted, push[i]);
      if constexpr (Circular) {
        Lane aimed[3], back[3];
        aim(i, corrected, centre, trust, aimed);
        into_basis(i, aimed, target[i]);
        inverse_scale(i, target[i], back);
        for (int c = 0; c < 3; ++c) push[i][c] += back[c];
      }
    }
    solve(push, slack_push);
    for (int i = 0; i < contacts; ++i) {
      Lane x[3], moved[3], pressed[3];
      for (int c = 0; c < 3; ++c) x[c] = step[i][c];
      out_of_basis(i, x, step[i]);
      if constexpr (Circular) {
        inverse_scale(i, x, moved);
        for (int c = 0; c < 3; ++c) x[c] = target[i][c] - moved[c];
        inverse_scale(i, x, pressed);
        out_of_basis(i, moved, scaled_step[i]);
        out_of_basis(i, x, scaled_dual_step[i]);
        out_of_basis(i, pressed, dual_step[i]);
      } else {
        for (int k = 0; k < kFacets; ++k) {
          Lane row[3];
          facet_in_basis(i, k, row);
          facet_step[i][k] = dot<3>(row, x);
          facet_dual_step[i][k] = (facet_push[i][k] - facet_dual[i][k] * facet_step[i][k]) * per_gap[i][k];
        }
      }
    }
  }

  // scaled \ d: where the linearised complementarity wants scaled step and scaled dual step to sum to.
  void aim(int i, bool corrected, Lane centre, Lane trust, Lane *target) const {
    const Lane *v = scaled[i];
    for (int c = 0; c < 3; ++c) target[c] = -v[c];
    if (!corrected) return;
    const Lane *a = scaled_step[i], *b = scaled_dual_step[i];
    const Lane d0 = centre - trust * dot<3>(a, b);
    const Lane d1 = -trust * (a[0] * b[1] + b[0] * a[1]);
    const Lane d2 = -trust * (a[0] * b[2] + b[0] * a[2]);
    const Lane divided = (v[0] * d0 - v[1] * d1 - v[2] * d2) / determinant(v);
    target[0] += divided;
    target[1] += (d1 - divided * v[1]) / v[0];
    target[2] += (d2 - divided * v[2]) / v[0];
  }

  Lane longest_step() const {
    Lane longest = broadcast(1e30);
    for (int i = 0; i < contacts; ++i) {
      if constexpr (Circular) {
        longest = minimum(longest, step_to_cone(scaled[i], scaled_step[i]));
        longest = minimum(longest, step_to_cone(scaled[i], scaled_dual_step[i]));
      } else {
        for (int k = 0; k < kFacets; ++k) {
          longest = minimum(longest, step_to_zero(facet_gap[i][k], facet_step[i][k]));
          longest = minimum(longest, step_to_zero(facet_dual[i][k], facet_dual_step[i][k]));
        }
      }
      longest = minimum(longest, step_to_zero(slack_gap[i], slack_step[i]));
      longest = minimum(longest, step_to_zero(slack_dual[i], slack_dual_step[i]));
    }
    return longest;
  }

  Lane complementarity_after(Lane length) const {
    Lane sum = broadcast(0.0);
    for (int i = 0; i < contacts; ++i) {
      if constexpr (Circular) {
        for (int c = 0; c < 3; ++c)
          sum += (scaled[i][c] + length * scaled_step[i][c]) * (scaled[i][c] + length * scaled_dual_step[i][c]);
      } else {
        for (int k = 0; k < kFacets; ++k)
          sum += (facet_gap[i][k] + length * facet_step[i][k]) * (facet_dual[i][k] + length * facet_dual_step[i][k]);
      }
      sum += (slack_gap[i] + length * slack_step[i]) * (slack_dual[i] + length * slack_dual_step[i]);
    }
    return sum / static_cast<double>(degree());
  }

  // Moves the open lanes; a closed lane keeps its solution, whatever its step has become.
  void advance(LaneMask open, Lane length) {
    const auto move = [&](Lane &value, Lane by) { value = select(open, value + length * by, value); };
    for (int i = 0; i < contacts; ++i) {
      for (int c = 0; c < 3; ++c) move(impulse[i][c], step[i][c]);
      if constexpr (Circular) {
        for (int c = 0; c < 3; ++c) move(dual[i][c], dual_step[i][c]);
        rescale(i, open, length);
      } else {
        for (int k = 0; k < kFacets; ++k) {
          move(facet_gap[i][k], facet_step[i][k]);
          move(facet_dual[i][k], facet_dual_step[i][k]);
        }
      }
      move(slack_gap[i], slack_step[i]);
      move(slack_dual[i], slack_dual_step[i]);
    }
  }

  int run() {
    const Lane zero = broadcast(0.0), one = broadcast(1.0);
    start();
    LaneMask open = zero == zero;
    for (int iteration = 0;; ++iteration) {
      const Lane worst = residuals();
      const Lane centre = complementarity();
      const double tolerance = Circular ? options.complementarity_tolerance : options.facet_complementarity_tolerance;
      open = open & ~((centre <= tolerance) & (worst <= options.stationarity_tolerance));
      if (!any(open) || iteration == options.max_iterations) return iteration;
      factorize();
      direction(false, zero, zero);
      const Lane reach = minimum(longest_step(), broadcast(1.0));
      const Lane ratio = complementarity_after(reach) / centre;
      direction(true, maximum(ratio * ratio * ratio, broadcast(1e-12)) * centre, select(reach < kTrusted, zero, one));
      const Lane length = minimum(0.995 * longest_step(), broadcast(1.0));
      open = open & (length > 1e-9);  // a lane that no longer moves, or met a value that is not finite, keeps what it has
      advance(open, length);
    }
  }
};

// The larger of two numbers; NaN, which nothing heals, is larger than any.
inline Lane larger(Lane a, Lane b) { return select((b <= a) | (a != a), a, b); }

// How far an impulse is from optimal, judged by the objective alone and not by the method's own multipliers.
//
// Circular cone: the natural residual |l - proj(l - step gradient)|_inf, which is zero at the optimum only, for any step above
// zero. Polyhedral cone: the largest of stationarity, complementarity and infeasibility with the facets' multipliers, times the
// step where they are gradients.
template <bool Circular>
Lane certificate(const InteriorPoint<Circular> &method, Lane step) {
  Lane gradient[kMaxContacts][3];
  objective_gradient(method.problem, method.impulse, gradient);
  Lane worst = broadcast(0.0);
  for (int i = 0; i < method.contacts; ++i) {
    if constexpr (Circular) {
      Lane trial[3], projected[3];
      for (int c = 0; c < 3; ++c) trial[c] = method.impulse[i][c] - step * gradient[i][c];
      project_circular(trial, projected);
      for (int c = 0; c < 3; ++c) {
        const Lane off = absolute(method.impulse[i][c] - projected[c]);
        worst = larger(worst, off);
      }
    } else {
      for (int c = 0; c < 3; ++c)
        for (int k = 0; k < kFacets; ++k) gradient[i][c] -= method.facets[k].row[c] * method.facet_dual[i][k];
      for (int k = 0; k < kFacets; ++k) {
        const double *row = method.facets[k].row;
        const Lane gap = row[0] * method.impulse[i][0] + row[1] * method.impulse[i][1] + row[2] * method.impulse[i][2];
        const Lane dual = step * method.facet_dual[i][k];
        const Lane off = maximum(absolute(gap * dual), -minimum(gap, dual));
        worst = larger(worst, off);
      }
      for (int c = 0; c < 3; ++c) worst = larger(worst, absolute(step * gradient[i][c]));
    }
  }
  return worst;
}

// The largest curvature of the objective along one impulse, at least 1: of light bodies, whose velocities change much, it is
// large. Rounding alone makes gradients that large times an impulse's error; with a step of one over it the natural residual is
// an error of impulses.
inline Lane largest_curvature(const ConeProblem &problem) {
  Lane largest = broadcast(1.0);
  for (int i = 0; i < problem.contacts; ++i)
    for (int c = 0; c < 3; ++c) {
      Lane squared = broadcast(0.0);
      for (int k = 0; k < 6; ++k) squared += problem.motion[i][c][k] * problem.motion[i][c][k];
      const int diagonal[3] = {0, 3, 5};
      largest = maximum(largest, 2.0 * (problem.match_weight * squared + problem.block[i][diagonal[c]]));
    }
  return largest;
}

template <bool Circular>
void solve_with(const ConeProblem &problem, const SolverOptions &options, ConeSolution &solution) {
  InteriorPoint<Circular> method(problem, options);
  solution.iterations = method.run();
  solution.residual = certificate<Circular>(method, broadcast(1.0));
  solution.solved = solution.residual <= options.residual_tolerance;
  if (any(~solution.solved)) {
    const Lane scaled = certificate<Circular>(method, 1.0 / largest_curvature(problem));
    solution.residual = select(solution.solved, solution.residual, scaled);
    solution.solved = solution.residual <= options.residual_tolerance;
  }
  for (int i = 0; i < problem.contacts; ++i)
    for (int c = 0; c < 3; ++c) solution.impulse[i][c] = method.impulse[i][c];
}

inline void solve(const ConeProblem &problem, const SolverOptions &options, ConeSolution &solution) {
  if (problem.circular)
    solve_with<true>(problem, options, solution);
  else
    solve_with<false>(problem, options, solution);
}

}  // namespace contact_curation
