// Training of a model with networks one transition a step, as ContactNets trains: contacts, their loss and its slopes, back
// through the networks, AdamW, next row. The models are those of contact/deep_model.py, deepvertex_model.py and
// end_to_end_model.py.
#include <memory>

#include "interface.hpp"
#include "moved_vertices.hpp"
#include "stream_pass.hpp"

namespace contact_curation {

namespace {

// vec(R hat e_c), row by row: how the rotation turns about the body's axis c.
void turn_about(const double (*rotation)[3], int axis, double *out) {
  const int next = (axis + 1) % 3, after = (axis + 2) % 3;
  for (int row = 0; row < 3; ++row) {
    out[3 * row + axis] = 0.0;
    out[3 * row + next] = rotation[row][after];
    out[3 * row + after] = -rotation[row][next];
  }
}

// Of one model: `find` says whether there are loss and finite slopes, `descend` takes the step.
struct DeepSteps {
  MovedVertices vertices;
  ContactSlopes found;
  StreamPass normal, tangent;
  VertexSlopes by_vertices;

  bool find(const PolytopeModel &model, const Evaluation &rows, const Descent &job, const Frame &at) {
    forward(job, at);
    ContactNumbers contacts;
    vertices.find(model, at, model.vertices_normal, model.vertices_normal, model.vertices_tangent, contacts);
    for (int i = 0; i < model.contacts; ++i) {
      contacts.gap[i] += job.share * normal.outputs[i][0];
      contacts.gap_next[i] += job.share * normal.outputs[i][1];
      for (int a = 0; a < 6; ++a) {
        contacts.jacobian[i][0][a] += job.share * normal.outputs[i][2 + a];
        for (int t = 0; t < 2; ++t) contacts.jacobian[i][1 + t][a] += job.share * tangent.outputs[2 * i + t][1 + a];
      }
    }
    if (!found.find(model, rows, at, contacts)) return false;
    ContactNumbers &by = found.slopes;
    Lane bends[kMaxContacts] = {}, sideways[2 * kMaxContacts] = {};
    for (int i = 0; i < model.contacts; ++i) {
      add_scale_slopes(contacts.jacobian[i][0], contacts.jacobian[i][1], 6, job.regularizer, by.jacobian[i][0],
                       by.jacobian[i][1]);
      bends[i][0] = job.share * by.gap[i], bends[i][1] = job.share * by.gap_next[i];
      for (int a = 0; a < 6; ++a) {
        bends[i][2 + a] = job.share * by.jacobian[i][0][a];
        for (int t = 0; t < 2; ++t) sideways[2 * i + t][1 + a] = job.share * by.jacobian[i][1 + t][a];
      }
    }
    vertices.reverse(model, at, by, by_vertices);
    by_vertices.join(model.contacts);
    const bool finite = by_vertices.finite(model.contacts);
    return finite && normal.reverse(job.networks[0], bends) && tangent.reverse(job.networks[1], sideways);
  }

  void descend(const PolytopeModel &model, const Descent &job, const AdamW &polytope, const AdamW &network) {
    const double *slopes[kPieces] = {by_vertices.here[0], by_vertices.normal, by_vertices.rubbing[0], by_vertices.tangents[0]};
    const int sizes[kPieces] = {3 * model.contacts, 3, 3 * model.contacts, 6};
    for (int piece = 0; piece < kPieces; ++piece) {
      const Moments &theta = job.theta[piece];
      polytope.step(theta.theta, theta.first, theta.second, slopes[piece], sizes[piece]);
    }
    normal.descend(job.networks[0], network);
    tangent.descend(job.networks[1], network);
  }

  double loss() const { return found.loss; }

 private:
  // Both poses and the six twists of the first through the network of the gaps; the first and its twists through the other.
  void forward(const Descent &job, const Frame &at) {
    Lane inputs[12] = {}, first[12] = {};
    for (int a = 0; a < 3; ++a) {
      inputs[a][0] = at.position[a], inputs[a][1] = at.position_next[a], inputs[a][2 + a] = 1.0;
      for (int b = 0; b < 3; ++b)
        inputs[3 + 3 * a + b][0] = at.rotation[a][b], inputs[3 + 3 * a + b][1] = at.rotation_next[a][b];
    }
    for (int axis = 0; axis < 3; ++axis) {
      double turned[9];
      turn_about(at.rotation, axis, turned);
      for (int k = 0; k < 9; ++k) inputs[3 + k][5 + axis] = turned[k];
    }
    for (int k = 0; k < 12; ++k)
      for (int lane = 0; lane < 7; ++lane) first[k][lane] = inputs[k][lane ? lane + 1 : 0];
    normal.forward(job.networks[0], inputs, 2, 8);
    tangent.forward(job.networks[1], first, 1, 7);
  }
};

struct DeepvertexSteps {
  MovedVertices vertices;
  ContactSlopes found;
  StreamPass shifts;

