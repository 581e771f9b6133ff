/// @file object.hpp
/// Static probability O of a potentially moving object from the epipolar distances of the optical-flow pairs on it
/// (paper section IV-B), and over time, as the evidence of a tracked object adds up over frames. Distances are in
/// pixels; probabilities are P(static) in [0, 1].
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "cfp/core/options.hpp"
#include "cfp/core/span.hpp"
#include "cfp/core/status.hpp"
#include "cfp/geometry/distance.hpp"
#include "cfp/math/chi_squared.hpp"
#include "cfp/math/order_statistic.hpp"

namespace cfp {

/// Which function of the chi-squared distribution scores one pair. As printed (the density) a score cannot exceed 0.5
/// at two degrees of freedom, so the paper's threshold of 0.9 could never be passed and its low-dynamic branch would be
/// dead; the related open code uses twice the density, which for two degrees of freedom is the survival function.
enum class ObjectScore : std::uint8_t {
  survival,  ///< Q(x; k), the upper tail: the default
  density    ///< the density, as printed in the paper, clamped to [0, 1]
};

struct ObjectProbabilityOptions {
  ObjectScore score = ObjectScore::survival;
  /// k, in [1, 100]. The paper's 2; a distance from a line has statistically one degree of freedom.
  int degrees_of_freedom = 2;
  /// Scale of the distances in pixels, > 0. With 1 (the paper) the score is 0.9 at 0.46 px, and a static object with a
  /// noise of 1 px scores 0.43 at the paper's positions: O depends on the pixel scale, which sigma_px sets.
  double sigma_px = 1;
  /// If the noise of the flow has been measured, sigma_px is this multiple of its standard deviation, so that a static
  /// object scores the same at any noise (0.96) and O_Th keeps its meaning. 0: sigma_px is used as it is and an F of
  /// the flow counts as exact, as printed. >= 0.
  double noise_factor = 5.8;
  /// Positions of the ascending order statistics whose mean is O: shares of the number of pairs in (0, 1], ascending.
  /// The paper's are 0.1, 0.2, 0.3; a seventh of wrong depths or mismatches is then taken for motion
  /// (benchmarks/studies/object_motion_study).
  std::array<double, 3> positions = {0.2, 0.3, 0.4};
  /// Outliers (mistracked pairs, wrong depths) are no motion. Their share is estimated as that of the pairs on no
  /// object which score below 1/2, at most this, in [0, 1); the same share of the object's lowest scores is skipped
  /// before the positions are taken. 0: none is skipped, as printed (cfp_object_motion_study).
  double max_stray_share = 0.4;
  /// If depths are known, the common shift of an object's pairs is tested, too (common_shift). Neighbouring pairs also
  /// share an error of the image itself; this is its lower bound where the frame shows less, px, >= 0
  /// (cfp_object_motion_study). 0: no such test, pairs are scored one by one, as printed.
  double shared_error_px = 0.02;
  /// Fewer usable pairs than this, and O is unknown (>= 1; benchmarks/studies/object_motion_study).
  std::size_t min_pairs = 8;
  /// What an unknown object counts as, in [0, 1]. Below O_Th: an object is dynamic until it is shown to be static.
  double unknown_object_probability = 0.5;
};

/// The static probability of one object and where it comes from.
struct ObjectProbability {
  double static_probability = 0;            ///< O in [0, 1]; unknown_object_probability when the status is not ok
  std::size_t pairs = 0;                    ///< usable pairs: finite, non-negative distances
  Status status = Status::not_enough_data;  ///< not_enough_data: O is unknown
  double together = 1;  ///< O of this frame from the pairs' common shift if one by one they look static; else 1
};

struct ObjectMemoryOptions {
  double time_constant_s = 0.2;  ///< evidence decays to 1/e in this time, >= 0; 0: no memory, as printed
  /// log-odds that a frame may contribute and memory may hold, in (0, 100]: a start is seen at once
  double evidence_limit = 3;
};

/// The accumulated evidence of one object.
struct ObjectMemory {
  double evidence = 0;  ///< log-odds of static against moving, 0 at O_Th
  bool known = false;   ///< some frame had evidence
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const ObjectProbabilityOptions& o) noexcept {
  if (!is_degrees_of_freedom(o.degrees_of_freedom)) return "degrees_of_freedom";
  if (!detail::positive(o.sigma_px)) return "sigma_px";
  if (!detail::non_negative(o.noise_factor)) return "noise_factor";
  if (!(o.max_stray_share >= 0 && o.max_stray_share < 1)) return "max_stray_share";
  if (!detail::non_negative(o.shared_error_px)) return "shared_error_px";
  if (!(o.positions[0] > 0 && o.positions[0] <= o.positions[1] && o.positions[1] <= o.positions[2] &&
        o.positions[2] <= 1))
    return "positions";
  if (o.min_pairs < 1) return "min_pairs";
  if (!(o.unknown_object_probability >= 0 && o.unknown_object_probability <= 1)) return "unknown_object_probability";
  return {};
}

[[nodiscard]] constexpr OptionPath invalid_field(const ObjectMemoryOptions& o) noexcept {
  if (!detail::non_negative(o.time_constant_s)) return "time_constant_s";
  return o.evidence_limit > 0 && o.evidence_limit <= 100 ? OptionPath() : "evidence_limit";
}

/// The options scaled to a measured noise (standard deviation of one coordinate, px); unchanged if it was not measured
/// (sigma 0) or noise_factor is 0. A distance from a line measures one of two coordinates and counts as if it measured
/// both.
[[nodiscard]] inline ObjectProbabilityOptions scaled_to_noise(ObjectProbabilityOptions options, double noise_sigma_px,
                                                              int coordinates) noexcept {
  const double scale = options.noise_factor * noise_sigma_px / std::sqrt(2.0 / coordinates);
  if (detail::positive(scale)) options.sigma_px = scale;
  return options;
}

/// Score of one pair: f((d / sigma)^2; k) with f as `options.score` says (paper eqs. chsq and (O)_m). Non-increasing in
/// |d|, except for densities with k > 2. In [0, 1]; NaN or an infinite distance scores 0. Allocates nothing.
template <typename Scalar>
[[nodiscard]] Scalar object_score(Scalar epipolar_distance_px, const ObjectProbabilityOptions& options) noexcept {
  if (!is_finite(epipolar_distance_px)) return Scalar(0);
  const Scalar r = epipolar_distance_px / Scalar(options.sigma_px);
  const int k = options.degrees_of_freedom;
  return clamp_probability(options.score == ObjectScore::survival ? chi_squared_survival(r * r, k)
                                                                  : chi_squared_density(r * r, k));
}

/// O = mean of the ascending scores at the 1-based positions ceil(q M), q in `options.positions`, at least 1 (paper
/// IV-B). Distances that are negative ("no distance") or not finite are left out; `workspace` needs room for all
/// distances and is overwritten. Fewer than min_pairs usable distances: unknown, see ObjectProbability. O(M), allocates
/// nothing.
template <typename Range, typename Scalar = range_value_t<Range>>
[[nodiscard]] ObjectProbability object_probability(const Range& epipolar_distances_px,
                                                   const ObjectProbabilityOptions& options,
                                                   span<non_deduced<Scalar>> workspace) noexcept {
  ObjectProbability result;
  result.static_probability = options.unknown_object_probability;
  const std::size_t n = copy_distances(span<const Scalar>(epipolar_distances_px), workspace);
  result.pairs = n;
  if (n < (std::max)(options.min_pairs, std::size_t(1))) return result;

  const span<Scalar> scores = workspace.subspan(0, n);
  for (Scalar& value : scores) value = object_score(value, options);
  double sum = 0;
  for (const double q : options.positions) sum += static_cast<double>(quantile(scores, q));
  result.static_probability = clamp_probability(sum / static_cast<double>(options.positions.size()));
  result.status = Status::ok;
  return result;
}

/// O from the chi-squared of common_shift: Q(chi_squared / 16; 3). An object at rest scores above 0.9 in 97.5 % of its
/// frames if there is no error but the noise. Not in the paper.
[[nodiscard]] inline double shift_probability(double chi_squared) noexcept {
  return chi_squared_survival(chi_squared / 16, 3);
}

/// log(O / (1 - O)) - log(O_Th / (1 - O_Th)), within +-limit: the evidence of one frame for an object being static, 0
/// at O_Th.
[[nodiscard]] inline double object_evidence(double object_probability, double object_threshold, double limit) noexcept {
  const double o = clamp_probability(object_probability);
  const double odds = o * (1 - object_threshold) / ((1 - o) * object_threshold);
  return std::clamp(std::log(odds), -limit, limit);
}

/// O with the memory of frames before, dt_s after the last: evidence <- exp(-dt / tau) evidence + that of this frame,
/// within +-evidence_limit; O follows from it, and is O_Th for evidence 0. A frame in which O is unknown only lets
/// memory fade; O stays known while something is remembered. dt_s that is not positive counts as 0. Not in the paper,
/// whose O forgets everything between frames.
inline ObjectProbability remember_object(const ObjectProbability& object, double dt_s, double object_threshold,
                                         const ObjectMemoryOptions& options, ObjectMemory& memory) noexcept {
  if (!(options.time_constant_s > 0)) return object;
  memory.evidence *= kept_share(dt_s, options.time_constant_s);
  if (object.status == Status::ok) {
    const double limit = options.evidence_limit;
    const double now = object_evidence(object.static_probability, object_threshold, limit);
    memory.evidence = std::clamp(memory.evidence + now, -limit, limit);
    memory.known = true;
  } else if (!(std::abs(memory.evidence) > 0.05 * options.evidence_limit)) {
    memory = {};
  }
  if (!memory.known) return object;
  const double odds = std::exp(memory.evidence) * object_threshold / (1 - object_threshold);
  return {odds / (1 + odds), object.pairs, Status::ok, object.together};
}

}  // namespace CFP_ISA
}  // namespace cfp
