// Eight transitions of a polytope against the plane: the inner problem they pose (method.md 1.1, 1.2), the loss terms and the
// envelope score (method.md 1.4) once it is solved.
//
//   phi_i = n . (R p_i + x - pivot) - height      J_n,i = [n, p_i x R^T n]      J_t,i,a = [T_a, p^t_i x R^T T_a]
//
// A body that bounces is where a mirror in the ground shows it: the depth d_i = min(0, c_i - min(0, phi_i)) that a contact
// would gain without any impulse, c_i = phi_i + dt J_n,i v_f, is given back e times, so that e d_i is added to phi'_i and c_i
// (method.md 1.2).
#pragma once

#include "cone_problem.hpp"

namespace contact_curation {

// Plain data, mirrored by ctypes in contact/compiled_evaluation.py.
struct PolytopeModel {
  int contacts;
  const double *vertices_normal;   // (K, 3)
  const double *normal;            // (3,)
  const double *vertices_tangent;  // (K, 3)
  const double *tangents;          // (2, 3), friction absorbed
  double pivot[3];
  double height;
  double mass;
  double inverse_inertia[9];
  double inertia[9];  // zeros without the gyroscopic term
  double gravity;
  double match_weight, normal_weight, tangent_weight, cone_weight, slack_weight, regularization;
  int circular;
};

// A polytope whose impacts bounce if there is a restitution e, which then is a parameter, too, the last one.
struct BouncingModel : PolytopeModel {
  BouncingModel(const PolytopeModel &model, const double *e = nullptr)
      : PolytopeModel(model), restitution(e ? *e : 0.0), bounces(e != nullptr) {}
  double restitution;
  bool bounces;
};

constexpr int kMaxParameters = 6 * kMaxContacts + 11;
constexpr int kTerms = 5;  // match, complementarity normal, complementarity tangent, cone, penetration

inline int parameter_count(const BouncingModel &model) { return 6 * model.contacts + 10 + (model.bounces ? 1 : 0); }

inline void cross(const Lane *a, const Lane *b, Lane *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}
inline void rotate(const Lane (*r)[3], const Lane *v, Lane *out) {
  for (int a = 0; a < 3; ++a) out[a] = r[a][0] * v[0] + r[a][1] * v[1] + r[a][2] * v[2];
}
inline void rotate_back(const Lane (*r)[3], const Lane *v, Lane *out) {
  for (int a = 0; a < 3; ++a) out[a] = r[0][a] * v[0] + r[1][a] * v[1] + r[2][a] * v[2];
}
inline void rotation_matrix(const Lane *q, Lane (*r)[3]) {
  const Lane w = q[0], x = q[1], y = q[2], z = q[3];
  r[0][0] = 1.0 - 2.0 * (y * y + z * z), r[0][1] = 2.0 * (x * y - w * z), r[0][2] = 2.0 * (x * z + w * y);
  r[1][0] = 2.0 * (x * y + w * z), r[1][1] = 1.0 - 2.0 * (x * x + z * z), r[1][2] = 2.0 * (y * z - w * x);
  r[2][0] = 2.0 * (x * z - w * y), r[2][1] = 2.0 * (y * z + w * x), r[2][2] = 1.0 - 2.0 * (x * x + y * y);
}

struct Transition {
  Lane dt;
  Lane rotation[3][3], rotation_next[3][3];
  Lane position[3], position_next[3];  // relative to the pivot
  Lane free_velocity[6], velocity_next[6];
  Lane normal_body[3], tangents_body[2][3], normal_body_next[3];
  Lane gap[kMaxContacts], gap_next[kMaxContacts];  // the latter less what is given back of a depth
  Lane depth[kMaxContacts];                        // d_i, of bodies that bounce
  Lane slip[kMaxContacts][2], slip_speed[kMaxContacts];

  // Reads rows first .. first + 7, the last one repeated past `end`.
  void load(const BouncingModel &model, const double *before, const double *after, const double *period, long first, long end) {
    Lane state[13], next[13];
    for (int lane = 0; lane < kLanes; ++lane) {
      const long row = first + lane < end ? first + lane : end - 1;
      for (int k = 0; k < 13; ++k) state[k][lane] = before[13 * row + k], next[k][lane] = after[13 * row + k];
      dt[lane] = period[row];
    }
    rotation_matrix(state + 3, rotation);
    rotation_matrix(next + 3, rotation_next);
    for (int a = 0; a < 3; ++a) {
      position[a] = state[a] - model.pivot[a];
      position_next[a] = next[a] - model.pivot[a];
    }
    for (int a = 0; a < 6; ++a) free_velocity[a] = state[7 + a], velocity_next[a] = next[7 + a];
    free_velocity[2] -= model.gravity * dt;
    if (model.inertia[0] > 0.0) {
      Lane turning[3];
      gyroscopic(model.inertia, model.inverse_inertia, state + 10, turning);
      for (int a = 0; a < 3; ++a) free_velocity[3 + a] -= dt * turning[a];
    }
    Lane row[3];
    for (int a = 0; a < 3; ++a) row[a] = broadcast(model.normal[a]);
    rotate_back(rotation, row, normal_body);
    rotate_back(rotation_next, row, normal_body_next);
    for (int t = 0; t < 2; ++t) {
      for (int a = 0; a < 3; ++a) row[a] = broadcast(model.tangents[3 * t + a]);
      rotate_back(rotation, row, tangents_body[t]);
    }
  }

