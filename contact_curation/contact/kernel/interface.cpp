// What the compiler made of the structures and functions that Python fills and calls, as lines of text that solver/compiled.py
// holds against its own: a library and Python of different versions end in one line of text, not in wrong numbers.
#include "interface.hpp"

#include <cstddef>
#include <initializer_list>
#include <string>
#include <type_traits>

namespace contact_curation {
namespace {

struct Field {
  const char *name;
  size_t offset, size;
};

std::string structure(const std::string &name, size_t size, std::initializer_list<Field> fields) {
  std::string text =
      "structure " + name + " of " + std::to_string(fields.size()) + " fields in " + std::to_string(size) + " bytes\n";
  for (const Field &field : fields)
    text += "field " + name + "." + field.name + " at " + std::to_string(field.offset) + " of " + std::to_string(field.size) +
            " bytes\n";
  return text;
}

template <class Value>
std::string type_name() {
  static_assert(std::is_void_v<Value> || std::is_pointer_v<Value> || std::is_integral_v<Value>);
  if constexpr (std::is_void_v<Value>)
    return " nothing";
  else if constexpr (std::is_pointer_v<Value>)
    return " address";
  else
    return " int" + std::to_string(8 * sizeof(Value));
}

template <class Result, class... Arguments>
std::string function(const std::string &name, Result (*)(Arguments...)) {
  return "function " + name + type_name<Result>() + " of" + (type_name<Arguments>() + ...) + "\n";
}

#define FIELD(name) \
  Field { #name, offsetof(Type, name), sizeof(Type::name) }

std::string solver_structures() {
  using Type = ConeBatch;
  return structure("ConeBatch", sizeof(Type), {FIELD(batch),        FIELD(contacts),        FIELD(circular),
                                               FIELD(threads),      FIELD(max_iterations),  FIELD(residual_tolerance),
                                               FIELD(match_weight), FIELD(normal_weight),   FIELD(tangent_weight),
                                               FIELD(cone_weight),  FIELD(slack_weight),    FIELD(regularization),
                                               FIELD(jacobians),    FIELD(inverse_mass),    FIELD(gaps),
                                               FIELD(gaps_next),    FIELD(free_velocities), FIELD(velocities_next),
                                               FIELD(dt),           FIELD(impulses),        FIELD(residuals),
                                               FIELD(status),       FIELD(iterations)});
}

std::string model_structure() {
  using Type = PolytopeModel;
  return structure("PolytopeModel", sizeof(Type),
                   {FIELD(contacts), FIELD(vertices_normal), FIELD(normal), FIELD(vertices_tangent), FIELD(tangents),
                    FIELD(pivot), FIELD(height), FIELD(mass), FIELD(inverse_inertia), FIELD(inertia), FIELD(gravity),
                    FIELD(match_weight), FIELD(normal_weight), FIELD(tangent_weight), FIELD(cone_weight), FIELD(slack_weight),
                    FIELD(regularization), FIELD(circular)});
}

std::string evaluation_structure() {
  using Type = Evaluation;
  return structure("Evaluation", sizeof(Type),
                   {FIELD(before), FIELD(after), FIELD(dt), FIELD(starts), FIELD(tosses), FIELD(threads), FIELD(estimator),
                    FIELD(max_iterations), FIELD(residual_tolerance), FIELD(influence_bound), FIELD(terms), FIELD(impulse),
                    FIELD(score), FIELD(residual), FIELD(status), FIELD(iterations), FIELD(fisher), FIELD(score_sum)});
}

std::string moments_structure() {
  using Type = Moments;
  return structure("Moments", sizeof(Type), {FIELD(theta), FIELD(first), FIELD(second)});
}

std::string layer_structure() {
  using Type = Layer;
  return structure("Layer", sizeof(Type), {FIELD(inputs), FIELD(outputs), FIELD(weight), FIELD(bias)});
}

std::string network_structure() {
  using Type = Network;
  return structure("Network", sizeof(Type), {FIELD(layers), FIELD(rectified), FIELD(layer)});
}

std::string adamw_structure() {
  using Type = AdamWConfig;
  return structure("AdamWConfig", sizeof(Type), {FIELD(rate), FIELD(decay)});
}

std::string descent_structure() {
  using Type = Descent;
  return structure("Descent", sizeof(Type),
                   {FIELD(rows), FIELD(shares), FIELD(steps), FIELD(regularizer), FIELD(polytope), FIELD(network),
                    FIELD(first_beta), FIELD(second_beta), FIELD(epsilon), FIELD(theta), FIELD(networks), FIELD(mean),
                    FIELD(scale), FIELD(share), FIELD(squared), FIELD(seen), FIELD(loss_sum)});
}

std::string dynamics_structure() {
  using Type = stepping::Dynamics;
  return structure(
      "Dynamics", sizeof(Type),
      {FIELD(inverse_inertia), FIELD(inertia), FIELD(inverse_mass), FIELD(gravity), FIELD(tolerance), FIELD(max_sweeps)});
}

std::string world_structure() {
  using Type = stepping::ContactWorld;
  return structure("ContactWorld", sizeof(Type),
                   {FIELD(vertices), FIELD(vertices_normal), FIELD(normal), FIELD(vertices_tangent), FIELD(tangents),
                    FIELD(pivot), FIELD(height), FIELD(dynamics)});
}

#define FUNCTION(name) function(#name, ::name)

std::string functions() {
  return FUNCTION(contact_curation_solve_cones) + FUNCTION(contact_curation_evaluate) +
         FUNCTION(contact_curation_evaluate_bouncing) + FUNCTION(contact_curation_evaluate_weighted) +
         FUNCTION(contact_curation_descend) + FUNCTION(contact_curation_descend_deep) +
         FUNCTION(contact_curation_descend_deepvertex) + FUNCTION(contact_curation_descend_end_to_end) +
         FUNCTION(contact_time_step) + FUNCTION(contact_time_step_bouncing) + FUNCTION(contact_given_step) +
         FUNCTION(contact_rollout) + FUNCTION(contact_rollout_bouncing) + FUNCTION(contact_curation_elementary) +
         FUNCTION(contact_curation_powers);
}

}  // namespace
}  // namespace contact_curation

extern "C" const char *contact_curation_interface() {
  using namespace contact_curation;
  static const std::string text = solver_structures() + model_structure() + evaluation_structure() + moments_structure() +
                                  layer_structure() + network_structure() + adamw_structure() + descent_structure() +
                                  dynamics_structure() + world_structure() + functions();
  return text.c_str();
}
