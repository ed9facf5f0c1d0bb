// The Gauss-Newton profile Fisher matrix of one transition (method.md 1.5): F = J_theta^T P J_theta. The projection
// P = I - J_l (J_l^T J_l + eps I)^-1 J_l^T removes what a change of the impulses l can explain; J_l = dr/dl is restricted to
// the free directions of l, along which l may change in both senses.
//
// The residuals r are sqrt(w_m) (A l - b), the gaps times impulses, the slips e_i and the slacks. Their Jacobians are never
// stored as full matrices: a contact has entries in its few own columns, and acts on all other columns only through the six
// rows of A l.
#pragma once

#include <cstring>
#include <vector>

#include "polytope_transition.hpp"

namespace contact_curation {

// An impulse component is at the cone's apex below this, and inside the cone when its dual is below this [kg half-widths / s].
constexpr double kFreeTolerance = 1e-6;

class ProfileFisher {
 public:
  ProfileFisher(const BouncingModel &model) : model_(model), contacts_(model.contacts), parameters_(parameter_count(model)) {
    stride_ = (parameters_ + kLanes - 1) / kLanes * kLanes;
    velocity_rows_.resize(6 * stride_);
    pulled_.resize(6 * stride_);
    slack_rows_.resize(contacts_ * stride_);
    free_rows_.resize(3 * contacts_ * stride_);
  }

  // Adds weight * F of one lane to the lower triangle of `fisher` (P x P, row-major, rows `stride` apart).
  void add(const Transition &at, const ConeProblem &problem, const ConeSolution &solution, const Outcome &outcome, int lane,
           double weight, double *fisher, int stride) {
    unpack(at, problem, solution, outcome, lane);
    differentiate_velocity();
    differentiate_slacks();
    differentiate_contacts();
    const int free = eliminate();
    weighted_.clear();
    for (int k = 0; k < 6; ++k) weighted_.push_back({&velocity_rows_[k * stride_], weight * model_.match_weight});
    for (int k = 0; k < active_; ++k) weighted_.push_back({&slack_rows_[k * stride_], weight * model_.slack_weight});
    for (int k = 0; k < free; ++k) weighted_.push_back({&free_rows_[k * stride_], -weight});
    add_outers(weighted_, fisher, stride);
    for (int i = 0; i < contacts_; ++i) add_contact(i, weight, fisher, stride);
  }

  struct WeightedRow {
    const double *row;
    double weight;
  };

 private:
  // into += weight * row, row after row, in whole vectors; `width` numbers at least.
  static void add_rows(const WeightedRow *rows, int count, double *into, int width) {
    int q = 0;
    for (; q + 3 * kPack < width; q += 4 * kPack) add_to_packs<4>(rows, count, into, q);
    if (q + 2 * kPack < width)
      add_to_packs<3>(rows, count, into, q);
    else if (q + kPack < width)
      add_to_packs<2>(rows, count, into, q);
    else if (q < width)
      add_to_packs<1>(rows, count, into, q);
  }

  // The same for so many vectors from number q on, which stay in registers while all rows are added to them.
  template <int Packs>
  static void add_to_packs(const WeightedRow *rows, int count, double *into, int q) {
    Pack sums[Packs];
    for (int p = 0; p < Packs; ++p) std::memcpy(&sums[p], into + q + p * kPack, sizeof(Pack));
    for (int k = 0; k < count; ++k)
      for (int p = 0; p < Packs; ++p) {
        Pack row;
        std::memcpy(&row, rows[k].row + q + p * kPack, sizeof row);
        sums[p] += rows[k].weight * row;
      }
    for (int p = 0; p < Packs; ++p) std::memcpy(into + q + p * kPack, &sums[p], sizeof(Pack));
  }

  struct Sparse {
    int column[16];
    double value[16];
    int size = 0;
    void put(int at, double x) { column[size] = at, value[size++] = x; }
  };

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
  int restitution() const { return 6 * contacts_ + 10; }

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