  bool find(const PolytopeModel &model, const Evaluation &rows, const Descent &job, const Frame &at) {
    Lane inputs[9] = {};
    double turned[9];
    for (int k = 0; k < 9; ++k) {
      inputs[k][0] = (at.rotation[k / 3][k % 3] - job.mean[k]) * job.scale[k];
      inputs[k][1] = (at.rotation_next[k / 3][k % 3] - job.mean[k]) * job.scale[k];
    }
    for (int axis = 0; axis < 3; ++axis) {
      turn_about(at.rotation, axis, turned);
      for (int k = 0; k < 9; ++k) inputs[k][2 + axis] = turned[k] * job.scale[k];
    }
    shifts.forward(job.networks[0], inputs, 2, 5);
    double here[kMaxContacts][3], there[kMaxContacts][3];
    for (int k = 0; k < 3 * model.contacts; ++k) {
      here[k / 3][k % 3] = model.vertices_normal[k] + job.share * shifts.outputs[k][0];
      there[k / 3][k % 3] = model.vertices_normal[k] + job.share * shifts.outputs[k][1];
    }
    ContactNumbers contacts;
    vertices.find(model, at, here[0], there[0], here[0], contacts);
    for (int i = 0; i < model.contacts; ++i)
      for (int c = 0; c < 3; ++c)
        for (int axis = 0; axis < 3; ++axis)
          for (int a = 0; a < 3; ++a)
            contacts.jacobian[i][c][3 + axis] += vertices.in_body[c][a] * job.share * shifts.outputs[3 * i + a][2 + axis];
    if (!found.find(model, rows, at, contacts)) return false;
    VertexSlopes by;
    vertices.reverse(model, at, found.slopes, by);
    Lane slopes[3 * kMaxContacts] = {};
    for (int i = 0; i < model.contacts; ++i)
      for (int a = 0; a < 3; ++a) {
        Lane &slope = slopes[3 * i + a];
        slope[0] = job.share * (by.here[i][a] + by.rubbing[i][a]);
        slope[1] = job.share * by.there[i][a];
        for (int axis = 0; axis < 3; ++axis)
          for (int c = 0; c < 3; ++c)
            slope[2 + axis] += job.share * found.slopes.jacobian[i][c][3 + axis] * vertices.in_body[c][a];
      }
    return shifts.reverse(job.networks[0], slopes);
  }

  void descend(const PolytopeModel &, const Descent &job, const AdamW &, const AdamW &network) {
    shifts.descend(job.networks[0], network);
  }

  double loss() const { return found.loss; }
};

struct EndToEndSteps {
  StreamPass impulse;
  double value = 0.0;

  bool find(const PolytopeModel &model, const Evaluation &, const Descent &job, const Frame &at) {
    constexpr int kInputs = 24;
    double seen[kInputs] = {};
    for (int a = 0; a < 3; ++a) seen[a] = at.position[a];
    for (int k = 0; k < 9; ++k) seen[3 + k] = at.rotation[k / 3][k % 3];
    for (int a = 0; a < 6; ++a) seen[12 + a] = at.velocity[a];
    Lane inputs[kInputs] = {}, slopes[6] = {};
    for (int k = 0; k < kInputs; ++k) inputs[k][0] = (seen[k] - job.mean[k]) * job.scale[k];
    impulse.forward(job.networks[0], inputs, 1, 1);
    double missed[6], square = 0.0;
    for (int a = 0; a < 3; ++a) {
      missed[a] = impulse.outputs[a][0] / model.mass;
      missed[3 + a] = 0.0;
      for (int b = 0; b < 3; ++b) missed[3 + a] += model.inverse_inertia[3 * a + b] * impulse.outputs[3 + b][0];
    }
    for (int a = 0; a < 6; ++a) {
      missed[a] = at.free_velocity[a] + missed[a] - at.velocity_next[a];
      square += missed[a] * missed[a];
    }
    value = job.squared ? square : std::sqrt(square);
    if (!std::isfinite(value)) return false;
    const double weight = job.squared ? 2.0 : value > 0.0 ? 1.0 / value : 0.0;
    for (int a = 0; a < 3; ++a) {
      slopes[a][0] = weight * missed[a] / model.mass;
      for (int b = 0; b < 3; ++b) slopes[3 + a][0] += weight * model.inverse_inertia[3 * b + a] * missed[3 + b];
    }
    return impulse.reverse(job.networks[0], slopes);
  }

  void descend(const PolytopeModel &, const Descent &job, const AdamW &, const AdamW &network) {
    impulse.descend(job.networks[0], network);
  }

  double loss() const { return value; }
};

template <class Steps>
int64_t descend(const PolytopeModel &model, const Evaluation &rows, Descent &job) {
  if (model.contacts < 1 || model.contacts > kMaxContacts) return 0;
  const auto steps = std::make_unique<Steps>();
  Frame at;
  for (int64_t step = 0; step < job.steps; ++step) {
    at.load(model, rows, job.rows[step]);
    if (!steps->find(model, rows, job, at)) return step;
    job.seen += 1.0;
    const Corrections corrections = job.corrections();
    steps->descend(model, job, job.adamw(step, job.polytope, corrections), job.adamw(step, job.network, corrections));
    job.loss_sum += steps->loss();
  }
  return job.steps;
}

}  // namespace
}  // namespace contact_curation

extern "C" {
using namespace contact_curation;

int64_t contact_curation_descend_deep(const PolytopeModel *model, const Evaluation *rows, Descent *job) {
  return descend<DeepSteps>(*model, *rows, *job);
}

int64_t contact_curation_descend_deepvertex(const PolytopeModel *model, const Evaluation *rows, Descent *job) {
  return descend<DeepvertexSteps>(*model, *rows, *job);
}

int64_t contact_curation_descend_end_to_end(const PolytopeModel *model, const Evaluation *rows, Descent *job) {
  return descend<EndToEndSteps>(*model, *rows, *job);
}
}
