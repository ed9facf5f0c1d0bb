// The Gauss-Newton profile Fisher matrix of one transition (method.md 1.5): F = J_theta^T P J_theta. The projection
// P = I - J_l (J_l^T J_l + eps I)^-1 J_l^T removes what a change of the impulses l can explain; J_l = dr/dl is restricted to
// the free directions of l, along which l may change in both senses.
//
// Contacts act on each other only through the six numbers of A l. Of contact i let J be the derivatives by theta of its own
// residuals, D = J_l^T J_l + eps I of these, C = J_l^T J and M_i the columns of A, all along its free directions; let V be
// d(A l)/dtheta at fixed l, E_j the derivative of slack j at a fixed velocity, and sums over j those over active slacks. With
//
//   S = w_m I + w_s sum_j B_j^T B_j,   U = w_s sum_j B_j^T E_j
//
// the impulses of contacts can be eliminated one after another:
//
//   F = sum_i (J^T J - C^T D^-1 C)_i + w_s sum_j E_j^T E_j - U^T S^-1 U + Z^T H Z
//   Z = V - sum_i (M D^-1 C)_i + S^-1 U,   H = (S^-1 + sum_i (M D^-1 M^T)_i)^-1
//
// The D of a contact that touches the ground is nearly singular, so that M D^-1 is large. Such contacts are left out of the
// sums with D^-1 and eliminated last, together:  - X^T (D + M^T H M)^-1 X,  X = C + M^T H Z.
#pragma once

#include <cstring>
#include <vector>

#include "dense_rows.hpp"
#include "polytope_transition.hpp"

namespace contact_curation {

// An impulse component is at the cone's apex below this, and inside the cone when its dual is below this [kg half-widths / s].
constexpr double kFreeTolerance = 1e-6;

// A contact counts as touching where the velocity's residual resists its impulse so many times more than its own ones do.
constexpr double kTouching = 1e3;

class ProfileFisher {
 public:
  ProfileFisher(const BouncingModel &model) : model_(model), contacts_(model.contacts), parameters_(parameter_count(model)) {
    stride_ = (parameters_ + kLanes - 1) / kLanes * kLanes;
    velocity_rows_.resize(6 * stride_);
    slack_rows_.resize(6 * stride_);
    whitened_rows_.resize(6 * stride_);
    touching_rows_.resize(3 * contacts_ * stride_);
  }

  int stride() const { return stride_; }

  // Adds weight * F of one lane to the lower triangle of `fisher` (P x P, row-major, rows `stride` apart).
  void add(const Transition &at, const ConeProblem &problem, const ConeSolution &solution, const Outcome &outcome, int lane,
           double weight, double *fisher, int stride) {
    unpack(at, problem, solution, outcome, lane);
    differentiate_velocity();
    factor_velocity();
    for (int i = 0; i < contacts_; ++i) {
      differentiate_contact(i);
      if (slack_[i] < 0.0) differentiate_slack(i);
      eliminate(i);
      add_own(weight, fisher, stride);
    }
    whiten();
    eliminate_touching();
    weighted_.clear();
    for (int k = 0; k < 6; ++k) weighted_.push_back({&whitened_rows_[k * stride_], weight});
    for (int k = 0; k < 6; ++k) weighted_.push_back({&slack_rows_[k * stride_], -weight});
    for (int k = 0; k < touching_; ++k) weighted_.push_back({&touching_rows_[k * stride_], -weight});
    add_outers(weighted_, fisher, stride);
  }

 private:
  // Rows of one contact, whose derivatives by theta are zero but in its own columns: phi', the two e_i, and an active slack.
  // The columns are in order: those of its vertex, the normal, its tangent vertex, the tangents, the height and, if the body
  // bounces, the restitution.
  enum OwnRow { kGap = 0, kCone = 1, kSlack = 3, kOwnRows = 4 };
  enum OwnColumn { kVertex = 0, kNormal = 3, kVertexTangent = 6, kTangents = 9, kHeight = 15, kRestitution = 16 };
  static constexpr int kOwnWidth = 3 * kLanes;
  int own_columns() const { return model_.bounces ? kRestitution + 1 : kHeight + 1; }
  int column(int i, int k) const {
    if (k < kNormal) return vertex(i) + k;
    if (k < kVertexTangent) return normal() + k - kNormal;
    if (k < kTangents) return vertex_tangent(i) + k - kVertexTangent;
    return k < kHeight ? tangent(0) + k - kTangents : height() + k - kHeight;
  }