  void pose(const BouncingModel &model, ConeProblem &problem) {
    problem.contacts = model.contacts;
    problem.circular = model.circular != 0;
    problem.match_weight = model.match_weight;
    problem.slack_weight = model.slack_weight;
    problem.regularization = model.regularization;
    for (int a = 0; a < 6; ++a) problem.target[a] = velocity_next[a] - free_velocity[a];
    for (int i = 0; i < model.contacts; ++i) {
      Lane p[3], pt[3], row[6];
      for (int a = 0; a < 3; ++a) {
        p[a] = broadcast(model.vertices_normal[3 * i + a]);
        pt[a] = broadcast(model.vertices_tangent[3 * i + a]);
      }
      gap[i] = gap_next[i] = broadcast(-model.height);
      for (int a = 0; a < 3; ++a) {
        gap[i] += normal_body[a] * p[a] + model.normal[a] * position[a];
        gap_next[i] += normal_body_next[a] * p[a] + model.normal[a] * position_next[a];
        row[a] = broadcast(model.normal[a]);
      }
      cross(p, normal_body, row + 3);
      to_motion(model, row, problem.motion[i][0]);
      for (int a = 0; a < 6; ++a) problem.slack_row[i][a] = dt * row[a];
      problem.slack_offset[i] = gap[i] + dot<6>(problem.slack_row[i], free_velocity);
      if (model.bounces) {
        depth[i] = negative_part(problem.slack_offset[i] - negative_part(gap[i]));
        gap_next[i] += model.restitution * depth[i];
        problem.slack_offset[i] += model.restitution * depth[i];
      }
      for (int t = 0; t < 2; ++t) {
        for (int a = 0; a < 3; ++a) row[a] = broadcast(model.tangents[3 * t + a]);
        cross(pt, tangents_body[t], row + 3);
        to_motion(model, row, problem.motion[i][1 + t]);
        slip[i][t] = dot<6>(row, velocity_next);
      }
      slip_speed[i] =
          set_block(model.normal_weight, model.tangent_weight, model.cone_weight, gap_next[i], slip[i], problem.block[i]);
    }
  }

  static void to_motion(const PolytopeModel &model, const Lane *row, Lane *motion) {
    for (int a = 0; a < 3; ++a) {
      motion[a] = row[a] / model.mass;
      motion[3 + a] = model.inverse_inertia[3 * a] * row[3] + model.inverse_inertia[3 * a + 1] * row[4] +
                      model.inverse_inertia[3 * a + 2] * row[5];
    }
  }
};

// What follows from the impulses: loss terms, and what the score needs of them.
struct Outcome {
  Lane terms[kTerms];
  Lane loss;
  Lane change[6];              // A l
  Lane slack[kMaxContacts];    // min(0, predicted gap)
  Lane cone[kMaxContacts][2];  // e_i

  void judge(const BouncingModel &model, const Transition &at, const ConeProblem &problem, const ConeSolution &solution) {
    velocity_change(problem, solution.impulse, change);
    for (Lane &term : terms) term = broadcast(0.0);
    for (int a = 0; a < 6; ++a) {
      const Lane off = change[a] - problem.target[a];
      terms[0] += model.match_weight * off * off;
    }
    for (int i = 0; i < problem.contacts; ++i) {
      const Lane *l = solution.impulse[i];
      const Lane closed = at.gap_next[i] * at.gap_next[i];
      terms[1] += model.normal_weight * closed * l[0] * l[0];
      terms[2] += model.tangent_weight * closed * (l[1] * l[1] + l[2] * l[2]);
      for (int t = 0; t < 2; ++t) {
        cone[i][t] = l[0] * at.slip[i][t] + at.slip_speed[i] * l[1 + t];
        terms[3] += model.cone_weight * cone[i][t] * cone[i][t];
      }
      slack[i] = negative_part(problem.slack_offset[i] + dot<6>(problem.slack_row[i], change));
      terms[4] += model.slack_weight * slack[i] * slack[i];
    }
    loss = terms[0] + terms[1] + terms[2] + terms[3] + terms[4];
  }