  // Rows of the active slacks, and pulled = w_m dA l/dtheta + w_s sum_j B_j^T (row of slack j).
  void differentiate_slacks() {
    for (int k = 0; k < 6 * stride_; ++k) pulled_[k] = model_.match_weight * velocity_rows_[k];
    active_ = 0;
    WeightedRow added[6 + kMaxContacts];
    for (int j = 0; j < contacts_; ++j) {
      if (slack_[j] >= 0.0) continue;
      double *row = &slack_rows_[active_ * stride_];
      std::fill(row, row + stride_, 0.0);
      for (int k = 0; k < 6; ++k) added[k] = {&velocity_rows_[k * stride_], slack_row_[j][k]};
      add_rows(added, 6, row, stride_);
      const GapSlopes gap = gap_slopes_after(j, moving_);
      for (int a = 0; a < 3; ++a) row[vertex(j) + a] += gap.vertex[a], row[normal() + a] += gap.normal[a];
      row[height()] -= 1.0;
      if (model_.bounces) {
        double slope[7];
        differentiate_restitution(j, slope);
        for (int a = 0; a < 3; ++a) row[vertex(j) + a] += slope[a], row[normal() + a] += slope[3 + a];
        row[height()] += slope[6];
        row[restitution()] += depth_[j];
      }
      active_index_[active_++] = j;
    }
    for (int k = 0; k < 6; ++k) {
      for (int s = 0; s < active_; ++s)
        added[s] = {&slack_rows_[s * stride_], model_.slack_weight * slack_row_[active_index_[s]][k]};
      add_rows(added, active_, &pulled_[k * stride_], stride_);
    }
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

  // Slopes of the restitution term e times the depth of contact i: by its vertex (3), the normal (3) and the height (1).
  void differentiate_restitution(int i, double *slope) const {
    const double share = depth_[i] < 0.0 ? model_.restitution : 0.0, still[6] = {0, 0, 0, 0, 0, 0};
    const double from_above = gap_[i] < 0.0 ? 0.0 : 1.0;  // else the gap before is left out of the depth
    const GapSlopes after = gap_slopes_after(i, free_), before = gap_slopes_after(i, still);
    for (int a = 0; a < 3; ++a) {
      slope[a] = share * (after.vertex[a] - (1.0 - from_above) * before.vertex[a]);
      slope[3 + a] = share * (after.normal[a] - (1.0 - from_above) * before.normal[a]);
    }
    slope[6] = -share * from_above;
  }

  // Per contact: the closed-gap row and the two rows of e_i, each on its own few columns.
  void differentiate_contacts() {
    for (int i = 0; i < contacts_; ++i) {
      const double *p = model_.vertices_normal + 3 * i, *pt = model_.vertices_tangent + 3 * i;
      Sparse &gap = gap_rows_[i];
      gap.size = 0;
      for (int a = 0; a < 3; ++a) gap.put(vertex(i) + a, normal_body_next_[a]);
      for (int a = 0; a < 3; ++a) {
        double arm = position_next_[a];
        for (int b = 0; b < 3; ++b) arm += rotation_next_[a][b] * p[b];
        gap.put(normal() + a, arm);
      }
      gap.put(height(), -1.0);
      if (model_.bounces) {
        double slope[7];
        differentiate_restitution(i, slope);
        for (int k = 0; k < 7; ++k) gap.value[k] += slope[k];
        gap.put(restitution(), depth_[i]);
      }
      double swept[3], travel[3], spun[2][3];
      cross3(velocity_next_ + 3, pt, swept);
      for (int a = 0; a < 3; ++a) {
        travel[a] = velocity_next_[a];
        for (int b = 0; b < 3; ++b) travel[a] += rotation_[a][b] * swept[b];
      }
      for (int t = 0; t < 2; ++t) cross3(tangents_body_[t], velocity_next_ + 3, spun[t]);
      for (int t = 0; t < 2; ++t) {
        Sparse &row = cone_rows_[i][t];
        row.size = 0;
        double mix[2];
        for (int b = 0; b < 2; ++b)
          mix[b] = (t == b ? impulse_[i][0] : 0.0) + (speed_[i] > 0.0 ? impulse_[i][1 + t] * slip_[i][b] / speed_[i] : 0.0);
        for (int a = 0; a < 3; ++a) row.put(vertex_tangent(i) + a, mix[0] * spun[0][a] + mix[1] * spun[1][a]);
        for (int b = 0; b < 2; ++b)
          for (int a = 0; a < 3; ++a) row.put(tangent(b) + a, mix[b] * travel[a]);
      }
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

  // Leaves L^-1 J_l^T J_theta in free_rows_, L the Cholesky factor of J_l^T J_l + eps I; returns the number of rows.
  int eliminate() {
    const int count = project();
    add_shared_gram(count);
    factor(count);
    return count;
  }

  // J_l^T J_theta in free_rows_, A J_l in moved_, and in gram_ the blocks of J_l^T J_l + eps I that a contact has alone;
  // returns the number of free directions.
  int project() {
    int count = 0;
    for (int i = 0; i < contacts_; ++i) {
      double basis[3][3];
      const int free = free_directions(i, basis);
      const int first = count;
      for (int k = 0; k < free; ++k, ++count) {
        for (int a = 0; a < 6; ++a) {
          moved_[count][a] = 0.0;
          for (int c = 0; c < 3; ++c) moved_[count][a] += motion_[i][c][a] * basis[k][c];
        }
        cross_row(i, basis[k], moved_[count], &free_rows_[count * stride_]);
      }
      for (int k = 0; k < free; ++k) {
        for (int other = 0; other <= first + k; ++other) gram_[first + k][other] = 0.0;
        double curved[3];
        const double *d = block_[i], *x = basis[k];
        curved[0] = d[0] * x[0] + d[1] * x[1] + d[2] * x[2];
        curved[1] = d[1] * x[0] + d[3] * x[1] + d[4] * x[2];
        curved[2] = d[2] * x[0] + d[4] * x[1] + d[5] * x[2];
        for (int other = 0; other <= k; ++other)
          for (int c = 0; c < 3; ++c) gram_[first + k][first + other] += curved[c] * basis[other][c];
        gram_[first + k][first + k] += model_.regularization;
      }
    }
    return count;
  }

  // Adds to J_l^T J_l what contacts have in common: the residual of the velocity, and the active slacks.
  void add_shared_gram(int count) {
    for (int a = 0; a < count; ++a)
      for (int b = 0; b <= a; ++b)
        for (int k = 0; k < 6; ++k) gram_[a][b] += model_.match_weight * moved_[a][k] * moved_[b][k];
    for (int s = 0; s < active_; ++s) {
      double reach[3 * kMaxContacts];
      for (int a = 0; a < count; ++a) {
        reach[a] = 0.0;
        for (int k = 0; k < 6; ++k) reach[a] += slack_row_[active_index_[s]][k] * moved_[a][k];
      }
      for (int a = 0; a < count; ++a)
        for (int b = 0; b <= a; ++b) gram_[a][b] += model_.slack_weight * reach[a] * reach[b];
    }
  }

  // Factors gram_ = L L^T in place, and multiplies free_rows_ by L^-1.
  void factor(int count) {
    WeightedRow earlier[3 * kMaxContacts];
    for (int a = 0; a < count; ++a) {
      double *row = &free_rows_[a * stride_];
      for (int b = 0; b < a; ++b) {
        double value = gram_[a][b];
        for (int k = 0; k < b; ++k) value -= gram_[a][k] * gram_[b][k];
        gram_[a][b] = value / gram_[b][b];
        earlier[b] = {&free_rows_[b * stride_], -gram_[a][b]};
      }
      add_rows(earlier, a, row, stride_);
      double pivot = gram_[a][a];
      for (int k = 0; k < a; ++k) pivot -= gram_[a][k] * gram_[a][k];
      const double least = model_.regularization * 1e-3;
      gram_[a][a] = std::sqrt(pivot > least ? pivot : least);
      for (int q = 0; q < stride_; ++q) row[q] /= gram_[a][a];
    }
  }

  // One row of J_l^T J_theta: the free direction `along` of contact i.
  void cross_row(int i, const double *along, const double *moved, double *row) const {
    std::fill(row, row + stride_, 0.0);
    WeightedRow added[6];
    for (int k = 0; k < 6; ++k) added[k] = {&pulled_[k * stride_], moved[k]};
    add_rows(added, 6, row, stride_);
    const double closing = gap_next_[i] * (model_.normal_weight * impulse_[i][0] * along[0] +
                                           model_.tangent_weight * (impulse_[i][1] * along[1] + impulse_[i][2] * along[2]));
    scatter(gap_rows_[i], closing, row);
    for (int t = 0; t < 2; ++t)
      scatter(cone_rows_[i][t], model_.cone_weight * (slip_[i][t] * along[0] + speed_[i] * along[1 + t]), row);
  }

  static void scatter(const Sparse &from, double weight, double *row) {
    for (int k = 0; k < from.size; ++k) row[from.column[k]] += weight * from.value[k];
  }

  void add_contact(int i, double weight, double *fisher, int stride) const {
    const double *l = impulse_[i];
    const double closing = model_.normal_weight * l[0] * l[0] + model_.tangent_weight * (l[1] * l[1] + l[2] * l[2]);
    add_sparse(gap_rows_[i], weight * closing, fisher, stride);
    for (int t = 0; t < 2; ++t) add_sparse(cone_rows_[i][t], weight * model_.cone_weight, fisher, stride);
  }

  static void add_sparse(const Sparse &row, double weight, double *fisher, int stride) {
    for (int a = 0; a < row.size; ++a)
      for (int b = 0; b <= a; ++b) fisher[row.column[a] * stride + row.column[b]] += weight * row.value[a] * row.value[b];
  }

 public:
  // fisher += weight * row row^T, row after row; lower triangle in whole vectors (entries right of the diagonal are scratch).
  static void add_outers(const std::vector<WeightedRow> &rows, double *fisher, int stride) {
    WeightedRow used[6 + 4 * kMaxContacts];
    for (int a = 0; a < stride; ++a) {
      int count = 0;
      for (const WeightedRow &each : rows) {
        const double scaled = each.weight * each.row[a];
        if (scaled != 0.0) used[count++] = {each.row, scaled};
      }
      add_rows(used, count, fisher + static_cast<long>(a) * stride, a + 1);
    }
  }

  int stride() const { return stride_; }

 private:
  const BouncingModel &model_;
  int contacts_, parameters_, stride_, active_ = 0;
  double dt_, rotation_[3][3], rotation_next_[3][3], position_[3], position_next_[3];
  double normal_body_[3], normal_body_next_[3], tangents_body_[2][3], velocity_next_[6], moving_[6], free_[6];
  double gap_[kMaxContacts], gap_next_[kMaxContacts], depth_[kMaxContacts], slack_[kMaxContacts], speed_[kMaxContacts],
      slip_[kMaxContacts][2];
  double impulse_[kMaxContacts][3], gradient_[kMaxContacts][3], motion_[kMaxContacts][3][6];
  double slack_row_[kMaxContacts][6], block_[kMaxContacts][6];
  double moved_[3 * kMaxContacts][6], gram_[3 * kMaxContacts][3 * kMaxContacts];
  int active_index_[kMaxContacts];
  Sparse gap_rows_[kMaxContacts], cone_rows_[kMaxContacts][2];
  std::vector<double> velocity_rows_, pulled_, slack_rows_, free_rows_;
  std::vector<WeightedRow> weighted_;
};

}  // namespace contact_curation