  // Derivatives of a gap by the contact's vertex and by the ground's normal; that by the height is -1.
  struct GapSlopes {
    double vertex[3], normal[3];
  };

  // Columns of theta.
  int vertex(int i) const { return 3 * i; }
  int normal() const { return 3 * contacts_; }
  int vertex_tangent(int i) const { return 3 * contacts_ + 3 + 3 * i; }
  int tangent(int t) const { return 6 * contacts_ + 3 + 3 * t; }
  int height() const { return 6 * contacts_ + 9; }

  static void cross3(const double *a, const double *b, double *c) {
    c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
  }

  void unpack(const Transition &at, const ConeProblem &problem, const ConeSolution &solution, const Outcome &outcome,
              int lane) {
    dt_ = at.dt[lane];
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b)
        rotation_[a][b] = at.rotation[a][b][lane], rotation_next_[a][b] = at.rotation_next[a][b][lane];
      position_[a] = at.position[a][lane], position_next_[a] = at.position_next[a][lane];
      normal_body_[a] = at.normal_body[a][lane], normal_body_next_[a] = at.normal_body_next[a][lane];
      for (int t = 0; t < 2; ++t) tangents_body_[t][a] = at.tangents_body[t][a][lane];
    }
    for (int a = 0; a < 6; ++a) {
      velocity_next_[a] = at.velocity_next[a][lane];
      free_[a] = at.free_velocity[a][lane];
      moving_[a] = free_[a] + outcome.change[a][lane];
    }
    for (int i = 0; i < contacts_; ++i) {
      gap_[i] = at.gap[i][lane], gap_next_[i] = at.gap_next[i][lane], slack_[i] = outcome.slack[i][lane];
      depth_[i] = model_.bounces ? at.depth[i][lane] : 0.0;
      speed_[i] = at.slip_speed[i][lane];
      for (int t = 0; t < 2; ++t) slip_[i][t] = at.slip[i][t][lane];
      for (int c = 0; c < 3; ++c) {
        impulse_[i][c] = solution.impulse[i][c][lane];
        for (int k = 0; k < 6; ++k) motion_[i][c][k] = problem.motion[i][c][k][lane];
      }
      for (int k = 0; k < 6; ++k) {
        slack_row_[i][k] = problem.slack_row[i][k][lane];
        block_[i][k] = problem.block[i][k][lane];
      }
    }
    Lane gradient[kMaxContacts][3];
    objective_gradient(problem, solution.impulse, gradient);
    for (int i = 0; i < contacts_; ++i)
      for (int c = 0; c < 3; ++c) gradient_[i][c] = gradient[i][c][lane];
  }

  // d(A l)/dtheta at fixed l: 6 rows.
  void differentiate_velocity() {
    std::fill(velocity_rows_.begin(), velocity_rows_.end(), 0.0);
    double lever[3] = {0, 0, 0}, lever_t[2][3] = {{0, 0, 0}, {0, 0, 0}}, total[3] = {0, 0, 0};
    for (int i = 0; i < contacts_; ++i) {
      const double *p = model_.vertices_normal + 3 * i, *pt = model_.vertices_tangent + 3 * i;
      double pressed[3], pressed_t[3];
      for (int a = 0; a < 3; ++a) {
        lever[a] += impulse_[i][0] * p[a];
        pressed[a] = impulse_[i][0] * normal_body_[a];
        pressed_t[a] = impulse_[i][1] * tangents_body_[0][a] + impulse_[i][2] * tangents_body_[1][a];
        for (int t = 0; t < 2; ++t) lever_t[t][a] += impulse_[i][1 + t] * pt[a];
      }
      for (int c = 0; c < 3; ++c) total[c] += impulse_[i][c];
      put_turns(vertex(i), pressed);
      put_turns(vertex_tangent(i), pressed_t);
    }
    put_pushes(normal(), total[0], lever);
    for (int t = 0; t < 2; ++t) put_pushes(tangent(t), total[1 + t], lever_t[t]);
  }

  // Columns of e_k x push, as angular velocity.
  void put_turns(int first, const double *push) {
    for (int k = 0; k < 3; ++k) {
      double unit[3] = {0, 0, 0}, turn[3];
      unit[k] = 1.0;
      cross3(unit, push, turn);
      put_angular(first + k, turn);
    }
  }

  // Columns of a force direction e_k in the world with a lever in the body.
  void put_pushes(int first, double total, const double *lever) {
    for (int k = 0; k < 3; ++k) {
      const double body[3] = {rotation_[k][0], rotation_[k][1], rotation_[k][2]};  // R^T e_k
      double turn[3];
      cross3(lever, body, turn);
      put_angular(first + k, turn);
      velocity_rows_[k * stride_ + first + k] += total / model_.mass;
    }
  }

  void put_angular(int column, const double *torque) {
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b) velocity_rows_[(3 + a) * stride_ + column] += model_.inverse_inertia[3 * a + b] * torque[b];
  }

  // S = L L^T in velocity_factor_; nothing is eliminated yet.
  void factor_velocity() {
    for (int a = 0; a < 6; ++a)
      for (int b = 0; b <= a; ++b) velocity_factor_[a][b] = a == b ? model_.match_weight : 0.0;
    for (int j = 0; j < contacts_; ++j) {
      if (slack_[j] >= 0.0) continue;
      for (int a = 0; a < 6; ++a)
        for (int b = 0; b <= a; ++b) velocity_factor_[a][b] += model_.slack_weight * slack_row_[j][a] * slack_row_[j][b];
    }
    factor(velocity_factor_[0], 6, 6, least_pivot());
    std::fill(slack_rows_.begin(), slack_rows_.end(), 0.0);
    for (double (&row)[6] : spread_) std::fill(row, row + 6, 0.0);
    touching_ = 0;
  }

  // E_j as the last of the contact's own rows, and its part of L^-1 U in slack_rows_.
  void differentiate_slack(int j) {
    double *row = own_rows_[kSlack];
    const GapSlopes gap = gap_slopes_after(j, moving_);
    for (int a = 0; a < 3; ++a) row[kVertex + a] = gap.vertex[a], row[kNormal + a] = gap.normal[a];
    row[kHeight] = -1.0;
    if (model_.bounces) add_restitution(j, row);
    weights_[kSlack][kSlack] = model_.slack_weight;
    double pull[6];
    for (int k = 0; k < 6; ++k) pull[k] = model_.slack_weight * slack_row_[j][k];
    solve_rows(velocity_factor_[0], 6, 6, pull, 1);
    for (int k = 0; k < 6; ++k)
      for (int q = 0; q < own_columns(); ++q) slack_rows_[k * stride_ + own_column_[q]] += pull[k] * row[q];
  }

  // Slopes of phi_i + dt J_i velocity, the linearised gap of contact i after the period.
  GapSlopes gap_slopes_after(int i, const double *velocity) const {
    const double *p = model_.vertices_normal + 3 * i;
    double turned[3], leverage[3];
    cross3(normal_body_, velocity + 3, turned);
    cross3(velocity + 3, p, leverage);
    GapSlopes slopes;
    for (int a = 0; a < 3; ++a) {
      slopes.vertex[a] = normal_body_[a] + dt_ * turned[a];
      slopes.normal[a] = position_[a] + dt_ * velocity[a];
      for (int b = 0; b < 3; ++b) slopes.normal[a] += rotation_[a][b] * (p[b] + dt_ * leverage[b]);
    }
    return slopes;
  }

  // Adds the slopes of the restitution term e times the depth of contact i.
  void add_restitution(int i, double *row) const {
    const double share = depth_[i] < 0.0 ? model_.restitution : 0.0, still[6] = {0, 0, 0, 0, 0, 0};
    const double from_above = gap_[i] < 0.0 ? 0.0 : 1.0;  // else the gap before is left out of the depth
    const GapSlopes after = gap_slopes_after(i, free_), before = gap_slopes_after(i, still);
    for (int a = 0; a < 3; ++a) {
      row[kVertex + a] += share * (after.vertex[a] - (1.0 - from_above) * before.vertex[a]);
      row[kNormal + a] += share * (after.normal[a] - (1.0 - from_above) * before.normal[a]);
    }
    row[kHeight] -= share * from_above;
    row[kRestitution] += depth_[i];
  }

  // The contact's own rows: slopes of phi'_i and of the two e_i; weights_ makes J^T J of them.
  void differentiate_contact(int i) {
    const double *l = impulse_[i], *p = model_.vertices_normal + 3 * i, *pt = model_.vertices_tangent + 3 * i;
    for (int q = 0; q < own_columns(); ++q) own_column_[q] = column(i, q);
    std::memset(own_rows_, 0, sizeof own_rows_);
    std::memset(weights_, 0, sizeof weights_);
    double *gap = own_rows_[kGap];
    for (int a = 0; a < 3; ++a) {
      gap[kVertex + a] = normal_body_next_[a];
      gap[kNormal + a] = position_next_[a];
      for (int b = 0; b < 3; ++b) gap[kNormal + a] += rotation_next_[a][b] * p[b];
    }
    gap[kHeight] = -1.0;
    if (model_.bounces) add_restitution(i, gap);
    weights_[kGap][kGap] = model_.normal_weight * l[0] * l[0] + model_.tangent_weight * (l[1] * l[1] + l[2] * l[2]);
    double swept[3], travel[3], spun[2][3];
    cross3(velocity_next_ + 3, pt, swept);
    for (int a = 0; a < 3; ++a) {
      travel[a] = velocity_next_[a];
      for (int b = 0; b < 3; ++b) travel[a] += rotation_[a][b] * swept[b];
    }
    for (int t = 0; t < 2; ++t) cross3(tangents_body_[t], velocity_next_ + 3, spun[t]);
    for (int t = 0; t < 2; ++t) {
      double *row = own_rows_[kCone + t], mix[2];
      for (int b = 0; b < 2; ++b) mix[b] = (t == b ? l[0] : 0.0) + (speed_[i] > 0.0 ? l[1 + t] * slip_[i][b] / speed_[i] : 0.0);
      for (int a = 0; a < 3; ++a) row[kVertexTangent + a] = mix[0] * spun[0][a] + mix[1] * spun[1][a];
      for (int b = 0; b < 2; ++b)
        for (int a = 0; a < 3; ++a) row[kTangents + 3 * b + a] = mix[b] * travel[a];
      weights_[kCone + t][kCone + t] = model_.cone_weight;
    }
  }

  // Basis of the free directions of contact i: all three inside the cone, none at the apex; on the circular cone the ray and
  // the rim's direction, on the polyhedral one those of the facet, or the ray where two facets meet.
  int free_directions(int i, double (*basis)[3]) const {
    const double *l = impulse_[i];
    if (l[0] <= kFreeTolerance) return 0;
    if (gradient_[i][0] <= kFreeTolerance) {
      for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 3; ++c) basis[k][c] = k == c ? 1.0 : 0.0;
      return 3;
    }
    if (!model_.circular) return facet_directions(l, basis);
    const double radius = std::sqrt(l[1] * l[1] + l[2] * l[2]);
    const double length = std::sqrt(l[0] * l[0] + radius * radius);
    for (int c = 0; c < 3; ++c) basis[0][c] = l[c] / length;
    if (radius == 0.0) return 1;
    basis[1][0] = 0.0, basis[1][1] = -l[2] / radius, basis[1][2] = l[1] / radius;
    return 2;
  }

  static int facet_directions(const double *l, double (*basis)[3]) {
    int touching = 0;
    for (int k = 0; k < kFacets; ++k) {
      const Facet facet = polyhedral_facet(k);
      if (facet.row[0] * l[0] + facet.row[1] * l[1] + facet.row[2] * l[2] > kFreeTolerance) continue;
      if (++touching == 1) {
        const double half = std::sqrt(0.5);
        basis[0][0] = half, basis[0][1] = -half * facet.row[1], basis[0][2] = -half * facet.row[2];
        basis[1][0] = 0.0, basis[1][1] = facet.row[2], basis[1][2] = -facet.row[1];
      }
    }
    if (touching == 1) return 2;
    const double length = std::sqrt(l[0] * l[0] + l[1] * l[1] + l[2] * l[2]);
    for (int c = 0; c < 3; ++c) basis[0][c] = l[c] / length;
    return 1;
  }

  // Takes the impulse of contact i out of its own rows and of the velocity's, or adds it to those that touch.
  void eliminate(int i) {
    double basis[3][3], moved[3][6], gram[3][3];
    const int free = free_directions(i, basis);
    double pulled[3][3];  // C as multiples of the own rows
    const double *d = block_[i], *l = impulse_[i];
    for (int k = 0; k < free; ++k) {
      const double *x = basis[k];
      for (int a = 0; a < 6; ++a) moved[k][a] = motion_[i][0][a] * x[0] + motion_[i][1][a] * x[1] + motion_[i][2][a] * x[2];
      pulled[k][kGap] =
          gap_next_[i] * (model_.normal_weight * l[0] * x[0] + model_.tangent_weight * (l[1] * x[1] + l[2] * x[2]));
      for (int t = 0; t < 2; ++t) pulled[k][kCone + t] = model_.cone_weight * (slip_[i][t] * x[0] + speed_[i] * x[1 + t]);
      const double curved[3] = {d[0] * x[0] + d[1] * x[1] + d[2] * x[2], d[1] * x[0] + d[3] * x[1] + d[4] * x[2],
                                d[2] * x[0] + d[4] * x[1] + d[5] * x[2]};
      for (int m = 0; m <= k; ++m) gram[k][m] = curved[0] * basis[m][0] + curved[1] * basis[m][1] + curved[2] * basis[m][2];
      gram[k][k] += model_.regularization;
    }
    if (!eliminate_far(free, gram, moved, pulled)) keep_touching(free, gram, moved, pulled);
  }

  // Says whether the contact is far enough from the ground for that.
  bool eliminate_far(int free, const double (*gram)[3], const double (*moved)[6], const double (*pulled)[3]) {
    double root[3][3], by_velocity[3][6], by_own[3][3], resisted = 0.0;
    std::memcpy(root, gram, sizeof root);
    std::memcpy(by_velocity, moved, sizeof by_velocity);
    std::memcpy(by_own, pulled, sizeof by_own);
    factor(root[0], 3, free, least_pivot());
    solve_rows(root[0], 3, free, by_velocity[0], 6);
    solve_rows(root[0], 3, free, by_own[0], 3);
    for (int k = 0; k < free; ++k)
      for (int a = 0; a < 6; ++a) resisted += model_.match_weight * by_velocity[k][a] * by_velocity[k][a];
    if (!(resisted <= kTouching)) return false;
    for (int k = 0; k < free; ++k) {
      for (int a = 0; a < 6; ++a)
        for (int b = 0; b <= a; ++b) spread_[a][b] += by_velocity[k][a] * by_velocity[k][b];
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) weights_[a][b] -= by_own[k][a] * by_own[k][b];
    }
    for (int a = 0; a < 6; ++a) {
      double share[3] = {0, 0, 0};
      for (int k = 0; k < free; ++k)
        for (int r = 0; r < 3; ++r) share[r] += by_velocity[k][a] * by_own[k][r];
      double *row = &velocity_rows_[a * stride_];
      for (int q = 0; q < own_columns(); ++q)
        row[own_column_[q]] -= share[0] * own_rows_[0][q] + share[1] * own_rows_[1][q] + share[2] * own_rows_[2][q];
    }
    return true;
  }

  // C in touching_rows_, M in moved_ and D in gram_.
  void keep_touching(int free, const double (*gram)[3], const double (*moved)[6], const double (*pulled)[3]) {
    const int first = touching_;
    for (int k = 0; k < free; ++k, ++touching_) {
      std::copy(moved[k], moved[k] + 6, moved_[touching_]);
      std::fill(gram_[touching_], gram_[touching_] + touching_, 0.0);
      std::copy(gram[k], gram[k] + k + 1, gram_[touching_] + first);
      double *row = &touching_rows_[touching_ * stride_];
      std::fill(row, row + stride_, 0.0);
      for (int q = 0; q < own_columns(); ++q)
        row[own_column_[q]] = pulled[k][0] * own_rows_[0][q] + pulled[k][1] * own_rows_[1][q] + pulled[k][2] * own_rows_[2][q];
    }
  }

  // H = Q Q^T, by K = I + L^T N L = R R^T with Q = L R^-T: leaves Q^T Z in whitened_rows_, Q^T in whitening_.
  void whiten() {
    double root[6][6];
    const auto &factor_of = velocity_factor_;
    for (int a = 0; a < 6; ++a)
      for (int b = 0; b <= a; ++b) {
        root[a][b] = a == b ? 1.0 : 0.0;
        for (int m = a; m < 6; ++m)
          for (int n = b; n < 6; ++n)
            root[a][b] += factor_of[m][a] * (m >= n ? spread_[m][n] : spread_[n][m]) * factor_of[n][b];
      }
    factor(root[0], 6, 6, least_pivot());
    WeightedRow added[6];
    whitened_rows_ = slack_rows_;
    for (int a = 0; a < 6; ++a) {
      for (int k = 0; k < 6; ++k) {
        whitening_[a][k] = k >= a ? factor_of[k][a] : 0.0;
        added[k] = {&velocity_rows_[k * stride_], whitening_[a][k]};
      }
      add_rows(added + a, 6 - a, &whitened_rows_[a * stride_], stride_);
    }
    solve_rows(root[0], 6, 6, whitening_[0], 6);
    solve_rows(root[0], 6, 6, whitened_rows_.data(), stride_);
  }

  // Leaves in touching_rows_ the rows whose squares are X^T (D + M^T H M)^-1 X.
  void eliminate_touching() {
    WeightedRow added[6];
    for (int a = 0; a < touching_; ++a) {
      double moved[6];
      for (int k = 0; k < 6; ++k) {
        moved[k] = 0.0;
        for (int c = 0; c < 6; ++c) moved[k] += whitening_[k][c] * moved_[a][c];
        added[k] = {&whitened_rows_[k * stride_], moved[k]};
      }
      std::copy(moved, moved + 6, moved_[a]);
      add_rows(added, 6, &touching_rows_[a * stride_], stride_);
      for (int b = 0; b <= a; ++b)
        for (int k = 0; k < 6; ++k) gram_[a][b] += moved_[a][k] * moved_[b][k];
    }
    factor(gram_[0], 3 * kMaxContacts, touching_, least_pivot());
    solve_rows(gram_[0], 3 * kMaxContacts, touching_, touching_rows_.data(), stride_);
  }

  double least_pivot() const { return 1e-3 * model_.regularization; }

  // Adds weight * own_rows^T weights own_rows.
  void add_own(double weight, double *fisher, int stride) const {
    for (int a = 0; a < own_columns(); ++a) {
      WeightedRow mixed[kOwnRows];
      double sum[kOwnWidth] = {};
      for (int s = 0; s < kOwnRows; ++s) {
        mixed[s] = {own_rows_[s], 0.0};
        for (int r = 0; r < kOwnRows; ++r) mixed[s].weight += weight * own_rows_[r][a] * weights_[r][s];
      }
      add_rows(mixed, kOwnRows, sum, a + 1);
      double *into = fisher + static_cast<long>(own_column_[a]) * stride;
      for (int b = 0; b <= a; ++b) into[own_column_[b]] += sum[b];
    }
  }

  const BouncingModel &model_;
  int contacts_, parameters_, stride_, touching_ = 0;
  double dt_, rotation_[3][3], rotation_next_[3][3], position_[3], position_next_[3];
  double normal_body_[3], normal_body_next_[3], tangents_body_[2][3], velocity_next_[6], moving_[6], free_[6];
  double gap_[kMaxContacts], gap_next_[kMaxContacts], depth_[kMaxContacts], slack_[kMaxContacts], speed_[kMaxContacts],
      slip_[kMaxContacts][2];
  double impulse_[kMaxContacts][3], gradient_[kMaxContacts][3], motion_[kMaxContacts][3][6];
  double slack_row_[kMaxContacts][6], block_[kMaxContacts][6];
  int own_column_[kOwnWidth];
  double own_rows_[kOwnRows][kOwnWidth], weights_[kOwnRows][kOwnRows];  // of one contact: what is left of J^T J as weights
  double velocity_factor_[6][6], spread_[6][6], whitening_[6][6];
  double moved_[3 * kMaxContacts][6], gram_[3 * kMaxContacts][3 * kMaxContacts];  // of those that touch
  std::vector<double> velocity_rows_, slack_rows_, whitened_rows_, touching_rows_;
  std::vector<WeightedRow> weighted_;
};

}  // namespace contact_curation