  // dL/dtheta at fixed impulses, in the order vertices_normal, normal, vertices_tangent, tangents, height, restitution.
  void gradient(const BouncingModel &model, const Transition &at, const ConeProblem &problem, const ConeSolution &solution,
                Lane *out) const {
    const int contacts = model.contacts;
    Lane *d_vertices = out, *d_normal = out + 3 * contacts, *d_vertices_t = d_normal + 3,
         *d_tangents = d_vertices_t + 3 * contacts;
    Lane &d_height = d_tangents[6];
    for (int k = 0; k < parameter_count(model); ++k) out[k] = broadcast(0.0);
    Lane pull[6], force[6], moving[6];
    for (int a = 0; a < 6; ++a) {
      pull[a] = 2.0 * model.match_weight * (change[a] - problem.target[a]);
      moving[a] = at.free_velocity[a] + change[a];
    }
    for (int i = 0; i < contacts; ++i)
      for (int a = 0; a < 6; ++a) pull[a] += 2.0 * model.slack_weight * slack[i] * problem.slack_row[i][a];
    Transition::to_motion(model, pull, force);
    const Lane *turn = moving + 3, *spin = at.velocity_next + 3;
    Lane twisted[3], turned[3], spun[2][3];
    cross(at.normal_body, force + 3, twisted);
    cross(at.normal_body, turn, turned);
    for (int t = 0; t < 2; ++t) cross(at.tangents_body[t], spin, spun[t]);
    for (int i = 0; i < contacts; ++i) {
      const Lane *l = solution.impulse[i];
      Lane p[3], pt[3], arm[3], arm_next[3], lever[3], world[3];
      for (int a = 0; a < 3; ++a) {
        p[a] = broadcast(model.vertices_normal[3 * i + a]);
        pt[a] = broadcast(model.vertices_tangent[3 * i + a]);
      }
      rotate(at.rotation, p, arm);
      rotate(at.rotation_next, p, arm_next);
      const Lane closing =
          2.0 * (model.normal_weight * l[0] * l[0] + model.tangent_weight * (l[1] * l[1] + l[2] * l[2])) * at.gap_next[i];
      const Lane sinking = 2.0 * model.slack_weight * slack[i];
      // Of the normal: the lever arms of force and of the predicted motion, carried to the world's frame together.
      Lane leverage[3];
      cross(force + 3, p, lever);
      cross(turn, p, leverage);
      for (int a = 0; a < 3; ++a) lever[a] = l[0] * lever[a] + sinking * at.dt * leverage[a];
      rotate(at.rotation, lever, world);
      for (int a = 0; a < 3; ++a) {
        d_vertices[3 * i + a] =
            l[0] * twisted[a] + closing * at.normal_body_next[a] + sinking * (at.normal_body[a] + at.dt * turned[a]);
        d_normal[a] += l[0] * force[a] + closing * (arm_next[a] + at.position_next[a]) +
                       sinking * (arm[a] + at.position[a] + at.dt * moving[a]) + world[a];
      }
      d_height -= closing + sinking;
      if (model.bounces) {
        const Lane given_back = select(at.depth[i] < 0.0, model.restitution * (closing + sinking), broadcast(0.0));
        const Lane from_above = select(at.gap[i] < 0.0, broadcast(0.0), given_back);
        Lane falling[3];
        cross(at.normal_body, at.free_velocity + 3, falling);
        cross(at.free_velocity + 3, p, lever);
        rotate(at.rotation, lever, world);
        for (int a = 0; a < 3; ++a) {
          d_vertices[3 * i + a] += from_above * at.normal_body[a] + given_back * at.dt * falling[a];
          d_normal[a] += from_above * (arm[a] + at.position[a]) + given_back * at.dt * (at.free_velocity[a] + world[a]);
        }
        d_height -= from_above;
        d_tangents[7] += (closing + sinking) * at.depth[i];
      }
      const LaneMask sliding = at.slip_speed[i] > 0.0;
      const Lane along =
          select(sliding, dot<2>(cone[i], l + 1) / select(sliding, at.slip_speed[i], broadcast(1.0)), broadcast(0.0));
      for (int t = 0; t < 2; ++t) {
        const Lane push = l[1 + t];
        const Lane drag = 2.0 * model.cone_weight * (l[0] * cone[i][t] + along * at.slip[i][t]);
        Lane pressed[3], swept[3];
        cross(at.tangents_body[t], force + 3, pressed);
        cross(force + 3, pt, lever);
        cross(spin, pt, swept);
        for (int a = 0; a < 3; ++a) lever[a] = push * lever[a] + drag * swept[a];
        rotate(at.rotation, lever, world);
        for (int a = 0; a < 3; ++a) {
          d_vertices_t[3 * i + a] += push * pressed[a] + drag * spun[t][a];
          d_tangents[3 * t + a] += push * force[a] + drag * at.velocity_next[a] + world[a];
        }
      }
    }
  }
};

}  // namespace contact_curation
