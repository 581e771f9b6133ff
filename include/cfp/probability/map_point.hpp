/// @file map_point.hpp
/// Static probability M of a map point over time, and the weight that a keypoint and its map point give an observation
/// (paper section IV-D). The paper only says "is updated"; the policies are ours.
#pragma once

#include <cmath>
#include <cstdint>

#include "cfp/core/numeric.hpp"
#include "cfp/core/options.hpp"

namespace cfp {

enum class MapPointPolicy : std::uint8_t {
  log_odds,  ///< Bayes' rule for independent measurements, tempered: logit M + rate logit K, bounded by evidence_limit
  exponential_mean,  ///< M + rate (K - M)
  copy  ///< K, the simplest reading of the paper: a static in-box point has P(K < 0.3) ~ 0.25 in each frame
};

enum class WeightRule : std::uint8_t { product, minimum };

struct MapPointOptions {
  /// At the same number of frames until a moving point is deleted, log_odds deletes 5 to 15 times fewer static points
  /// than the exponential mean, and its M is nearer to the truth (benchmarks/studies/map_point_study).
  MapPointPolicy policy = MapPointPolicy::log_odds;
  double rate = 0.2;                ///< weight of the new K against M, in (0, 1]; the same study
  double evidence_limit = 0.02;     ///< log_odds only: K and M are kept in [limit, 1 - limit], in [1e-4, 0.5)
  double deletion_threshold = 0.3;  ///< a map point with M below it is to be deleted (paper), in [0, 1]
  /// |K - M| above it: keypoint and map point are mismatched (no value in the paper), in (0, 1]
  double mismatch_threshold = 0.5;
  WeightRule weight = WeightRule::product;  ///< how K and M give one weight (paper: "as weights")
};

inline namespace CFP_ISA {

[[nodiscard]] inline OptionPath invalid_field(const MapPointOptions& o) noexcept {
  if (!(o.rate > 0 && o.rate <= 1)) return "rate";
  // Nearer to 1 a float has too few numbers left: M would not move, or be NaN.
  if (!(o.evidence_limit >= 1e-4 && o.evidence_limit < 0.5)) return "evidence_limit";
  if (!(o.deletion_threshold >= 0 && o.deletion_threshold <= 1)) return "deletion_threshold";
  if (!(o.mismatch_threshold > 0 && o.mismatch_threshold <= 1)) return "mismatch_threshold";
  return {};
}

}  // namespace CFP_ISA

namespace detail {
inline namespace CFP_ISA {

template <typename Scalar>
[[nodiscard]] Scalar log_odds_update(Scalar k, Scalar m, Scalar rate, Scalar limit) noexcept {
  using std::exp;
  using std::log;
  const auto bounded = [limit](Scalar p) {
    return p < limit ? limit : (p > Scalar(1) - limit ? Scalar(1) - limit : p);
  };
  const auto logit = [](Scalar p) { return log(p / (Scalar(1) - p)); };
  const Scalar updated = bounded(Scalar(1) / (Scalar(1) + exp(-(logit(bounded(m)) + rate * logit(bounded(k))))));
  // A K beyond the bound never lowers M: a point that was never in doubt keeps the weight 1 that it has without this
  // library.
  return k > Scalar(1) - limit && updated < m ? m : updated;
}

}  // namespace CFP_ISA
}  // namespace detail

inline namespace CFP_ISA {

/// M after the keypoint's second-stage K: see MapPointPolicy. In [0, 1], non-decreasing in both arguments; with the
/// exponential mean, K = M is a fixed point. A K or M that is NaN counts as 0.
template <typename Scalar>
[[nodiscard]] Scalar updated_map_point(Scalar keypoint_probability, Scalar map_point_probability,
                                       const MapPointOptions& options) noexcept {
  const Scalar m = clamp_probability(map_point_probability);
  const Scalar k = clamp_probability(keypoint_probability);
  switch (options.policy) {
    case MapPointPolicy::copy:
      return k;
    case MapPointPolicy::exponential_mean:
      return clamp_probability(m + Scalar(options.rate) * (k - m));
    case MapPointPolicy::log_odds:
      return detail::log_odds_update(k, m, Scalar(options.rate), Scalar(options.evidence_limit));
  }
  return m;
}

/// Bayes' rule with M as the prior of a keypoint and K as what this frame's geometry says: odds = odds(K) odds(M), both
/// kept in [evidence_limit, 1 - evidence_limit]. In [0, 1], increasing in both; M = 1/2 gives K. K = 0 stays 0: that is
/// a rule (a false match, for example), not a measurement. NaN counts as 0. Not in the paper.
template <typename Scalar>
[[nodiscard]] constexpr Scalar posterior_probability(Scalar keypoint_probability, Scalar map_point_probability,
                                                     const MapPointOptions& options) noexcept {
  const Scalar limit = static_cast<Scalar>(options.evidence_limit);
  const auto bounded = [limit](Scalar p) {
    return p < limit ? limit : (p > Scalar(1) - limit ? Scalar(1) - limit : p);
  };
  const Scalar raw = clamp_probability(keypoint_probability);
  if (!(raw > Scalar(0))) return Scalar(0);
  const Scalar k = bounded(raw), m = bounded(clamp_probability(map_point_probability));
  return k * m / (k * m + (Scalar(1) - k) * (Scalar(1) - m));
}

/// M < 0.3: the host should delete the map point.
template <typename Scalar>
[[nodiscard]] constexpr bool is_deletable(Scalar map_point_probability, const MapPointOptions& options) noexcept {
  return !(map_point_probability >= Scalar(options.deletion_threshold));
}

/// |K - M| large: the two are mismatched and the observation takes no part in the pose optimisation. NaN is a mismatch.
template <typename Scalar>
[[nodiscard]] constexpr bool is_mismatch(Scalar keypoint_probability, Scalar map_point_probability,
                                         const MapPointOptions& options) noexcept {
  const Scalar difference = keypoint_probability - map_point_probability;
  return !(difference <= Scalar(options.mismatch_threshold) && -difference <= Scalar(options.mismatch_threshold));
}

/// The weight of the observation in the first-stage pose: K M or min(K, M); in [0, 1], NaN counts as 0. The
/// mismatch rule is not part of it: in the first stage K is coarse, a foreground point's 0 says nothing of its match.
template <typename Scalar>
[[nodiscard]] constexpr Scalar observation_weight(Scalar keypoint_probability, Scalar map_point_probability,
                                                  WeightRule rule) noexcept {
  const Scalar k = clamp_probability(keypoint_probability);
  const Scalar m = clamp_probability(map_point_probability);
  switch (rule) {
    case WeightRule::product:
      return k * m;
    case WeightRule::minimum:
      return k < m ? k : m;
  }
  return Scalar(0);
}

}  // namespace CFP_ISA
}  // namespace cfp
