/// @file object_memory.hpp
/// Static probability O of an object over time: an object has a track, and its evidence adds up over frames. Not in the
/// paper, whose O forgets everything between frames.
#pragma once

#include <algorithm>
#include <cmath>

#include "cfp/core/options.hpp"
#include "cfp/core/status.hpp"
#include "cfp/probability/object.hpp"

namespace cfp {

struct ObjectMemoryOptions {
  double time_constant_s = 0.2;  ///< after it, evidence counts 1/e, >= 0; 0: no memory, as printed
  /// log-odds that a frame may contribute and memory may hold, > 0: a start is seen at once
  double evidence_limit = 3;
};

/// What is remembered of one object.
struct ObjectMemory {
  double evidence = 0;  ///< log-odds of static against moving, 0 at O_Th
  bool known = false;   ///< some frame had evidence
};

inline namespace CFP_ISA {

[[nodiscard]] constexpr OptionPath invalid_field(const ObjectMemoryOptions& o) noexcept {
  if (!detail::non_negative(o.time_constant_s)) return "time_constant_s";
  return detail::positive(o.evidence_limit) ? OptionPath() : "evidence_limit";
}

/// log(O / (1 - O)) - log(O_Th / (1 - O_Th)), within +-limit: what one frame says of an object, 0 at O_Th.
[[nodiscard]] inline double object_evidence(double object_probability, double object_threshold, double limit) noexcept {
  const double o = clamp_probability(object_probability);
  const double odds = o * (1 - object_threshold) / ((1 - o) * object_threshold);
  return (std::min)((std::max)(std::log(odds), -limit), limit);
}

/// O with the memory of frames before, dt_s after the last: evidence <- exp(-dt / tau) evidence + that of this frame,
/// within
/// +-evidence_limit, and O so that O_Th is where nothing is remembered and the frame says nothing. A frame in which O
/// is unknown only lets memory fade; O stays known while something is remembered. dt_s that is not positive counts as
/// 0.
inline ObjectProbability remember_object(const ObjectProbability& object, double dt_s, double object_threshold,
                                         const ObjectMemoryOptions& options, ObjectMemory& memory) noexcept {
  if (!(options.time_constant_s > 0)) return object;
  memory.evidence *= std::exp(-(dt_s > 0 ? dt_s : 0.0) / options.time_constant_s);
  if (object.status == Status::ok) {
    const double limit = options.evidence_limit;
    const double now = object_evidence(object.static_probability, object_threshold, limit);
    memory.evidence = (std::min)((std::max)(memory.evidence + now, -limit), limit);
    memory.known = true;
  } else if (!(std::abs(memory.evidence) > 0.05 * options.evidence_limit)) {
    memory = {};
  }
  if (!memory.known) return object;
  const double odds = std::exp(memory.evidence) * object_threshold / (1 - object_threshold);
  return {odds / (1 + odds), object.pairs, Status::ok};
}

}  // namespace CFP_ISA
}  // namespace cfp
