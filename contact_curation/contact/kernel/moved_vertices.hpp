// Gaps and Jacobians of vertices over a plane at one transition, and back from slopes by them (method.md 1.1).
//
//   phi_i = n . (R p_i + x - pivot) - height      J_n,i = [n, p_i x R^T n]      J_t,i,a = [T_a, p^t_i x R^T T_a]
//
// The vertices may be elsewhere one frame later.
#pragma once

#include "contact_slopes.hpp"
#include "scale_slopes.hpp"

namespace contact_curation {

inline void cross3(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

// Slopes by everything that the contacts depend on.
struct VertexSlopes {
  double here[kMaxContacts][3], there[kMaxContacts][3], rubbing[kMaxContacts][3], normal[3], tangents[2][3];

  // Of vertices that stay where they are in the body.
  void join(int contacts) {
    for (int i = 0; i < contacts; ++i)
      for (int a = 0; a < 3; ++a) here[i][a] += there[i][a];
  }

  bool finite(int contacts) const {
    double sum = 0.0;
    for (int a = 0; a < 3; ++a) {
      sum += std::abs(normal[a]) + std::abs(tangents[0][a]) + std::abs(tangents[1][a]);
      for (int i = 0; i < contacts; ++i) sum += std::abs(here[i][a]) + std::abs(there[i][a]) + std::abs(rubbing[i][a]);
    }
    return std::isfinite(sum);
  }
};

class MovedVertices {
 public:
  // Normal, tangents, pivot and height are the model's; vertices (K, 3): those of the gaps at both poses, those of friction.
  void find(const PolytopeModel &model, const Frame &at, const double *here, const double *there, const double *rubbing,
            ContactNumbers &contacts) {
    here_ = here, there_ = there, rubbing_ = rubbing;
    const double *directions[3] = {model.normal, model.tangents, model.tangents + 3};
    for (int c = 0; c < 3; ++c) turn_back(at.rotation, directions[c], in_body[c]);
    turn_back(at.rotation_next, model.normal, normal_next_);
    double offset = -model.height, offset_next = -model.height;
    for (int a = 0; a < 3; ++a) {
      offset += model.normal[a] * (at.position[a] - model.pivot[a]);
      offset_next += model.normal[a] * (at.position_next[a] - model.pivot[a]);
    }
    for (int i = 0; i < model.contacts; ++i) {
      contacts.gap[i] = dot3(here + 3 * i, in_body[0]) + offset;
      contacts.gap_next[i] = dot3(there + 3 * i, normal_next_) + offset_next;
      for (int c = 0; c < 3; ++c) {
        std::copy(directions[c], directions[c] + 3, contacts.jacobian[i][c]);
        cross3((c ? rubbing : here) + 3 * i, in_body[c], contacts.jacobian[i][c] + 3);
      }
    }
  }

  void reverse(const PolytopeModel &model, const Frame &at, const ContactNumbers &by, VertexSlopes &out) const {
    out = VertexSlopes{};
    double levers[3][3] = {};  // by the directions as the body sees them
    double lever_next[3] = {};
    for (int i = 0; i < model.contacts; ++i) {
      const double *p = here_ + 3 * i, *next = there_ + 3 * i, *side = rubbing_ + 3 * i;
      for (int a = 0; a < 3; ++a) {
        out.here[i][a] = by.gap[i] * in_body[0][a];
        out.there[i][a] = by.gap_next[i] * normal_next_[a];
        levers[0][a] += by.gap[i] * p[a];
        lever_next[a] += by.gap_next[i] * next[a];
        out.normal[a] +=
            by.gap[i] * (at.position[a] - model.pivot[a]) + by.gap_next[i] * (at.position_next[a] - model.pivot[a]);
        out.normal[a] += by.jacobian[i][0][a];
        for (int t = 0; t < 2; ++t) out.tangents[t][a] += by.jacobian[i][1 + t][a];
      }
      for (int c = 0; c < 3; ++c) {
        const double *turning = by.jacobian[i][c] + 3;
        double by_point[3], by_direction[3];
        cross3(in_body[c], turning, by_point);
        cross3(turning, c ? side : p, by_direction);
        for (int a = 0; a < 3; ++a) {
          (c ? out.rubbing : out.here)[i][a] += by_point[a];
          levers[c][a] += by_direction[a];
        }
      }
    }
    add_turned(at.rotation, levers[0], out.normal);
    add_turned(at.rotation_next, lever_next, out.normal);
    for (int t = 0; t < 2; ++t) add_turned(at.rotation, levers[1 + t], out.tangents[t]);
  }

  double in_body[3][3];  // R^T of normal and tangents

 private:
  static void turn_back(const double (*rotation)[3], const double *direction, double *out) {
    for (int a = 0; a < 3; ++a)
      out[a] = rotation[0][a] * direction[0] + rotation[1][a] * direction[1] + rotation[2][a] * direction[2];
  }
  static void add_turned(const double (*rotation)[3], const double *direction, double *out) {
    for (int a = 0; a < 3; ++a) out[a] += dot3(rotation[a], direction);
  }

  const double *here_ = nullptr, *there_ = nullptr, *rubbing_ = nullptr;
  double normal_next_[3];
};

}  // namespace contact_curation
