// The arguments of gradient steps, one transition a step, for all models.
#pragma once

#include <cstdint>

#include "adamw.hpp"

namespace contact_curation {

constexpr int kPieces = 4;  // vertices_normal, normal, vertices_tangent, tangents: the order of theta and of its slopes
constexpr int kMaxLayers = 8;
constexpr int kMaxWidth = 256;

// Mirrored by ctypes. An array of parameters with AdamW's moments, all in one shape.
struct Moments {
  double *theta, *first, *second;
};

// Mirrored by ctypes.
struct Layer {
  int64_t inputs, outputs;
  Moments weight;  // (outputs, inputs)
  Moments bias;    // (outputs,)
};

// Mirrored by ctypes.
struct Network {
  int64_t layers;
  int64_t rectified;  // max(0, z) between the layers, else tanh
  Layer layer[kMaxLayers];
};

// Mirrored by ctypes. AdamW's learning rate and weight decay for some of the parameters.
struct AdamWConfig {
  double rate, decay;
};

// Mirrored by ctypes. S steps; of what a model does not have, nothing is read.
struct Descent {
  const int64_t *rows;   // (S,)
  const double *shares;  // (S,) of the rates
  int64_t steps;
  double regularizer;  // weight of each contact's
  AdamWConfig polytope, network;
  double first_beta, second_beta, epsilon;
  Moments theta[kPieces];      // a polytope's: what the model points to
  Network networks[2];         // deep's of the gaps and of the tangents; of others the first alone
  const double *mean, *scale;  // (D,) of a network's inputs
  double share;                // what a network's outputs are multiplied with
  int64_t squared;             // whether end to end's loss is a square
  double seen;                 // steps that the moments have seen; counted on
  double loss_sum;             // added to

  // Of the next step; `seen` counts it already.
  Corrections corrections() const { return Corrections(first_beta, second_beta, static_cast<int64_t>(seen)); }

  // The next step, of number `step`, for the parameters of one configuration.
  AdamW adamw(int64_t step, const AdamWConfig &config, const Corrections &corrections) const {
    return AdamW(shares[step] * config.rate, config.decay, first_beta, second_beta, epsilon, corrections);
  }
};

}  // namespace contact_curation
