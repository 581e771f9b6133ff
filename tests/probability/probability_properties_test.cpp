// Properties of the objects' memory, for whatever the generators make; those of the formulas are in tests/properties.
#include <cmath>

#include "cfp/probability/object.hpp"
#include "cfp_testing/numbers.hpp"
#include "support/properties.hpp"

using cfp::ObjectProbability;
using cfp::Random;

namespace {

constexpr double static_from = 0.8;

ObjectProbability from_flow(double o) { return {o, 30, cfp::Status::ok}; }

double after(const ObjectProbability& object, double dt_s, cfp::ObjectMemory& memory) {
  return cfp::remember_object(object, dt_s, static_from, {}, memory).static_probability;
}

}  // namespace

CFP_PROPERTIES("Properties of the objects' memory", "[probability]",
               {"O remembered is a probability, whatever was seen and however the clock goes", 500,
                [](Random& random) {
                  cfp::ObjectMemory memory;
                  for (int k = 0; k < 10; ++k) {
                    ObjectProbability object = from_flow(cfp_testing::any_number<double>(random));
                    if (random.index(3) == 0) object.status = cfp::Status::not_enough_data;
                    const double dt = cfp_testing::any_number<double>(random);
                    const double o =
                        cfp::remember_object(object, dt == dt ? dt : 0, static_from, {}, memory).static_probability;
                    if (object.status == cfp::Status::ok && !(o >= 0 && o <= 1)) return false;
                  }
                  return true;
                }},
               {"without a time constant nothing is remembered", 100,
                [](Random& random) {
                  cfp::ObjectMemory memory;
                  cfp::ObjectMemoryOptions options;
                  options.time_constant_s = 0;
                  (void)cfp::remember_object(from_flow(cfp_testing::probability(random)), 0.03, static_from, options,
                                             memory);
                  const double o = cfp_testing::probability(random);
                  return cfp::remember_object(from_flow(o), 0.03, static_from, options, memory).static_probability == o;
                }},
               {"more evidence for rest never lowers what is remembered", 200,
                [](Random& random) {
                  cfp::ObjectMemory a, b;
                  for (int k = 0; k < 5; ++k) {
                    const double o = cfp_testing::probability(random), more = o + (1 - o) * random.uniform();
                    if (after(from_flow(more), 0.03, b) < after(from_flow(o), 0.03, a) - 1e-12) return false;
                  }
                  return true;
                }},
               {"the longer nothing is seen, the nearer is O to the threshold", 200, [](Random& random) {
                  cfp::ObjectMemory a;
                  (void)after(from_flow(cfp_testing::probability(random)), 0.03, a);
                  cfp::ObjectMemory b = a;
                  const ObjectProbability nothing{};
                  const double dt = random.uniform(0, 0.2), more = dt + random.uniform(0, 0.2);
                  const auto soon = cfp::remember_object(nothing, dt, static_from, {}, a),
                             later = cfp::remember_object(nothing, more, static_from, {}, b);
                  if (later.status != cfp::Status::ok) return true;
                  return std::abs(later.static_probability - static_from) <=
                         std::abs(soon.static_probability - static_from) + 1e-12;
                }})
