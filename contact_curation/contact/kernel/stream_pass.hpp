// A multilayer perceptron at one transition: up to eight streams, primal inputs and tangents of the first, one SIMD lane each
// (contact/stream_network.py). Forward, reverse, and one step of AdamW.
//
//   z_s = W a_s + b,  a_s' = f(z_s)        z_r = W a_r,  a_r' = f'(z_0) a_r        dL/dW = sum_r (dL/dz_r) a_r^T
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "descent.hpp"
#include "elementary.hpp"
#include "lanes.hpp"

namespace contact_curation {

class StreamPass {
 public:
  // Fills `outputs`. The first `primal` of the `streams` lanes are inputs, the others tangents at the first; what is in further
  // lanes is zero and stays so.
  void forward(const Network &network, const Lane *inputs, int primal, int streams) {
    primal_ = primal, streams_ = streams;
    for (int lane = 0; lane < kLanes; ++lane) is_primal_[lane] = lane < primal ? -1 : 0;
    std::copy(inputs, inputs + network.layer[0].inputs, inputs_[0]);
    for (int64_t depth = 0; depth < network.layers; ++depth) {
      const Layer &layer = network.layer[depth];
      const bool last = depth + 1 == network.layers;
      Lane *out = last ? outputs : inputs_[depth + 1];
      for (int64_t i = 0; i < layer.outputs; ++i) out[i] = select(is_primal_, broadcast(layer.bias.theta[i]), Lane{});
      multiply(layer, inputs_[depth], out);
      if (!last) activate(network, out, curves_[depth], layer.outputs);
    }
  }

  // From slopes by `outputs` to those by every layer's z. Says whether all that follows from them is finite.
  bool reverse(const Network &network, const Lane *by_outputs) {
    const int64_t last = network.layers - 1;
    std::copy(by_outputs, by_outputs + network.layer[last].outputs, slopes_[last]);
    for (int64_t depth = last; depth > 0; --depth) {
      const Layer &layer = network.layer[depth];
      Lane *by_inputs = slopes_[depth - 1];
      std::fill(by_inputs, by_inputs + layer.inputs, Lane{});
      multiply_back(layer, slopes_[depth], by_inputs);
      deactivate(network, inputs_[depth], curves_[depth - 1], by_inputs, layer.inputs);
    }
    for (int64_t depth = 0; depth <= last; ++depth) {
      const Layer &layer = network.layer[depth];
      const double inputs = magnitude(inputs_[depth], layer.inputs);
      if (!std::isfinite(magnitude(slopes_[depth], layer.outputs) * (1.0 + inputs))) return false;
    }
    return true;
  }

  // Weights and biases go one step down these slopes.
  void descend(const Network &network, const AdamW &adamw) {
    for (int64_t depth = 0; depth < network.layers; ++depth) {
      const Layer &layer = network.layer[depth];
      for (int s = 0; s < streams_; ++s)
        for (int64_t j = 0; j < layer.inputs; ++j) by_stream_[s][j] = inputs_[depth][j][s];
      double by_bias[kMaxWidth];
      for (int64_t i = 0; i < layer.outputs; ++i) {
        const Lane slope = slopes_[depth][i];
        double by_row[kMaxWidth];
        std::fill(by_row, by_row + layer.inputs, 0.0);
        for (int s = 0; s < streams_; ++s) {
          const double share = slope[s];
          for (int64_t j = 0; j < layer.inputs; ++j) by_row[j] += share * by_stream_[s][j];
        }
        by_bias[i] = 0.0;
        for (int s = 0; s < primal_; ++s) by_bias[i] += slope[s];
        const int64_t row = i * layer.inputs;
        adamw.step(layer.weight.theta + row, layer.weight.first + row, layer.weight.second + row, by_row, layer.inputs);
      }
      adamw.step(layer.bias.theta, layer.bias.first, layer.bias.second, by_bias, layer.outputs);
    }
  }

  Lane outputs[kMaxWidth];

 private:
  // out += W in, four rows at a time: a sum of its own each, so that none waits for another.
  static void multiply(const Layer &layer, const Lane *in, Lane *out) {
    const int64_t width = layer.inputs;
    const double *row = layer.weight.theta;
    int64_t i = 0;
    for (; i + 4 <= layer.outputs; i += 4, row += 4 * width) {
      Lane a = out[i], b = out[i + 1], c = out[i + 2], d = out[i + 3];
      for (int64_t j = 0; j < width; ++j) {
        const Lane value = in[j];
        a += row[j] * value, b += row[width + j] * value, c += row[2 * width + j] * value, d += row[3 * width + j] * value;
      }
      out[i] = a, out[i + 1] = b, out[i + 2] = c, out[i + 3] = d;
    }
    for (; i < layer.outputs; ++i, row += width)
      for (int64_t j = 0; j < width; ++j) out[i] += row[j] * in[j];
  }

  // in += W^T out
  static void multiply_back(const Layer &layer, const Lane *out, Lane *in) {
    const int64_t width = layer.inputs;
    const double *row = layer.weight.theta;
    int64_t i = 0;
    for (; i + 4 <= layer.outputs; i += 4, row += 4 * width) {
      const Lane a = out[i], b = out[i + 1], c = out[i + 2], d = out[i + 3];
      for (int64_t j = 0; j < width; ++j)
        in[j] += row[j] * a + row[width + j] * b + row[2 * width + j] * c + row[3 * width + j] * d;
    }
    for (; i < layer.outputs; ++i, row += width)
      for (int64_t j = 0; j < width; ++j) in[j] += row[j] * out[i];
  }

  // z -> a' in place; `curves` takes f' at the first stream. What is not a number stays none.
  void activate(const Network &network, Lane *values, double *curves, int64_t count) const {
    if (network.rectified) {
      for (int64_t k = 0; k < count; ++k) {
        const Lane before = values[k], after = select(before <= 0.0, Lane{}, before);
        curves[k] = before[0] > 0.0 ? 1.0 : 0.0;
        values[k] = select(is_primal_, after, curves[k] * before);
      }
      return;
    }
    for (int64_t first = 0; first < count; first += kLanes)
      bend(values + first, curves + first, std::min<int64_t>(kLanes, count - first));
  }

  // The hyperbolic tangent of at most eight values: those of one stream at a time take a lane each.
  void bend(Lane *values, double *curves, int64_t count) const {
    Lane after[kLanes];
    for (int s = 0; s < primal_; ++s) {
      Lane before{};
      for (int64_t k = 0; k < count; ++k) before[k] = values[k][s];
      after[s] = hyperbolic_tangent(before);
    }
    for (int64_t k = 0; k < count; ++k) {
      curves[k] = 1.0 - after[0][k] * after[0][k];
      values[k] = select(is_primal_, values[k], curves[k] * values[k]);
      for (int s = 0; s < primal_; ++s) values[k][s] = after[s][k];
    }
  }

  // Slopes by a' -> by z, in place. tanh'' = -2 tanh tanh', and a tangent's output is tanh' z_r already: the slopes of all
  // tangents meet in the first stream.
  void deactivate(const Network &network, const Lane *values, const double *curves, Lane *slopes, int64_t count) const {
    for (int64_t k = 0; k < count; ++k) {
      const Lane after = values[k], inward = slopes[k];
      if (network.rectified) {
        slopes[k] = select(is_primal_, select(after > 0.0, inward, Lane{}), curves[k] * inward);
        continue;
      }
      const Lane met = select(is_primal_, Lane{}, inward * after);
      double bent = 0.0;
      for (int s = primal_; s < streams_; ++s) bent += met[s];
      slopes[k] = select(is_primal_, inward * (1.0 - after * after), curves[k] * inward);
      slopes[k][0] -= 2.0 * after[0] * bent;
    }
  }

  // Their sum without signs; not finite if one of them is not.
  static double magnitude(const Lane *values, int64_t count) {
    Lane sum{};
    for (int64_t k = 0; k < count; ++k) sum += absolute(values[k]);
    double total = 0.0;
    for (int lane = 0; lane < kLanes; ++lane) total += sum[lane];
    return total;
  }

  int primal_ = 1, streams_ = 1;
  LaneMask is_primal_;
  Lane inputs_[kMaxLayers][kMaxWidth];    // of each layer
  Lane slopes_[kMaxLayers][kMaxWidth];    // by each layer's z
  double curves_[kMaxLayers][kMaxWidth];  // f' at the first stream
  double by_stream_[kLanes][kMaxWidth];
};

}  // namespace contact_curation
